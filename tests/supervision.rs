//! Supervision of a run: a hanging stage is named, the file sets the restart policy, and a service manager is
//! notified.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::live::{Live, is_alive, signal, stage};
use crate::common::{bundled, tauscope, write};

/// Generous timeout for slow machines; normally never reached.
const PATIENCE: Duration = Duration::from_mins(1);

/// A source in real time, a twin and a detector, each in a process of its own; `twin` has further keys.
fn pipeline(folder: &Path, twin: &str) {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, process: ingest, ingest: {{file: {{path: {recording}}}, rate: 1}}}}
- {{name: twin, process: twin, input: ingest, twin: {{}}{twin}}}
- {{name: detect, process: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
    );
    write(&folder.join("pipeline.yaml"), &text);
}

#[test]
fn a_stage_that_hangs_is_named_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "");
    let mut live = Live::start(folder.path(), &["--verbose"]);
    let twin = live.wait_for_stage("twin");
    live.wait_for("stage `ingest` begins");
    std::thread::sleep(Duration::from_secs(1));
    signal(twin, "STOP");
    let line = live.wait_for("warning: stage `twin` hangs: nothing was heard of it for 3 s");
    assert!(
        line.contains(&format!("process {twin} is killed")),
        "{line}"
    );
    signal(twin, "CONT");
    live.wait_for("note: stage `twin` responds again");
    assert!(is_alive(twin), "it is the same process");
    signal(live.id(), "INT");
    let (_, summary) = live.end();
    for name in ["ingest", "twin", "detect"] {
        assert_eq!(stage(&summary, name)["restarts"], 0, "{summary}");
        assert_eq!(stage(&summary, name)["failed"], false, "{summary}");
    }
}

#[test]
fn a_stage_that_may_not_come_back_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), ", restart: never");
    let mut live = Live::start(folder.path(), &["--verbose"]);
    let twin = live.wait_for_stage("twin");
    live.wait_for("stage `ingest` begins");
    signal(twin, "KILL");
    let line = live.wait_for("error: stage `twin` was killed by signal 9");
    assert!(line.contains("is not started again"), "{line}");
    let (code, summary) = live.end();
    assert_eq!(code, 1, "{summary}");
    assert_eq!(stage(&summary, "twin")["restarts"], 0, "{summary}");
}

#[test]
fn the_file_says_how_often_a_stage_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let restart = ", restart: {when: on_failure, most: 1, within_s: 600}";
    pipeline(folder.path(), restart);
    let mut live = Live::start(folder.path(), &[]);
    signal(live.wait_for_stage("twin"), "KILL");
    live.wait_for("warning: stage `twin` was killed by signal 9: starting it again");
    signal(live.wait_for_stage("twin"), "KILL");
    live.wait_for("error: stage `twin` was killed by signal 9 and is not started again");
    assert_eq!(live.end().0, 1);
}

/// A simulated service manager.
struct Manager(UnixDatagram);

impl Manager {
    fn new(folder: &Path) -> Self {
        let socket = UnixDatagram::bind(folder.join("notify")).unwrap();
        socket
            .set_read_timeout(Some(Duration::from_millis(100)))
            .unwrap();
        Self(socket)
    }

    /// Next notification within `wait`.
    fn hears(&self, wait: Duration) -> Option<String> {
        let mut bytes = [0; 4096];
        let until = Instant::now() + wait;
        while Instant::now() < until {
            if let Ok(length) = self.0.recv(&mut bytes) {
                return Some(String::from_utf8_lossy(&bytes[..length]).trim().to_owned());
            }
        }
        None
    }

    fn waits_for(&self, wanted: &str) {
        let until = Instant::now() + PATIENCE;
        let mut heard = Vec::new();
        while Instant::now() < until {
            let said = self.hears(PATIENCE).unwrap_or_default();
            if said.contains(wanted) {
                return;
            }
            heard.push(said);
        }
        panic!("never {wanted:?}: {heard:?}");
    }
}

#[test]
fn a_service_manager_is_told_of_readiness_state_and_life() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "");
    let manager = Manager::new(folder.path());
    let mut command = tauscope();
    command
        .env("NOTIFY_SOCKET", folder.path().join("notify"))
        .env("WATCHDOG_USEC", "2000000")
        .env_remove("WATCHDOG_PID");
    let mut live = Live::start_as(command, folder.path(), &[]);
    let twin = live.wait_for_stage("twin");
    manager.waits_for("READY=1");
    manager.waits_for("STATUS=3 stages run");
    manager.waits_for("WATCHDOG=1");

    // A hanging stage does not end the run; it is reported, and the run stays alive.
    signal(twin, "STOP");
    manager.waits_for("STATUS=hang: twin");
    manager.waits_for("WATCHDOG=1");
    signal(twin, "CONT");
    manager.waits_for("STATUS=3 stages run");

    signal(live.id(), "STOP");
    while manager.hears(Duration::from_millis(500)).is_some() {}
    let meanwhile = manager.hears(Duration::from_secs(3));
    assert_eq!(meanwhile, None, "a run that hangs is silent");
    signal(live.id(), "CONT");
    manager.waits_for("WATCHDOG=1");

    signal(live.id(), "INT");
    manager.waits_for("STOPPING=1");
    live.end();
}
