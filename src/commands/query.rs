//! `tauscope query`.

use std::ffi::OsString;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::program_beside::{self, Program};

/// The program behind the command. Its own `--help`, once it is built, is the same.
const PROGRAM: Program = Program {
    name: "tauscope-query",
    help: "\
SQL over archives and over results of `tauscope replay --manifest` (docs/query.md)

Usage: tauscope query [OPTIONS] <SQL> [PATHS]...

Arguments:
  <SQL>       The query
  [PATHS]...  Recordings, manifests and folders of results, or patterns of them in quotes

Options:
      --format <FORMAT>  How the answer is written: table, json, parquet or arrow [default: table]
      --out <FILE>       The file of the answer; without it, standard output
      --force            Replace the file of the answer if it is there
  -h, --help             Print help

Tables: `recordings` and `joints` of the archives; `replays`, `residuals`, `events`, `physics` and `detections` of the
results. `replay('pipeline.yaml', 'archive/*.mcap')` replays recordings as the query asks.",
};

/// Query archives and results in SQL: `tauscope query --help` (docs/query.md).
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// A query, and the archives and results to search.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the query.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    program_beside::run(PROGRAM, &args.arguments, out)
}
