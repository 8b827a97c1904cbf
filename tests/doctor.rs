//! `tauscope doctor` says what would keep a pipeline from running.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::net::TcpListener;
use std::path::Path;

use crate::common::{Out, bundled, write};
use serde_json::Value;

#[test]
fn a_taken_port_and_a_peer_that_is_away_are_errors_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let away = TcpListener::bind("127.0.0.1:0").unwrap();
    let away_at = away.local_addr().unwrap();
    drop(away);
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{zenoh: {{connect: [\"tls/{away_at}#root_ca_certificate_file=ca.pem\"]}}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 9}}}}}}
- {{name: record, inputs: [ingest, detect], record: {{mcap: out/a.mcap, min_free_mb: 1}}}}
- {{name: publish, inputs: [ingest, detect], publish: {{modbus: {{listen: \"{taken}\"}}}}}}
",
        robot = bundled().join("demo_arm.urdf").display(),
        taken = taken.local_addr().unwrap(),
    );
    let file = write(&folder.path().join("pipeline.yaml"), &text);
    let doctor = |more: &[&str]| {
        let file = file.to_str().unwrap();
        Out::answer(["doctor", "--pipeline", file].iter().chain(more))
    };
    let out = doctor(&["--json"]);
    assert_eq!(out.code, 1, "{}{}", out.stdout, out.stderr);
    let checks: Value = serde_json::from_str(&out.stdout).unwrap();
    let of = |check: &str| -> Value {
        let all = checks["checks"].as_array().unwrap();
        let found = all.iter().find(|it| it["check"] == check);
        found
            .unwrap_or_else(|| panic!("no {check} in {all:?}"))
            .clone()
    };
    for check in ["port", "peer", "certificate"] {
        assert_eq!(of(check)["level"], "error", "{checks}");
        assert!(of(check)["remedy"].is_string(), "{checks}");
    }
    assert_eq!(of("disk")["level"], "ok", "{checks}");
    for check in [
        "versions",
        "shared memory",
        "leftovers",
        "clock source",
        "clock",
    ] {
        assert!(of(check)["found"].is_string(), "{checks}");
    }
    let words = doctor(&[]).stdout;
    assert!(
        words.contains("error    port: publish cannot listen on tcp/127.0.0.1:"),
        "{words}"
    );
    assert!(words.contains("= help: "), "{words}");
}

#[test]
fn a_pipeline_that_is_wrong_is_told_as_check_tells_it() {
    let out = Out::answer([
        Path::new("doctor"),
        Path::new("--pipeline"),
        Path::new("none.yaml"),
    ]);
    assert_eq!(out.code, 2, "{}", out.stdout);
    assert!(
        out.stderr.contains("there is no such file"),
        "{}",
        out.stderr
    );
}
