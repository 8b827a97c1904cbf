//! `tauscope query`: a program of its own, so that nobody waits for `DataFusion` who does not ask in SQL.

use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Context as _;
use tauscope_pipeline::report::Problem;

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// The program.
const PROGRAM: &str = "tauscope-query";

/// What builds it.
const BUILD: &str = "cargo build --release --manifest-path query/Cargo.toml --target-dir target";

/// Ask in SQL what is in archives and results: `tauscope query --help` (docs/query.md).
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// A query, and the archives and results it is about.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the program, which lies beside this one or on the PATH.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let beside = std::env::current_exe()
        .ok()
        .map(|program| program.with_file_name(PROGRAM))
        .filter(|program| program.is_file());
    let program = beside.unwrap_or_else(|| PathBuf::from(PROGRAM));
    let mut command = Command::new(&program);
    command.args(&args.arguments);
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
            let title = format!("{PROGRAM} is neither beside this program nor on the PATH");
            let problem = Problem::new(title).help(format!("build it: {BUILD}"));
            Err(Failure::Rejected(problem.into()))
        }
        Err(error) => Err(error)
            .with_context(|| program.display().to_string())
            .map_err(Failure::from),
    }
}
