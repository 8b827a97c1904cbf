//! The short form of `tests/faults/faults.py`: faults done to running pipelines, and books that balance.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use std::process::Command;

use common::{Out, root, skipped};

fn fault(test: &str, only: &str) {
    let python = Command::new("python3").arg("--version").output();
    if python.is_err() {
        skipped(test, "python3 is absent");
        return;
    }
    let mut command = Command::new("python3");
    command
        .arg(root().join("tests/faults/faults.py"))
        .arg(env!("CARGO_BIN_EXE_tauscope"))
        .args(["--short", "--only", only]);
    let out = Out::of(command);
    if let Some(why) = out.stdout.strip_prefix("SKIPPED ") {
        skipped(test, why.trim());
        return;
    }
    assert_eq!(out.code, 0, "{}{}", out.stdout, out.stderr);
    assert!(out.stdout.starts_with(only), "{}", out.stdout);
}

#[test]
fn a_killed_twin_costs_what_is_said() {
    fault("a_killed_twin_costs_what_is_said", "kill -9 of twin");
}

#[test]
fn a_killed_source_goes_on_and_costs_what_is_said() {
    let test = "a_killed_source_goes_on_and_costs_what_is_said";
    fault(test, "kill -9 of ingest");
}

#[test]
fn a_stopped_recorder_holds_up_no_detector() {
    let test = "a_stopped_recorder_holds_up_no_detector";
    fault(test, "SIGSTOP of record");
}

#[test]
fn a_full_disk_is_told() {
    fault("a_full_disk_is_told", "full disk");
}

#[test]
fn a_network_that_was_cut_brings_all_of_it_later() {
    let test = "a_network_that_was_cut_brings_all_of_it_later";
    fault(test, "network cut");
}

#[test]
fn a_fleet_host_knows_soon_of_a_cell_that_is_gone() {
    let test = "a_fleet_host_knows_soon_of_a_cell_that_is_gone";
    fault(test, "fleet: a cell");
}
