//! Two hosts of one pipeline file: on one machine over loopback, and in two network namespaces.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::net::TcpListener;
use std::process::Command;

use crate::common::live::{Live, stage};
use crate::common::{Out, bundled, root, skipped, write};

#[test]
fn two_hosts_share_a_pipeline_and_nothing_is_lost_between_them() {
    let folder = tempfile::tempdir().unwrap();
    let free = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
hosts: {{robot: {{listen: tcp/{free}}}, desk: {{connect: tcp/{free}}}}}
stages:
- {{name: ingest, host: robot, ingest: {{file: {{path: {recording}}}, rate: 10}}}}
- {{name: twin, host: robot, input: ingest, twin: {{}}}}
- {{name: detect, host: desk, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
- {{name: record, host: desk, inputs: [ingest, twin, detect], record: {{mcap: out.mcap}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
    );
    write(&folder.path().join("pipeline.yaml"), &text);
    let robot = Live::start(folder.path(), &["--host", "robot"]);
    let desk = Live::start(folder.path(), &["--host", "desk"]);
    let (code, there) = robot.end();
    assert_eq!(code, 0, "{there}");
    let (code, here) = desk.end();
    assert_eq!(code, 0, "{here}");
    let sent = stage(&there, "ingest")["emitted"].as_u64().unwrap();
    assert!(sent > 1000, "{there}");
    assert_eq!(stage(&here, "detect")["received"], sent, "{here}");
    assert_eq!(stage(&here, "record")["received"], 3 * sent, "{here}");
}

#[test]
fn two_network_namespaces_lose_nothing_at_1_khz() {
    let mut command = Command::new("sh");
    command
        .arg(root().join("tests/two_hosts.sh"))
        .arg(env!("CARGO_BIN_EXE_tauscope"))
        .arg("5");
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}{}", out.stdout, out.stderr);
    if let Some(why) = out.stdout.strip_prefix("SKIPPED two_hosts: ") {
        skipped("two_network_namespaces_lose_nothing_at_1_khz", why.trim());
        return;
    }
    assert!(out.stdout.contains("nothing lost"), "{}", out.stdout);
}
