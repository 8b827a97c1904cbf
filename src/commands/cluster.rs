//! `tauscope cluster`.

use std::ffi::OsString;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::program_beside::{self, Program};

/// The program behind the command. Its own `--help`, once it is built, has more detail.
const PROGRAM: Program = Program {
    name: "tauscope-cluster",
    help: "\
Queries over archives on several machines (docs/query.md)

Usage: tauscope cluster <COMMAND>

Commands:
  scheduler  Splits queries into tasks and hands them out
  executor   Does tasks
  query      Asks, as `tauscope query` does on one machine

Options:
  -h, --help  Print help",
};

/// Query archives on several machines, with a scheduler and executors: `tauscope cluster --help` (docs/query.md).
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// `scheduler`, `executor` or `query`, and its options.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the program.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    program_beside::run(PROGRAM, &args.arguments, out)
}
