//! Public bug reports and their kin as inputs: each command gives a good answer (`tests/trials/README.md`).
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::process::Command;

use crate::common::{root, skipped};

#[test]
fn every_quick_command_answers_what_strangers_bring() {
    let done = Command::new("bash")
        .arg(root().join("tests/trials/run.sh"))
        .args(["--short", "--program", env!("CARGO_BIN_EXE_tauscope")])
        .output()
        .unwrap();
    let table = String::from_utf8_lossy(&done.stdout);
    if let Some(reason) = table.trim().strip_prefix("SKIPPED: ") {
        skipped("trials", reason);
        return;
    }
    let is_bad = |line: &&str| line.contains("| BAD |");
    let bad: Vec<&str> = table.lines().filter(is_bad).collect();
    let stderr = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.success() && bad.is_empty(),
        "{bad:#?}\n{stderr}"
    );
    assert!(table.contains(" answers, 0 bad"), "{table}");
}
