//! One process: its start, its input and output, and its end.

use std::path::Path;
use std::pin::pin;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use anyhow::Context;
use rustix::process::{Pid, Signal, kill_process_group};
use tauscope_pipeline::pipeline::Settings;
use tauscope_pipeline::pipeline::stages::outside::OutsideEntry;
use tokio::io::{AsyncBufReadExt, AsyncRead, AsyncWriteExt, BufReader};
use tokio::process::{Child, ChildStdin, Command};
use tokio::sync::mpsc;

/// Longest line of a stage's output; longer ones are cut.
const LONGEST_LINE_BYTES: usize = 64 * 1024;
/// Time for which the output of a dead process is still read.
const LAST_WORDS: Duration = Duration::from_millis(200);

/// Event of a process.
#[derive(Debug)]
pub enum Event {
    /// A line on its standard error.
    Said(String),
    /// A line on its standard output.
    Reported(String),
    /// Its exit, after all of its output.
    Exited(std::io::Result<ExitStatus>),
}

/// A running process. Dropped, its process group is killed.
#[derive(Debug)]
pub struct Process {
    group: Pid,
    /// Queue of lines for its standard input; `None` once it is closed.
    orders: Option<mpsc::Sender<Vec<u8>>>,
}

/// Returns the command that starts the process of a stage.
pub fn command(settings: &Settings, folder: &Path) -> anyhow::Result<Command> {
    let program = std::env::current_exe().context("cannot find the program itself")?;
    let mut command = Command::new(program);
    match settings.get() {
        Some(OutsideEntry { command: words, .. }) => {
            command.arg("exec").arg("--").args(words);
            if !folder.as_os_str().is_empty() {
                command.current_dir(folder);
            }
        }
        None => {
            command.arg("stage");
        }
    }
    Ok(command)
}

impl Process {
    /// Starts the process and sends it this line; its events go to `events`, marked with `mark`. At most `most_told`
    /// lines wait to be read by it.
    pub fn start<M: Copy + Send + Sync + 'static>(
        mut command: Command,
        name: &str,
        line: Vec<u8>,
        most_told: usize,
        mark: M,
        events: mpsc::Sender<(M, Event)>,
    ) -> anyhow::Result<Self> {
        let mut child = command
            // Only the supervisor notifies the service manager.
            .env_remove("NOTIFY_SOCKET")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // Ctrl-C in a terminal then only reaches the supervisor, which ends the stages itself.
            .process_group(0)
            .spawn()
            .with_context(|| format!("cannot start the process of `{name}`"))?;
        let group = child
            .id()
            .and_then(|id| Pid::from_raw(id.cast_signed()))
            .context("the process has no id")?;
        let (orders, inbox) = mpsc::channel(most_told);
        if let Some(stdin) = child.stdin.take() {
            tokio::spawn(tell(stdin, line, inbox));
        }
        tokio::spawn(follow(child, mark, events));
        let orders = Some(orders);
        Ok(Self { group, orders })
    }

    /// Queues a line for its standard input.
    pub fn tell(&self, line: Vec<u8>) {
        // If the queue is full, the process does not read; if it is closed, the process has exited.
        if let Some(orders) = &self.orders {
            let _ = orders.try_send(line);
        }
    }

    /// Closes its standard input: it exits once it has handled the queued lines.
    pub fn close(&mut self) {
        self.orders = None;
    }

    /// Kills it and all processes that it has started.
    pub fn kill(&self) {
        // The only error is that it has already exited.
        let _ = kill_process_group(self.group, Signal::KILL);
    }

    /// Its process id.
    pub fn id(&self) -> i32 {
        self.group.as_raw_nonzero().get()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Writes queued lines to the standard input of a process, and closes it once the queue is closed.
async fn tell(mut stdin: ChildStdin, first: Vec<u8>, mut orders: mpsc::Receiver<Vec<u8>>) {
    let mut next = Some(first);
    while let Some(mut line) = next {
        line.push(b'\n');
        // A broken pipe means that the process exits, which `follow` notices.
        if stdin.write_all(&line).await.is_err() {
            return;
        }
        next = orders.recv().await;
    }
}

/// Forwards the output of a process and waits for its exit.
async fn follow<M: Copy + Send + Sync + 'static>(
    mut child: Child,
    mark: M,
    events: mpsc::Sender<(M, Event)>,
) {
    let said = child.stderr.take();
    let reported = child.stdout.take();
    let heard = async {
        tokio::join!(
            lines(said, mark, &events, Event::Said),
            lines(reported, mark, &events, Event::Reported)
        )
    };
    let mut heard = pin!(heard);
    let status = tokio::select! {
        _ = &mut heard => child.wait().await,
        status = child.wait() => {
            // Its last output is still in the pipes, but a process that it has started may keep them open forever.
            let _ = tokio::time::timeout(LAST_WORDS, heard).await;
            status
        }
    };
    let _ = events.send((mark, Event::Exited(status))).await;
}

/// Sends every line of a pipe.
async fn lines<M: Copy + Send + Sync>(
    pipe: Option<impl AsyncRead + Unpin>,
    mark: M,
    events: &mpsc::Sender<(M, Event)>,
    event: fn(String) -> Event,
) {
    let Some(pipe) = pipe else { return };
    let mut pipe = BufReader::new(pipe);
    let mut line = Vec::new();
    loop {
        let (taken, ended) = match pipe.fill_buf().await {
            Ok([]) | Err(_) => break,
            Ok(bytes) => {
                let end = bytes.iter().position(|&byte| byte == b'\n');
                line.extend_from_slice(&bytes[..end.unwrap_or(bytes.len())]);
                (end.map_or(bytes.len(), |end| end + 1), end.is_some())
            }
        };
        pipe.consume(taken);
        if (ended || line.len() > LONGEST_LINE_BYTES) && !send(&mut line, mark, events, event).await
        {
            return;
        }
    }
    if !line.is_empty() {
        send(&mut line, mark, events, event).await;
    }
}

async fn send<M: Copy + Send + Sync>(
    line: &mut Vec<u8>,
    mark: M,
    events: &mpsc::Sender<(M, Event)>,
    event: fn(String) -> Event,
) -> bool {
    let text = String::from_utf8_lossy(line).trim_end().to_owned();
    line.clear();
    events.send((mark, event(text))).await.is_ok()
}
