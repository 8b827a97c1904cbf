//! `tauscope cluster`.

use std::ffi::OsString;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::program_beside;

/// Queries on several machines: a scheduler, its executors, and who asks: `tauscope cluster --help` (docs/query.md).
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// `scheduler`, `executor` or `query`, and its options.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    program_beside::run("tauscope-cluster", &args.arguments, out)
}
