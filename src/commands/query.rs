//! `tauscope query`.

use std::ffi::OsString;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::program_beside;

/// Ask in SQL what is in archives and results: `tauscope query --help` (docs/query.md).
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// A query, and the archives and results it is about.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Asks.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    program_beside::run("tauscope-query", &args.arguments, out)
}
