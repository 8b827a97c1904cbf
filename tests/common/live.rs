//! A running pipeline.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::common::tauscope;

/// Generous timeout for slow machines; normally never reached.
const PATIENCE: Duration = Duration::from_mins(1);

/// `tauscope run`, with its output read line by line.
pub struct Live {
    child: Child,
    lines: Receiver<String>,
    /// Lines read so far.
    pub heard: Vec<String>,
}

impl Live {
    /// Runs `pipeline.yaml` in `folder`.
    pub fn start(folder: &Path, more: &[&str]) -> Self {
        Self::start_as(tauscope(), folder, more)
    }

    /// Runs `pipeline.yaml` in `folder` by a command with its own environment.
    pub fn start_as(mut command: Command, folder: &Path, more: &[&str]) -> Self {
        command
            .current_dir(folder)
            .args(["run", "--json"])
            .args(more);
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (sender, lines) = channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Self {
            child,
            lines,
            heard: Vec::new(),
        }
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for a line that begins with `start` and returns the rest of it.
    pub fn wait_for(&mut self, start: &str) -> String {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let Ok(line) = self.lines.recv_timeout(left) else {
                panic!("no line that begins with {start:?} in {:#?}", self.heard);
            };
            let rest = line.strip_prefix(start).map(str::to_owned);
            self.heard.push(line);
            if let Some(rest) = rest {
                return rest;
            }
        }
    }

    /// Waits for a line that has `part` in it and returns it.
    pub fn wait_for_part(&mut self, part: &str) -> String {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let Ok(line) = self.lines.recv_timeout(left) else {
                panic!("no line with {part:?} in {:#?}", self.heard);
            };
            self.heard.push(line.clone());
            if line.contains(part) {
                return line;
            }
        }
    }

    /// All remaining lines of the output.
    pub fn rest(&mut self) -> String {
        let rest: Vec<String> = self.lines.iter().collect();
        rest.join("\n")
    }

    /// Process id of a stage that is about to start.
    pub fn wait_for_stage(&mut self, stage: &str) -> u32 {
        let id = self.wait_for(&format!("stage `{stage}` runs as process "));
        id.parse().unwrap()
    }

    /// Waits for the end of the run; returns exit code (-1 for a signal) and summary.
    pub fn end(mut self) -> (i32, serde_json::Value) {
        let deadline = Instant::now() + PATIENCE;
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status;
            }
            if Instant::now() > deadline {
                self.child.kill().unwrap();
                panic!(
                    "it does not end: {:#?}",
                    self.lines.try_iter().collect::<Vec<_>>()
                );
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let summary = serde_json::from_reader(self.child.stdout.take().unwrap());
        (
            status.code().unwrap_or(-1),
            summary.unwrap_or(serde_json::Value::Null),
        )
    }
}

/// Kills the process if a test fails.
impl Drop for Live {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal, e.g. `KILL`.
pub fn signal(process: u32, name: &str) {
    let status = Command::new("kill")
        .arg(format!("-{name}"))
        .arg(process.to_string())
        .status();
    assert!(status.unwrap().success(), "no process {process}");
}

/// Whether the process exists and is not a zombie.
pub fn is_alive(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    let state = stat.rsplit(')').next().unwrap_or("").trim_start();
    !state.is_empty() && !state.starts_with('Z')
}

/// Waits until `condition` holds.
pub fn wait_until(what: &str, condition: impl Fn() -> bool) {
    let deadline = Instant::now() + PATIENCE;
    while !condition() {
        assert!(Instant::now() < deadline, "not in time: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Entry of a stage in the summary.
pub fn stage<'a>(summary: &'a serde_json::Value, name: &str) -> &'a serde_json::Value {
    let stages = summary["stages"].as_array().unwrap();
    stages.iter().find(|stage| stage["stage"] == name).unwrap()
}
