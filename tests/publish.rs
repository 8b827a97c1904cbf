//! A whole pipeline's outputs to its cell and commands from it, with a ROS 2 side and a PLC made of PyPI packages.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::io::{BufRead as _, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::live;
use crate::common::live::Live;
use crate::common::python;
use crate::common::{Out, bundled, root, skipped, tauscope, write};
use serde_json::Value;
use tauscope_archive::{Recording, ros};

/// The bundled recording at double speed through all stages; the port `commands` accepts commands.
fn pipeline(folder: &Path, commands: u16, publish: &str, tool: &str) {
    let data = bundled();
    let data = data.display();
    write(
        &folder.join("pipeline.yaml"),
        &format!(
            "version: 1\ncells: {{demo: {{robot: {data}/demo_arm.urdf{tool}}}}}\nstages:\n\
             - {{name: ingest, ingest: {{file: {{path: {data}/demo.mcap}}, rate: 2, \
             commands: {{listen: [tcp/127.0.0.1:{commands}]}}}}}}\n\
             - {{name: twin, input: ingest, twin: {{model: {data}/demo.twin.yaml}}}}\n\
             - {{name: detect, input: twin, detect: {{twin_regression: {{}}}}}}\n\
             - {{name: learns, input: twin, detect: {{virtual_collision_sensor: {{bias: [20, 20, 20, 20, 20, 20, 20]}}}}}}\n\
             - {{name: record, inputs: [ingest, twin, detect], record: {{mcap: x.mcap}}}}\n\
             {publish}"
        ),
    );
}

/// A port without a listener.
fn port() -> u16 {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    free.local_addr().unwrap().port()
}

fn send(folder: &Path, arguments: &[&str]) -> Out {
    let file = folder.join("pipeline.yaml");
    let file = ["--json", "--pipeline", file.to_str().unwrap()];
    Out::answer(["send"].iter().chain(arguments).chain(&file))
}

/// Sends a command, repeating it until the pipeline has started, which takes time on a slow machine.
fn send_at_last(folder: &Path, arguments: &[&str]) -> Out {
    let deadline = Instant::now() + Duration::from_mins(1);
    loop {
        let out = send(folder, arguments);
        if out.code != 1 || Instant::now() > deadline {
            return out;
        }
    }
}

/// Stamp of the first sample to which a command applies.
fn stamp(out: &Out) -> i64 {
    assert_eq!(out.code, 0, "{}", out.stderr);
    let answer: Value = serde_json::from_str(&out.stdout).unwrap();
    answer["stamp_ns"].as_i64().unwrap()
}

/// Stamp, verb and arguments of each command in an archive.
fn commands(archive: &Path) -> Vec<(i64, String, Vec<String>)> {
    let recording = Recording::open(archive).unwrap();
    let mut messages = recording.messages(&["/commands"]).unwrap();
    let mut commands = Vec::new();
    while let Some(message) = messages.next_message() {
        let array: ros::DiagnosticArray = message.unwrap().decode().unwrap();
        let status = &array.status[0];
        let values = status.values.iter().map(|pair| pair.value.clone());
        let stamp = array.header.stamp.ns();
        commands.push((stamp, status.name.clone(), values.collect()));
    }
    commands
}

/// Body of each message of a topic, with its stamp.
fn messages(archive: &Path, topic: &str) -> Vec<(i64, ros::JointState)> {
    let recording = Recording::open(archive).unwrap();
    let mut messages = recording.messages(&[topic]).unwrap();
    let mut all = Vec::new();
    while let Some(message) = messages.next_message() {
        let message: ros::JointState = message.unwrap().decode().unwrap();
        all.push((message.header.stamp.ns(), message));
    }
    all
}

#[test]
fn a_command_holds_from_the_stamp_that_was_answered_live_and_in_a_replay() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    pipeline(folder, port(), "", ", tool: {link: tool}");
    let mut run = Live::start(folder, &[]);
    let expected = [
        (
            stamp(&send_at_last(folder, &["label", "new", "gripper"])),
            "label",
            vec!["new gripper"],
        ),
        (stamp(&send(folder, &["mute", "0.3"])), "mute", vec!["0.3"]),
        (
            stamp(&send(
                folder,
                &["payload", "1.25", "--com", "0", "0", "0.1"],
            )),
            "payload",
            vec!["1.25", "0 0 0.1"],
        ),
        (stamp(&send(folder, &["learn"])), "learn", vec![]),
        (
            stamp(&send(folder, &["acknowledge"])),
            "acknowledge",
            vec![],
        ),
    ];
    // The terminal shows them, too.
    for words in [
        "label: new gripper",
        "alarms muted for 0.3 s",
        "payload 1.25 kg, centre of mass 0 0 0.1 m",
        "detectors learn anew",
        "alarm acknowledged",
    ] {
        run.wait_for_part(words);
    }
    let (code, summary) = run.end();
    assert_eq!(code, 0, "{summary:#}");

    let live = folder.join("x.mcap");
    let expected = expected.map(|(stamp, verb, values)| {
        let values: Vec<String> = values.into_iter().map(str::to_owned).collect();
        (stamp, verb.to_owned(), values)
    });
    assert_eq!(commands(&live), expected);

    // A replay of the archive gets the same commands at the same samples, and gives the same results.
    let replay = |into: &str| {
        let mut replay = tauscope();
        replay
            .current_dir(folder)
            .args(["replay", "x.mcap", "--out", into]);
        let out = Out::of(replay);
        assert_eq!(out.code, 0, "{}", out.stderr);
        folder.join(into).join("x.mcap")
    };
    let (first, second) = (replay("first"), replay("second"));
    assert_eq!(commands(&first), expected);
    assert_eq!(
        std::fs::read(&first).unwrap(),
        std::fs::read(&second).unwrap()
    );
    let twin = messages(&live, "/twin/joint_states");
    assert_eq!(messages(&first, "/twin/joint_states"), twin);
    assert_eq!(messages(&first, "/residual"), messages(&live, "/residual"));
    assert_eq!(onsets(&first), onsets(&live));

    // The twin carries the payload from the sample with the answered stamp on, and not before.
    let plain = replay_without_commands(folder);
    let payload_ns = expected[2].0;
    let differs = |at: &usize| plain[*at].1.effort != twin[*at].1.effort;
    let first_other = (0..twin.len()).find(differs).unwrap();
    assert_eq!(twin[first_other].0, payload_ns);
}

/// The twin's effort for the bundled recording without commands.
fn replay_without_commands(folder: &Path) -> Vec<(i64, ros::JointState)> {
    let mut replay = tauscope();
    let recording = bundled().join("demo.mcap");
    replay
        .current_dir(folder)
        .arg("replay")
        .arg(recording)
        .args(["--out", "plain"]);
    let out = Out::of(replay);
    assert_eq!(out.code, 0, "{}", out.stderr);
    messages(&folder.join("plain/demo.mcap"), "/twin/joint_states")
}

#[test]
fn what_cannot_be_told_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let at = port();
    pipeline(folder, at, "", "");
    for (arguments, code, reason) in [
        (&["mute", "61"][..], 2, "a mute lasts 0 to 60 s, not 61 s"),
        (&["stop"], 2, "unrecognized subcommand"),
        (&["mute", "ten"], 2, "invalid value"),
        (
            &["label", &"x".repeat(49)],
            2,
            "1 to 48 bytes of text, no line breaks, not these 49",
        ),
        (
            &["learn", "--cell", "dem"],
            2,
            "the pipeline has no cell `dem`",
        ),
        (
            &["learn"],
            1,
            "no source accepts commands for the cell `demo`",
        ),
    ] {
        let out = send(folder, arguments);
        assert_eq!(out.code, code, "{arguments:?}: {}", out.stderr);
        assert!(out.stderr.contains(reason), "{arguments:?}: {}", out.stderr);
    }
    let _run = Live::start(folder, &[]);
    assert_eq!(send_at_last(folder, &["label", "it runs"]).code, 0);
    // With the endpoint instead of the file; the source itself refuses the command.
    let endpoint = format!("tcp/127.0.0.1:{at}");
    let arguments = [
        "send",
        "payload",
        "2",
        "--cell",
        "demo",
        "--connect",
        &endpoint,
    ];
    let out = Out::answer(arguments);
    assert_eq!(out.code, 2, "{}", out.stderr);
    assert!(
        out.stderr.contains("which link carries a tool"),
        "{}",
        out.stderr
    );
}

#[test]
fn a_publisher_that_cannot_work_is_refused_before_anything_starts() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (publish, why) in [
        (
            "inputs: [ingest, detect], publish: {}",
            "the publisher has no output",
        ),
        (
            "inputs: [ingest, twin], publish: {modbus: {}}",
            "listens to at least one detector",
        ),
        (
            "inputs: [detect], publish: {modbus: {}}",
            "does not listen to it",
        ),
        (
            "inputs: [ingest, detect], publish: {zenoh: {ros2: {}}}",
            "at least one endpoint",
        ),
        (
            "inputs: [ingest, detect], publish: {modbus: {listen: here}}",
            "publish",
        ),
    ] {
        pipeline(
            folder,
            7448,
            &format!("- {{name: publish, {publish}}}\n"),
            "",
        );
        let out = Out::answer(["check", folder.join("pipeline.yaml").to_str().unwrap()]);
        assert_eq!(out.code, 2, "{publish}");
        assert!(out.stderr.contains(why), "{publish}: {}", out.stderr);
    }
}

#[test]
fn a_detector_in_python_finds_contacts_too() {
    let test = "a_detector_in_python_finds_contacts_too";
    let python = match python::python("python-ros-side", &ROS_SIDE, "zenoh, rosbags.typesys") {
        Ok(python) => python,
        Err(why) => return skipped(test, &why),
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let endpoint = format!("tcp/127.0.0.1:{}", port());
    let script = root().join("examples/python-detector/detector.py");
    let arguments = ["--listen", &endpoint, "--band", "5"];
    let mut detector = Helper::start(&python, script.to_str().unwrap(), &arguments);
    let lines = BufReader::new(detector.0.stdout.take().unwrap()).lines();
    let publish = format!(
        "- {{name: publish, inputs: [ingest, twin, detect], publish: {{zenoh: {{connect: ['{endpoint}']}}}}}}\n"
    );
    pipeline(folder, port(), &publish, "");
    let run = Live::start(folder, &[]);
    let onsets = lines
        .map_while(Result::ok)
        .filter(|line| line.contains("onset"));
    // It prints one line for each onset; three are sufficient to show that it processes the residuals.
    let stamps: Vec<i64> = onsets
        .take(3)
        .map(|line| line.split(' ').next().unwrap().parse().unwrap())
        .collect();
    assert!(stamps.is_sorted() && stamps.len() == 3, "{stamps:?}");
    live::signal(run.id(), "INT");
    run.end();
}

const ROS_SIDE: [&str; 2] = ["eclipse-zenoh==1.10.2", "rosbags==0.11.9"];
const PLC: [&str; 1] = ["pymodbus==3.16.1"];

/// A helper process that is ended in any case.
struct Helper(Child);

impl Drop for Helper {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Helper {
    fn start(python: &Path, script: &str, arguments: &[&str]) -> Self {
        let mut command = Command::new(python);
        command
            .arg(root().join("tests/python").join(script))
            .args(arguments);
        Self(command.stdout(Stdio::piped()).spawn().unwrap())
    }

    /// Waits for its end; returns the last line of its output as JSON.
    fn result(&mut self, mut rest: impl std::io::Read) -> Value {
        let mut text = String::new();
        rest.read_to_string(&mut text).unwrap();
        assert!(self.0.wait().unwrap().success(), "{text}");
        serde_json::from_str(text.lines().last().unwrap()).unwrap()
    }
}

#[test]
fn a_ros_2_side_gets_every_contact() {
    let test = "a_ros_2_side_gets_every_contact";
    let python = match python::python("python-ros-side", &ROS_SIDE, "zenoh, rosbags.typesys") {
        Ok(python) => python,
        Err(why) => return skipped(test, &why),
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let endpoint = format!("tcp/127.0.0.1:{}", port());
    let mut side = Helper::start(&python, "ros_side.py", &[&endpoint, "3", "demo"]);
    let mut heard = BufReader::new(side.0.stdout.take().unwrap());
    let mut line = String::new();
    heard.read_line(&mut line).unwrap();
    assert_eq!(line, "ready\n");

    let publish = format!(
        "- {{name: publish, inputs: [ingest, twin, detect], publish: {{zenoh: {{connect: ['{endpoint}'], \
         ros2: {{domain: 3}}}}, stop_after_s: 2}}}}\n"
    );
    pipeline(folder, port(), &publish, "");
    let (code, summary) = Live::start(folder, &[]).end();
    assert_eq!(code, 0, "{summary:#}");
    let heard = side.result(heard);

    // Six pushes, as in the archive of the same run.
    let onsets = onsets(&folder.join("x.mcap"));
    assert!(onsets.len() >= 6, "{onsets:?}");
    assert_eq!(heard["onsets"], serde_json::json!(onsets));
    let contact = heard["contact"].as_array().unwrap();
    let begins = contact.iter().filter(|contact| **contact == true).count();
    assert_eq!(begins, onsets.len(), "{contact:?}");
    assert_eq!(heard["undecodable"], serde_json::json!([]));
    assert_eq!(heard["holes"], 0);
    for (topic, ros_type) in [
        ("free", "std_msgs/msg/Bool"),
        ("residual", "sensor_msgs/msg/JointState"),
        ("twin/joint_states", "sensor_msgs/msg/JointState"),
        ("contact_wrench", "geometry_msgs/msg/WrenchStamped"),
        ("external_force", "std_msgs/msg/Float64"),
        ("diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
        ("alarm (JSON)", "json"),
    ] {
        assert_eq!(heard["topics"][topic], ros_type, "{topic}");
    }
}

/// Stamps at which the detector raised its alarm \[ns\].
fn onsets(archive: &Path) -> Vec<i64> {
    let recording = Recording::open(archive).unwrap();
    let mut messages = recording.messages(&["/detections"]).unwrap();
    let mut onsets = Vec::new();
    while let Some(message) = messages.next_message() {
        let array: ros::DiagnosticArray = message.unwrap().decode().unwrap();
        let mut values = array.status[0].values.iter();
        if values.any(|pair| pair.key == "event" && pair.value == "onset") {
            onsets.push(array.header.stamp.ns());
        }
    }
    onsets
}

#[test]
fn a_plc_sees_a_latched_contact_acknowledges_it_and_sees_stop_when_the_process_dies() {
    let test = "a_plc_sees_a_latched_contact_acknowledges_it_and_sees_stop_when_the_process_dies";
    let python = match python::python("python-plc", &PLC, "pymodbus.client") {
        Ok(python) => python,
        Err(why) => return skipped(test, &why),
    };
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let at = port();
    let publish = format!(
        "- {{name: publish, inputs: [ingest, detect], publish: {{modbus: {{listen: '127.0.0.1:{at}'}}, \
         latch: contact, stop_after_s: 2}}}}\n"
    );
    pipeline(folder, port(), &publish, "");
    let mut run = Live::start(folder, &[]);
    let process = run.wait_for_stage("publish").to_string();
    let mut plc = Helper::start(&python, "plc.py", &[&at.to_string(), &process]);
    let said = plc.0.stdout.take().unwrap();
    let saw = plc.result(said);
    for what in [
        "heartbeat_counts",
        "latched",
        "acknowledged",
        "free_after",
        "no_connection",
        "stop_after_restart",
    ] {
        assert_eq!(saw[what], true, "{what}: {saw}");
    }
    live::signal(run.id(), "INT");
    let begin = Instant::now();
    let (code, _) = run.end();
    assert!(
        code == 0 || code == 3,
        "what the killed publisher had is lost: {code}"
    );
    assert!(begin.elapsed() < Duration::from_mins(1));
}
