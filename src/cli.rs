//! The command line.

use clap::{Parser, Subcommand};

use crate::commands::{check, schema};

/// A robot's measured effort beside its digital twin's: stream, detect, record.
///
/// Exit codes: 0 done; 1 failed; 2 wrong arguments or files (nothing was started); 3 done, but data
/// was lost (the summary says which and how much).
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
pub struct Cli {
    /// Without one: run.
    #[command(subcommand)]
    pub command: Command,
}

/// What there is to do; each in its own module of [`crate::commands`].
#[derive(Debug, Subcommand)]
pub enum Command {
    Check(check::Args),
    Schema(schema::Args),
}
