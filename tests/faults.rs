//! The short form of `tests/faults/faults.py`: faults done to running pipelines, and books that balance.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod common;

use std::process::Command;

use common::{Out, root, skipped};

fn fault(test: &str, only: &str) {
    script(test, "faults.py", &["--only", only], only);
}

/// The short form of a script, whose output has to begin so.
fn script(test: &str, name: &str, more: &[&str], begins: &str) {
    let python = Command::new("python3").arg("--version").output();
    if python.is_err() {
        skipped(test, "python3 is absent");
        return;
    }
    let mut command = Command::new("python3");
    command
        .arg(root().join("tests/faults").join(name))
        .arg(env!("CARGO_BIN_EXE_tauscope"))
        .arg("--short")
        .args(more);
    let out = Out::of(command);
    if let Some(why) = out.stdout.strip_prefix("SKIPPED ") {
        skipped(test, why.trim());
        return;
    }
    assert_eq!(out.code, 0, "{}{}", out.stdout, out.stderr);
    assert!(out.stdout.starts_with(begins), "{}", out.stdout);
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
fn a_thread_that_hangs_is_named_and_the_other_cell_of_its_process_goes_on() {
    let test = "a_thread_that_hangs_is_named_and_the_other_cell_of_its_process_goes_on";
    fault(test, "a thread that hangs");
}

#[test]
fn a_fleet_host_bears_ten_cells_and_misses_who_goes() {
    let test = "a_fleet_host_bears_ten_cells_and_misses_who_goes";
    script(test, "hundred_cells.py", &[], "10 cells at 100 Hz");
}

#[test]
fn a_full_disk_is_told() {
    fault("a_full_disk_is_told", "full disk");
}

#[test]
fn a_full_shared_memory_is_told_with_its_remedy() {
    let test = "a_full_shared_memory_is_told_with_its_remedy";
    fault(test, "full shared memory");
}

#[test]
fn a_network_that_was_cut_brings_all_of_it_later() {
    let test = "a_network_that_was_cut_brings_all_of_it_later";
    fault(test, "network cut");
}

#[test]
fn a_host_that_is_started_again_states_what_is_not_known() {
    let test = "a_host_that_is_started_again_states_what_is_not_known";
    fault(test, "a host that");
}

#[test]
fn a_fleet_host_knows_soon_of_a_cell_that_is_gone() {
    let test = "a_fleet_host_knows_soon_of_a_cell_that_is_gone";
    fault(test, "fleet: a cell");
}
