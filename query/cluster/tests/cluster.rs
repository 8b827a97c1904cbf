//! Tests of a scheduler and executors as separate programs.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use datafusion::arrow::util::pretty::pretty_format_batches;
use datafusion::prelude::SessionContext;

/// Recordings that are replayed: enough that two executors work for some seconds.
const RECORDINGS: usize = 24;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .unwrap()
        .to_owned()
}

/// First of `count` consecutive free ports.
fn ports(count: u16) -> u16 {
    loop {
        let first = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap()
            .port();
        let is_free = |port| TcpListener::bind(("127.0.0.1", port)).is_ok();
        if first < u16::MAX - count && (first..first + count).all(is_free) {
            return first;
        }
    }
}

/// A program that ends with the test.
struct Program(Child);

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tauscope-cluster"));
        Self(
            command
                .args(arguments)
                .current_dir(root())
                .stdout(Stdio::piped())
                .spawn()
                .unwrap(),
        )
    }

    /// Computing time so far \[s\].
    fn cpu_s(&self) -> f64 {
        let text = std::fs::read_to_string(format!("/proc/{}/stat", self.0.id())).unwrap();
        let fields: Vec<&str> = text
            .rsplit(')')
            .next()
            .unwrap()
            .split_whitespace()
            .collect();
        let ticks = |field: usize| fields[field].parse::<f64>().unwrap();
        // User and system time, in ticks of 10 ms.
        (ticks(11) + ticks(12)) / 100.0
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(120), "{what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn scheduler(port: u16) -> Program {
    let program = Program::start(&["scheduler", "--listen", &format!("127.0.0.1:{port}")]);
    wait_for("the scheduler listens", || {
        TcpStream::connect(("127.0.0.1", port)).is_ok()
    });
    program
}

fn executor(scheduler: u16, port: u16) -> Program {
    let (address, port_text) = (format!("127.0.0.1:{scheduler}"), port.to_string());
    let arguments = [
        "executor",
        "--scheduler",
        &address,
        "--port",
        &port_text,
        "--tasks",
        "1",
    ];
    let program = Program::start(&arguments);
    wait_for("the executor listens", || {
        TcpStream::connect(("127.0.0.1", port)).is_ok()
    });
    program
}

fn ask(port: u16, arguments: &[&str]) -> Output {
    let address = format!("127.0.0.1:{port}");
    let arguments = [&["query", "--scheduler", &address], arguments].concat();
    Command::new(env!("CARGO_BIN_EXE_tauscope-cluster"))
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap()
}

/// Answer of a single process.
fn alone(sql: &str, paths: &[PathBuf]) -> String {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let context = SessionContext::new();
        tauscope_query::register(&context, paths).await.unwrap();
        let frame = tauscope_query::plan(&context, sql).await.unwrap();
        pretty_format_batches(&frame.collect().await.unwrap())
            .unwrap()
            .to_string()
    })
}

/// An archive of copies with distinct names, and a pipeline with absolute paths.
fn archive() -> (tempfile::TempDir, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let data = root().join("tests/data");
    for number in 0..RECORDINGS {
        let from = if number % 3 == 0 {
            "demo.mcap"
        } else {
            "demo_validation.mcap"
        };
        std::fs::copy(
            data.join(from),
            folder.path().join(format!("r{number:02}.mcap")),
        )
        .unwrap();
    }
    let text = std::fs::read_to_string(root().join("pipeline.yaml")).unwrap();
    let pipeline = folder.path().join("pipeline.yaml");
    std::fs::write(
        &pipeline,
        text.replace(" tests/data", &format!(" {}", data.display())),
    )
    .unwrap();
    let pattern = folder.path().join("*.mcap").display().to_string();
    (folder, pipeline.display().to_string(), pattern)
}

#[test]
fn an_executor_that_is_killed_in_the_middle_changes_no_answer() {
    let (_folder, pipeline, pattern) = archive();
    let sql = format!(
        "select recording, row, stage, joint, link, t_ns, samples, score from replay('{pipeline}', '{pattern}') \
         order by recording, row, stage, joint, t_ns"
    );
    let expected = alone(&sql, &[]);
    assert!(expected.contains("link6") && expected.lines().count() > RECORDINGS);
    let port = ports(5);
    let _scheduler = scheduler(port);
    let first = executor(port, port + 1);
    let second = executor(port, port + 3);
    let (idle_s, address) = ([first.cpu_s(), second.cpu_s()], format!("127.0.0.1:{port}"));
    let mut asked = Program::start(&[
        "query",
        "--scheduler",
        &address,
        "--deadline-s",
        "300",
        &sql,
    ]);
    // Both are at work.
    wait_for("both executors work", || {
        first.cpu_s() > idle_s[0] + 0.5 && second.cpu_s() > idle_s[1] + 0.5
    });
    assert!(
        asked.0.try_wait().unwrap().is_none(),
        "the query has ended before an executor could be killed"
    );
    // SIGKILL.
    drop(second);
    let mut answer = String::new();
    asked
        .0
        .stdout
        .take()
        .unwrap()
        .read_to_string(&mut answer)
        .unwrap();
    assert!(asked.0.wait().unwrap().success());
    assert_eq!(answer.trim(), expected.trim());
}

#[test]
fn tables_of_recordings_and_results_are_answered_as_by_one_process() {
    let (folder, _, pattern) = archive();
    let port = ports(3);
    let _scheduler = scheduler(port);
    let _executor = executor(port, port + 1);
    for sql in [
        "select recording, messages, chunks from recordings order by recording",
        "select recording, joint, count(*) n, min(effort) low, max(effort) high from joints \
         where recording in ('r00', 'r01') group by recording, joint order by recording, joint",
        "select a.recording, count(*) n from joints a join recordings b on a.recording = b.recording \
         where b.messages > 7000 group by a.recording order by a.recording",
    ] {
        let answer = ask(port, &[sql, &pattern]);
        assert!(
            answer.status.success(),
            "{sql}: {}",
            String::from_utf8_lossy(&answer.stderr)
        );
        let paths = [folder.path().join("*.mcap")];
        assert_eq!(
            String::from_utf8(answer.stdout).unwrap().trim(),
            alone(sql, &paths).trim(),
            "{sql}"
        );
    }
    let wrong = ask(port, &["select jont from joints", &pattern]);
    let text = String::from_utf8(wrong.stderr).unwrap();
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text.contains("did you mean `joint`?"), "{text}");
}

#[test]
fn a_query_that_nobody_answers_is_given_up() {
    let port = ports(1);
    let _scheduler = scheduler(port);
    let answer = ask(
        port,
        &[
            "--deadline-s",
            "2",
            "select count(*) from joints",
            "tests/data/demo.mcap",
        ],
    );
    let text = String::from_utf8(answer.stderr).unwrap();
    assert_eq!(answer.status.code(), Some(1));
    assert!(text.contains("no answer within 2 s"), "{text}");
}

#[test]
fn nothing_is_sent_to_another_build() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let other = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut request = [0; 4096];
        let read = stream.read(&mut request).unwrap();
        let body = "tauscope 0.0.9, ballista 54.1.0, program 00";
        write!(
            stream,
            "HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        )
        .unwrap();
        drop(stream);
        listener.set_nonblocking(true).unwrap();
        std::thread::sleep(Duration::from_millis(500));
        (
            String::from_utf8_lossy(&request[..read]).into_owned(),
            listener.accept().is_ok(),
        )
    });
    let answer = ask(port, &["select 1", "tests/data/demo.mcap"]);
    let text = String::from_utf8(answer.stderr).unwrap();
    assert_eq!(answer.status.code(), Some(1));
    assert!(
        text.contains("is another build") && text.contains("tauscope 0.0.9"),
        "{text}"
    );
    let (request, came_again) = other.join().unwrap();
    assert!(request.starts_with("GET /tauscope/build "), "{request}");
    assert!(!came_again);
}

#[test]
fn without_a_scheduler_the_address_is_told() {
    let port = ports(1);
    let answer = ask(port, &["select 1"]);
    let text = String::from_utf8(answer.stderr).unwrap();
    assert_eq!(answer.status.code(), Some(1));
    assert!(
        text.contains(&format!("there is no scheduler at 127.0.0.1:{port}")),
        "{text}"
    );
}
