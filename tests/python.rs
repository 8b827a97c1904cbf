//! The Python module: the wheel is built by maturin, installed, and tested from Python; the example notebook runs.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;
use std::process::Command;

use crate::common::python;
use crate::common::{Out, hide_own_package, root, skipped};

const PACKAGES: [&str; 8] = [
    "maturin>=1.9,<2",
    "pytest",
    "pyarrow",
    "pandas",
    "nbclient",
    "ipykernel",
    "mujoco==4.0.0",
    "matplotlib",
];

/// Builds the wheel into `folder` from what `cargo test --workspace` has built, and installs it.
fn install(python: &Path, folder: &Path) {
    let target = Path::new(env!("CARGO_BIN_EXE_tauscope")).ancestors().nth(2);
    let build = Out::of({
        let mut maturin = Command::new(python);
        maturin
            .args(["-m", "maturin", "build", "--quiet", "--profile", "dev"])
            .args(["--locked", "--auditwheel", "skip", "--interpreter"])
            .arg(python)
            .arg("--manifest-path")
            .arg(root().join("python/Cargo.toml"))
            .arg("--target-dir")
            .arg(target.unwrap())
            .arg("--out")
            .arg(folder);
        hide_own_package(&mut maturin);
        maturin
    });
    assert_eq!(build.code, 0, "{}{}", build.stdout, build.stderr);
    let wheels = std::fs::read_dir(folder).unwrap();
    let wheels: Vec<_> = wheels.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(wheels.len(), 1, "{wheels:?}");
    let install = Out::of({
        let mut pip = Command::new(python);
        pip.args(["-m", "pip", "install", "--quiet", "--no-deps", "--no-index"])
            .arg("--force-reinstall")
            .args(&wheels);
        pip
    });
    assert_eq!(install.code, 0, "{}", install.stderr);
}

#[test]
fn the_wheel_reads_recordings_and_runs_commands() {
    let modules = "maturin, pytest, pyarrow, pandas, nbclient, ipykernel, mujoco, matplotlib";
    let python = match python::python("python-wheel", &PACKAGES, modules) {
        Ok(python) => python,
        Err(why) => {
            skipped("the_wheel_reads_recordings_and_runs_commands", &why);
            return;
        }
    };
    let folder = tempfile::tempdir().unwrap();
    install(&python, folder.path());
    let tests = Out::of({
        let mut pytest = Command::new(&python);
        // Not from the source tree: what is tested is what is installed.
        pytest
            .current_dir(folder.path())
            .args([
                "-m",
                "pytest",
                "-q",
                "-p",
                "no:cacheprovider",
                "--durations=5",
            ])
            .arg(root().join("python/tests"));
        pytest
    });
    assert_eq!(tests.code, 0, "{}{}", tests.stdout, tests.stderr);
    assert!(tests.stdout.contains(" passed"), "{}", tests.stdout);
}
