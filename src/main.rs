//! The `tauscope` program: command line, pipeline file, supervisor, replay. Its physics is in the
//! stages.

mod build;
mod cli;
mod commands;
mod exit;
mod pipeline;
mod plan;
mod report;
mod suggest;
mod yaml;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};
use commands::{check, schema};

fn main() -> ExitCode {
    exit::code(match Cli::parse().command {
        Command::Check(args) => check::run(&args),
        Command::Schema(args) => schema::run(&args),
    })
}
