//! Written models in the simulators themselves: the short form of `tests/simulators/prove.py`.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::process::Command;

use crate::common::{Out, python, root, skipped};

#[test]
fn a_written_model_moves_as_the_recorded_arm_and_needs_its_efforts_in_three_simulators() {
    let packages: Vec<&str> = include_str!("simulators/requirements.txt")
        .lines()
        .collect();
    let modules = "mujoco, pinocchio, pydrake, mcap";
    let python = match python::python("python-simulators", &packages, modules) {
        Ok(python) => python,
        Err(why) => return skipped("simulators", &why),
    };
    let folder = tempfile::tempdir().unwrap();
    let mut prove = Command::new(python);
    prove
        .arg(root().join("tests/simulators/prove.py"))
        .arg(env!("CARGO_BIN_EXE_tauscope"))
        .arg(folder.path())
        .args(["--cases", "folded", "--check"]);
    let out = Out::of(prove);
    assert_eq!(out.code, 0, "{}\n{}", out.stdout, out.stderr);
}
