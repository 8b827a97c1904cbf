//! The `tauscope` program: command line, pipeline file, supervisor, replay. Its physics is in the
//! stages.

mod announce;
mod build;
mod calibrate;
mod cli;
mod commands;
mod exit;
mod files;
mod pipeline;
mod plan;
mod progress;
mod provenance;
mod replay;
mod report;
mod suggest;
mod supervisor;
mod yaml;

use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command};

fn main() -> ExitCode {
    // What libraries and stages warn of goes where errors go.
    tracing_subscriber::fmt()
        .with_max_level(tracing::Level::WARN)
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .init();
    let command = Cli::parse()
        .command
        .unwrap_or_else(|| Command::Run(Default::default()));
    exit::code(match command {
        Command::Run(args) => commands::run::run(&args),
        Command::Check(args) => commands::check::run(&args),
        Command::Schema(args) => commands::schema::run(&args),
        Command::Replay(args) => commands::replay::run(&args),
        Command::Calibrate(args) => commands::calibrate::run(&args),
        Command::Simulate(args) => commands::simulate::run(&args),
        Command::Info(args) => commands::info::run(&args),
        Command::Repair(args) => commands::repair::run(&args),
        Command::Stage(args) => return commands::stage::run(&args),
        Command::Exec(args) => return commands::stage::exec(&args),
    })
}
