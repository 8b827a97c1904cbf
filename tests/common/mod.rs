//! Helpers shared by the tests of the whole program.
#![allow(
    dead_code,
    reason = "hostile.rs and faults.rs, programs of their own, use a part"
)]
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

pub mod formats;
pub mod labelled_set;
pub mod learnt_pipeline;
pub mod live;
pub mod python;
pub mod robot;
pub mod ur_controller;

use std::ffi::OsString;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program under test.
pub fn tauscope() -> Command {
    Command::new(env!("CARGO_BIN_EXE_tauscope"))
}

/// Removes the environment variables of the test's own package from a cargo command. The build script of ring reads
/// them, so ring and nearly everything else would be built again.
pub fn hide_own_package(command: &mut Command) {
    for (name, _) in std::env::vars_os() {
        let of_package = |name: &str| {
            let own = ["CARGO_PKG_", "CARGO_MANIFEST_", "CARGO_BIN_EXE_"];
            own.iter().any(|own| name.starts_with(own))
        };
        if name.to_str().is_some_and(of_package) {
            command.env_remove(name);
        }
    }
}

/// The root of the project.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Folder of the bundled recordings and robots.
pub fn bundled() -> PathBuf {
    root().join("tests/data")
}

/// Folder of real recordings, if it exists. Otherwise reports the skipped test past the test harness.
pub fn shared(test: &str) -> Option<PathBuf> {
    let shared = root().join("../shared");
    if shared.is_dir() {
        return Some(shared);
    }
    skipped(test, "../shared is absent");
    None
}

/// Reports a skipped test past the harness, which hides the output of passing tests.
pub fn skipped(test: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "SKIPPED {test}: {why}");
}

/// Writes a file and returns its path.
pub fn write(path: &Path, text: &str) -> PathBuf {
    std::fs::write(path, text).unwrap();
    path.to_owned()
}

/// Exit code and output of a command.
#[derive(Debug)]
pub struct Out {
    /// Exit code; -1 if a signal ended it.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Out {
    /// Runs the program with these arguments as a function, without starting a process.
    pub fn answer<A: Into<OsString>>(arguments: impl IntoIterator<Item = A>) -> Self {
        let tauscope::Answer {
            code,
            stdout,
            stderr,
            ..
        } = tauscope::answer(arguments);
        Self {
            code: code.into(),
            stdout,
            stderr,
        }
    }

    /// Runs `command` to its end.
    pub fn of(mut command: Command) -> Self {
        let out = command.output().unwrap();
        Self {
            code: out.status.code().unwrap_or(-1),
            stdout: String::from_utf8(out.stdout).unwrap(),
            stderr: String::from_utf8(out.stderr).unwrap(),
        }
    }
}
