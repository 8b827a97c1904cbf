//! A live pipeline without data warns within seconds, with the topics that exist instead and the likeliest mistake.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::live::{Live, signal, stage};
use crate::common::robot::{JOINTS, Publisher, endpoint, rmw_key, rmw_token, router};
use crate::common::{bundled, write};
use zenoh::Wait as _;

/// Time after the start within which a warning must appear. The program promises 5 s; the tests run in parallel on a
/// machine that may be busy.
const PROMISED: Duration = Duration::from_secs(10);

/// The bundled robot, live: `zenoh` are the source's further settings.
fn pipeline(folder: &Path, endpoint: &str, zenoh: &str) {
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{zenoh: {{connect: [\"{endpoint}\"]{zenoh}}}}}}}
- {{name: record, inputs: [ingest], record: {{mcap: \"out-{{n}}.mcap\"}}}}
",
        robot = bundled().join("demo_arm.urdf").display(),
    );
    write(&folder.join("pipeline.yaml"), &text);
}

/// All output until the end of the run, with exit code and summary.
fn said_until_the_end(mut live: Live) -> (String, i32, serde_json::Value) {
    live.wait_for("error: stage `ingest` gave no usable sample within 1 s");
    let mut said = live.rest();
    let (code, summary) = live.end();
    said = format!("{}\n{}", summary["stages"][0]["trouble"], said);
    (said, code, summary)
}

#[test]
fn each_slip_is_named_with_what_is_there_instead() {
    let (with_prefix, misspelt): (Vec<String>, Vec<String>) = JOINTS
        .iter()
        .map(|joint| (format!("left_{joint}"), joint.replace("joint", "joint_")))
        .unzip();
    let strs = |names: &'static [&'static str]| names.to_vec();
    let rmw = |topic: &str, domain| rmw_key(domain, topic);
    let panda = strs(&["shoulder_pan", "shoulder_lift", "elbow"]);
    let six = JOINTS[..6].to_vec();
    let with_prefix: Vec<&str> = with_prefix.iter().map(String::as_str).collect();
    let misspelt: Vec<&str> = misspelt.iter().map(String::as_str).collect();
    let cases = [
        (
            "",
            rmw("joint_state", 0),
            JOINTS.to_vec(),
            "the topic is /joint_state, you wrote /joint_states",
        ),
        (
            "",
            rmw("joint_states", 7),
            JOINTS.to_vec(),
            "set `domain: 7`",
        ),
        (
            "",
            "bot1/joint_states".to_owned(),
            JOINTS.to_vec(),
            "`keys: ros2dds`, `namespace: bot1`",
        ),
        (
            ", keys: tauscope",
            "demo/joint_states".to_owned(),
            panda,
            "these joints are those of another robot",
        ),
        (
            ", keys: tauscope",
            "demo/joint_states".to_owned(),
            misspelt,
            "`joint_1` of the messages is probably `joint1`",
        ),
        (
            ", keys: tauscope",
            "demo/joint_states".to_owned(),
            with_prefix,
            "begin with `left_`",
        ),
        (
            ", keys: tauscope",
            "demo/joint_states".to_owned(),
            six,
            "no message names joint7",
        ),
    ];
    let running = cases.map(|(zenoh, key, joints, answer)| {
        let folder = tempfile::tempdir().unwrap();
        let endpoint = endpoint();
        let session = router(&endpoint);
        let publisher = Publisher::start(&session, &key, &joints);
        pipeline(folder.path(), &endpoint, zenoh);
        let live = Live::start(folder.path(), &["--expect-data", "1"]);
        (folder, session, publisher, live, answer, key, joints)
    });
    for (_folder, _session, _publisher, live, answer, key, joints) in running {
        let (said, code, summary) = said_until_the_end(live);
        assert_eq!(code, 1, "{summary}");
        assert_eq!(summary["ended"], "no_data", "{summary}");
        assert!(said.contains(answer), "{answer}: {said}");
        let stem = key.split("/RIHS").next().unwrap();
        assert!(said.contains(stem) && said.contains(joints[0]), "{said}");
        assert!(said.contains("joint7"), "what was expected: {said}");
        assert_eq!(stage(&summary, "ingest")["emitted"], 0);
    }
}

#[test]
fn a_router_that_cannot_be_reached_is_told_from_one_with_nobody_behind_it() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = endpoint();
    pipeline(folder.path(), &endpoint, "");
    let began = Instant::now();
    let mut live = Live::start(folder.path(), &[]);
    let told = live.wait_for("warning: stage `ingest`: no usable sample for ");
    assert!(began.elapsed() < PROMISED, "{:?}", began.elapsed());
    assert!(
        told.contains(&format!("router {endpoint} cannot be reached")),
        "{told}"
    );
    live.wait_for(&format!("  seen: {endpoint}: connection refused"));

    let session = router(&endpoint);
    let told = live.wait_for("warning: stage `ingest`: no usable sample for ");
    assert!(told.contains("no publisher of 0/joint_states/"), "{told}");
    live.wait_for("  likely: 1 Zenoh peer is connected, but nothing is published");

    let token = session
        .liveliness()
        .declare_token(rmw_token(0, "joint_states"))
        .wait()
        .unwrap();
    let told = live.wait_for("warning: stage `ingest`: no usable sample for ");
    assert!(
        told.contains("is announced, but its publisher sends nothing"),
        "{told}"
    );
    drop(token);
    signal(live.id(), "INT");
    let (code, summary) = live.end();
    // No sample was detected or recorded.
    assert_eq!(code, 1, "{summary}");
    assert_eq!(summary["ended"], "interrupted");
}

#[test]
fn a_publisher_that_stops_and_comes_back_is_told_of() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = endpoint();
    let session = router(&endpoint);
    let key = rmw_key(0, "joint_states");
    let publisher = Publisher::start(&session, &key, &JOINTS);
    pipeline(folder.path(), &endpoint, "");
    let mut live = Live::start(folder.path(), &[]);
    // Progress line, as in a journal.
    let line = live.wait_for_part(" s: ingest ");
    assert!(line.contains(" Hz, last 0."), "{line}");
    drop(publisher);
    let stopped = Instant::now();
    let told = live.wait_for("warning: stage `ingest`: no usable sample for ");
    assert!(stopped.elapsed() < PROMISED, "{:?}", stopped.elapsed());
    assert!(told.contains("the publisher of 0/joint_states/"), "{told}");
    let _publisher = Publisher::start(&session, &key, &JOINTS);
    live.wait_for("note: stage `ingest`: samples come again after ");
    signal(live.id(), "INT");
    let (code, summary) = live.end();
    assert_eq!(code, 0, "{summary}");
    assert_eq!(
        stage(&summary, "ingest")["trouble"],
        serde_json::Value::Null
    );
    assert_eq!(
        stage(&summary, "record")["received"],
        stage(&summary, "ingest")["emitted"]
    );
}

#[test]
fn a_second_publisher_of_the_same_joints_is_told_of_and_not_heard() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = endpoint();
    let session = router(&endpoint);
    let key = rmw_key(0, "joint_states");
    let _robot = Publisher::start_as(&session, &key, &JOINTS, Some(1));
    pipeline(folder.path(), &endpoint, "");
    let mut live = Live::start(folder.path(), &[]);
    live.wait_for_part(" Hz, last 0.");
    let _bag = Publisher::start_as(&session, &key, &JOINTS, Some(2));
    live.wait_for("warning: stage `ingest`: two publishers send the same joints on /joint_states");
    live.wait_for("  likely: the driver was started twice");
    signal(live.id(), "INT");
    let (code, summary) = live.end();
    // Samples that were not received are counted.
    assert_eq!(code, 3, "{summary}");
    assert!(stage(&summary, "ingest")["dropped"].as_u64() > Some(0));
}

#[test]
fn data_that_stops_ends_a_run_that_expects_some_and_the_archive_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = endpoint();
    let session = router(&endpoint);
    let publisher = Publisher::start(&session, &rmw_key(0, "joint_states"), &JOINTS);
    pipeline(folder.path(), &endpoint, "");
    let mut live = Live::start(folder.path(), &["--expect-data", "4", "--verbose"]);
    live.wait_for_part(" Hz, last 0.");
    drop(publisher);
    live.wait_for("error: stage `ingest` gave no usable sample within 4 s after the last one");
    let (code, summary) = live.end();
    assert_eq!(code, 1, "{summary}");
    assert!(stage(&summary, "ingest")["emitted"].as_u64() > Some(0));
    assert!(folder.path().join("out-001.mcap").is_file());
    assert!(!folder.path().join("out-001.mcap.part").exists());
}

#[test]
fn a_quiet_run_says_only_what_must_not_be_missed() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), &endpoint(), "");
    let mut live = Live::start(folder.path(), &["--quiet", "--expect-data", "1"]);
    live.wait_for("warning: stage `ingest`: no usable sample for ");
    assert_eq!(live.heard.len(), 1, "{:?}", live.heard);
    assert_eq!(live.end().0, 1);
}
