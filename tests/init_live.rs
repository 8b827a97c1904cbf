//! `tauscope init --live`: from a moving robot to a pipeline for it.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::common::robot::{endpoint, rmw_key, router};
use crate::common::{Out, bundled, tauscope};
use tauscope_archive::{Recording, ros};
use zenoh::Wait as _;

/// Speed of publication relative to that of the recordings.
const PACE: f64 = 2.0;

/// Publishes the bundled contact-free recordings in turn until `stop` is set.
fn publish(session: &zenoh::Session, stop: &AtomicBool) {
    let key = rmw_key(0, "joint_states");
    let began = Instant::now();
    let mut first_ns = None;
    for name in [
        "demo_train_points.mcap",
        "demo_train_sweep.mcap",
        "demo_validation.mcap",
    ] {
        let recording = Recording::open(bundled().join(name)).unwrap();
        let mut states = recording.joint_states("/joint_states").unwrap();
        while let Some(state) = states.next_state() {
            let state = state.unwrap();
            let first_ns = *first_ns.get_or_insert(state.log_time_ns);
            let after = Duration::from_nanos((state.log_time_ns - first_ns) as u64).div_f64(PACE);
            std::thread::sleep(after.saturating_sub(began.elapsed()));
            if stop.load(Ordering::Relaxed) {
                return;
            }
            let mut body = Vec::new();
            ros::encode(state.message, &mut body).unwrap();
            session.put(&key, body).wait().unwrap();
        }
    }
}

fn init(folder: &Path, source: &str) -> Out {
    let mut command = tauscope();
    command
        .current_dir(folder)
        .args(["init", "--live", "26", "--robot"]);
    command.arg(bundled().join("demo_arm.urdf"));
    Out::of({
        command.args(["--source", source, "--out", "cell"]);
        command
    })
}

#[test]
fn a_moving_robot_becomes_a_pipeline_that_listens_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let endpoint = endpoint();
    let session = router(&endpoint);
    let source = format!("zenoh: {{connect: [\"{endpoint}\"]}}");
    let stop = AtomicBool::new(false);
    let out = std::thread::scope(|scope| {
        scope.spawn(|| publish(&session, &stop));
        let out = init(folder, &source);
        stop.store(true, Ordering::Relaxed);
        out
    });
    assert_eq!(out.code, 0, "{out:?}");
    let cell = folder.join("cell");
    let made = std::fs::read_dir(cell.join("recordings")).unwrap().count();
    // One may be missing at the pause of the stream between two bundled recordings.
    assert!((4..=5).contains(&made), "{made} recordings: {out:?}");
    assert!(
        !out.stdout.contains("Nothing was evaluated"),
        "{}",
        out.stdout
    );
    let run = "Listen to the robot: `tauscope run ";
    assert!(out.stdout.contains(run), "{}", out.stdout);
    assert!(!out.stdout.contains("change `ingest`"), "{}", out.stdout);
    let set = std::fs::read_to_string(cell.join("set.yaml")).unwrap();
    assert!(set.contains("- \"recordings/"), "{set}");
    let pipeline = cell.join("pipeline.yaml");
    let text = std::fs::read_to_string(&pipeline).unwrap();
    assert!(text.contains(&format!("ingest: {{{source}}}")), "{text}");

    // Files of an earlier start are not used as recordings of the robot.
    let again = init(folder, &source);
    assert_eq!(again.code, 2, "{again:?}");

    let mut replay = tauscope();
    replay.current_dir(folder).args(["replay", "--pipeline"]);
    replay.arg(&pipeline).arg(bundled().join("demo.mcap"));
    let replayed = Out::of({
        replay.args(["--out", "found", "--json"]);
        replay
    });
    assert_eq!(replayed.code, 0, "{replayed:?}");
    let summary: serde_json::Value = serde_json::from_str(&replayed.stdout).unwrap();
    let events = summary.to_string().matches("\"t_contact\"").count();
    assert_eq!(events, 6, "{summary:#}");
}

#[test]
fn a_source_that_is_none_or_a_robot_that_is_silent_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = init(folder.path(), "zenho: {}");
    assert_eq!(wrong.code, 2, "{wrong:?}");
    assert!(wrong.stderr.contains("zenho"), "{wrong:?}");

    let silent = tempfile::tempdir().unwrap();
    let endpoint = endpoint();
    let _router = router(&endpoint);
    let source = format!("zenoh: {{connect: [\"{endpoint}\"]}}");
    let silent = init(silent.path(), &source);
    assert_eq!(silent.code, 1, "{silent:?}");
    assert!(silent.stderr.contains("no usable sample"), "{silent:?}");
}
