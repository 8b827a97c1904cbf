//! The short form of `tests/faults/faults.py`: faults done to running pipelines, and books that balance.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common;

use std::process::Command;

use common::{Out, root, skipped};

/// The short forms of some faults at once: they wait more than they compute.
fn faults(test: &str, all: &[&str]) {
    std::thread::scope(|scope| {
        for only in all {
            scope.spawn(move || script(test, "faults.py", &["--only", only], only));
        }
    });
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
fn what_is_killed_or_stopped_costs_what_is_said() {
    let all = ["kill -9 of twin", "kill -9 of ingest", "SIGSTOP of record"];
    faults("what_is_killed_or_stopped_costs_what_is_said", &all);
}

#[test]
fn a_thread_that_hangs_is_named_and_the_other_cell_of_its_process_goes_on() {
    let test = "a_thread_that_hangs_is_named_and_the_other_cell_of_its_process_goes_on";
    faults(test, &["a thread that hangs"]);
}

#[test]
fn a_fleet_host_bears_ten_cells_and_misses_who_goes() {
    let test = "a_fleet_host_bears_ten_cells_and_misses_who_goes";
    script(test, "hundred_cells.py", &[], "10 cells at 100 Hz");
}

#[test]
fn what_is_full_is_told_with_its_remedy() {
    let all = ["full disk", "full shared memory"];
    faults("what_is_full_is_told_with_its_remedy", &all);
}

#[test]
fn a_cell_that_was_cut_off_is_known_soon_and_told_of_later() {
    let all = ["network cut", "a host that", "fleet: a cell"];
    faults(
        "a_cell_that_was_cut_off_is_known_soon_and_told_of_later",
        &all,
    );
}
