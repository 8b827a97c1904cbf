//! The `tauscope` program: command line, pipeline file, supervisor, replay. Its physics is in the
//! stages.

mod announce;
mod build;
mod calibrate;
mod cli;
mod commands;
mod evaluate;
mod exit;
mod explain;
mod files;
mod learnt_state;
mod pipeline;
mod plan;
mod progress;
mod provenance;
mod replay;
mod report;
mod suggest;
mod supervisor;
mod trained;
mod yaml;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use cli::{Cli, Command};

fn main() -> ExitCode {
    // What stages warn of, and what libraries fail in, goes where errors go.
    let targets = Targets::new()
        .with_default(LevelFilter::ERROR)
        .with_target("tauscope", LevelFilter::WARN);
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .with_target(false);
    tracing_subscriber::registry()
        .with(lines.with_filter(targets))
        .init();
    let command = Cli::parse()
        .command
        .unwrap_or_else(|| Command::Run(commands::run::Args::default()));
    exit::code(match command {
        Command::Run(args) => commands::run::run(&args),
        Command::Check(args) => commands::check::run(&args),
        Command::Schema(args) => commands::schema::run(&args),
        Command::Replay(args) => commands::replay::run(&args),
        Command::Calibrate(args) => commands::calibrate::run(&args),
        Command::Explain(args) => commands::explain::run(&args),
        Command::Evaluate(args) => commands::evaluate::run(&args),
        Command::Simulate(args) => commands::simulate::run(&args),
        Command::Info(args) => commands::info::run(&args),
        Command::Repair(args) => commands::repair::run(&args),
        Command::Stage(args) => return commands::stage::run(&args),
        Command::Exec(args) => return commands::stage::exec(&args),
    })
}
