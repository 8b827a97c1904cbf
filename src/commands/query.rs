//! `tauscope query`.

use std::ffi::OsString;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::program_beside::{self, Program};

/// What answers. Its own `--help` is the same, where it is built.
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
    program_beside::run(PROGRAM, &args.arguments, out)
}
