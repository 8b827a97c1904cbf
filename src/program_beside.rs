//! Programs that are built apart, so that nobody waits for `DataFusion` who does not ask in SQL.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Context as _;
use tauscope_pipeline::report::Problem;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Runs a program of the workspace in `query/`, which lies beside this one or on the PATH.
pub fn run(name: &str, arguments: &[OsString], out: &mut Output) -> Result<Exit, Failure> {
    let beside = std::env::current_exe()
        .ok()
        .map(|program| program.with_file_name(name))
        .filter(|program| program.is_file());
    let program = beside.unwrap_or_else(|| PathBuf::from(name));
    let mut command = Command::new(&program);
    command.args(arguments);
    let status = match out {
        Output::Terminal => command.status(),
        Output::Memory(stdout, stderr) => command.output().map(|answer| {
            stdout.push_str(&String::from_utf8_lossy(&answer.stdout));
            stderr.push_str(&String::from_utf8_lossy(&answer.stderr));
            answer.status
        }),
    };
    match status {
        Ok(status) => Ok(match status.code() {
            Some(0) => Exit::Done,
            Some(2) => Exit::Rejected,
            _ => Exit::Failed,
        }),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            let title = format!("{name} is neither beside this program nor on the PATH");
            let build = format!(
                "build it in the folder of the project: cargo build --release --manifest-path query/Cargo.toml \
                 --target-dir target -p {name}"
            );
            Err(Failure::Rejected(Problem::new(title).help(build).into()))
        }
        Err(error) => Err(error)
            .with_context(|| program.display().to_string())
            .map_err(Failure::from),
    }
}
