//! The `tauscope` program: command line, supervisor, and output for people. Its physics is in the stages; its files,
//! and the stages built from them, are in `tauscope_pipeline`.
//!
//! [`answer`] runs a command as a function; [`answer_alone`] does so for a process that does nothing else.

mod cli;
mod commands;
mod doctor;
mod existing;
mod exit;
mod explain;
mod init;
mod interrupt;
mod output;
mod physics;
mod plan;
mod program_beside;
mod progress;
mod supervisor;
mod terminal;
mod warnings;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser};
use rustix::process::{Signal, set_parent_process_death_signal};

use cli::{Cli, Command};
use output::Output;

/// Runs the program with the arguments of the command line and the terminal for output.
pub fn main() -> ExitCode {
    warnings::show(terminal::has_colour());
    match Cli::parse().command.unwrap_or_default() {
        Command::Stage(args) => commands::stage::run(&args),
        Command::Exec(args) => commands::stage::exec(&args),
        command => {
            // `run` handles signals itself: it ends its stages first.
            if !matches!(command, Command::Run(_))
                && let Err(error) = interrupt::listen()
            {
                eprintln!("error: cannot listen to signals: {error}");
                return ExitCode::FAILURE;
            }
            let mut out = Output::Terminal;
            let outcome = outcome(&command, &mut out);
            ExitCode::from(exit::code(outcome, &mut out))
        }
    }
}

/// Result of a command that was run as a function.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The exit code.
    pub code: u8,
    /// Text that the program would write to standard output.
    pub stdout: String,
    /// Text that it would write to standard error, without the warnings that stages log with `tracing`.
    pub stderr: String,
    /// Errors in arguments or files because of which nothing was started, as `check --json` prints them:
    /// `{"errors": [...]}`.
    pub errors: serde_json::Value,
}

/// Runs a command as a function, without a process: `arguments` are those after the program's name.
///
/// Not for `run`, whose stages are processes of this program.
pub fn answer(arguments: impl IntoIterator<Item = impl Into<OsString>>) -> Answer {
    let name = OsString::from(env!("CARGO_PKG_NAME"));
    let arguments = arguments.into_iter().map(Into::into);
    let mut output = Output::Memory(String::new(), String::new());
    let no_errors = serde_json::json!({ "errors": [] });
    let (code, errors) = match Cli::try_parse_from(std::iter::once(name).chain(arguments)) {
        Ok(cli) => {
            let outcome = outcome(&cli.command.unwrap_or_default(), &mut output);
            let errors = match &outcome {
                Err(exit::Failure::Rejected(report)) => report.json(),
                _ => no_errors,
            };
            (exit::code(outcome, &mut output), errors)
        }
        Err(error) => {
            if error.use_stderr() {
                output.say(&error.to_string());
            } else if let Output::Memory(stdout, _) = &mut output {
                stdout.push_str(&error.to_string());
            }
            (
                u8::try_from(error.exit_code()).unwrap_or(u8::MAX),
                no_errors,
            )
        }
    };
    let (stdout, stderr) = match output {
        Output::Memory(stdout, stderr) => (stdout, stderr),
        Output::Terminal => Default::default(),
    };
    Answer {
        code,
        stdout,
        stderr,
        errors,
    }
}

/// Runs a command like [`answer`], in a process that exists for this command alone and ends with its parent. Signals
/// terminate it as they do the program; warnings of stages go to standard error.
///
/// # Errors
/// If the signal handlers cannot be installed.
pub fn answer_alone(
    arguments: impl IntoIterator<Item = impl Into<OsString>>,
) -> std::io::Result<Answer> {
    warnings::show(false);
    set_parent_process_death_signal(Some(Signal::TERM))?;
    interrupt::listen()?;
    Ok(answer(arguments))
}

/// Runs a command that needs no process of its own.
fn outcome(command: &Command, out: &mut Output) -> Result<exit::Exit, exit::Failure> {
    match command {
        Command::Run(args) => commands::run::run(args, out),
        Command::Check(args) => commands::check::run(args, out),
        Command::Schema(args) => commands::schema::run(args, out),
        Command::Replay(args) => commands::replay::run(args, out),
        Command::Diff(args) => commands::diff::run(args, out),
        Command::Query(args) => commands::query::run(args, out),
        Command::Cluster(args) => commands::cluster::run(args, out),
        Command::Manifest(args) => commands::manifest::run(args, out),
        Command::Calibrate(args) => commands::calibrate::run(args, out),
        Command::Explain(args) => commands::explain::run(args, out),
        Command::Export(args) => commands::export::run(args, out),
        Command::Evaluate(args) => commands::evaluate::run(args, out),
        Command::Send(args) => commands::send::run(args, out),
        Command::Fleet(args) => commands::fleet::run(args, out),
        Command::Physics(args) => commands::physics::run(args, out),
        Command::Weeks(args) => commands::weeks::run(args, out),
        Command::Simulate(args) => commands::simulate::run(args, out),
        Command::Init(args) => commands::init::run(args, out),
        Command::Info(args) => commands::info::run(args, out),
        Command::Repair(args) => commands::repair::run(args, out),
        Command::Doctor(args) => commands::doctor::run(args, out),
        Command::Completions(args) => commands::completions::run(args, Cli::command(), out),
        Command::Man(args) => commands::man::run(args, Cli::command(), out),
        Command::Stage(_) | Command::Exec(_) => Err(exit::Failure::rejected(
            "this command is for `tauscope run`",
        )),
    }
}
