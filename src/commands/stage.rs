//! The hidden commands with which `tauscope run` starts its stages.

use std::collections::BTreeMap;
use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};

use rustix::process::{Signal, set_parent_process_death_signal};
use tauscope_bus::Seat;
use tauscope_bus::shell::{Node, Unmade, worker};
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::pipeline::{LiveSite, NodeError};

use crate::supervisor::Instructions;

/// Built-in stages; their seats are read from standard input.
#[derive(Debug, clap::Args)]
pub struct StageArgs {}

/// An external program, which ends with the supervisor.
#[derive(Debug, clap::Args)]
pub struct ExecArgs {
    /// The program and its arguments.
    #[arg(required = true, last = true)]
    command: Vec<std::ffi::OsString>,
}

/// Reason why a stage cannot be created from its seat.
#[derive(Debug, thiserror::Error)]
enum SeatError {
    #[error("the seat holds no stage of ours: {0}")]
    Config(#[from] serde_json::Error),
    #[error(transparent)]
    Model(#[from] tauscope_dynamics::ModelError),
    #[error(transparent)]
    Node(#[from] NodeError),
}

/// Reads the seats and runs their stages to their end.
pub fn run(_args: &StageArgs) -> ExitCode {
    worker(make)
}

/// Creates the stages of one group.
fn make(seats: &[Seat]) -> Result<Vec<Node<'static>>, Unmade> {
    // By their twin: detectors that receive the same samples, one after the other.
    let mut shared: BTreeMap<&str, tauscope_detect::Shared> = BTreeMap::new();
    let mut members = Vec::new();
    for seat in seats {
        let behind = seat.inputs.first().map_or("", |input| &input.from);
        let shared = shared.entry(behind).or_default();
        let made = member(seat, shared);
        members.push(made.map_err(|error| Unmade::new(&seat.stage, &error))?);
    }
    Ok(members)
}

/// Replaces this process by the program, after tying its life to the supervisor's.
pub fn exec(args: &ExecArgs) -> ExitCode {
    let Some((program, arguments)) = args.command.split_first() else {
        return ExitCode::FAILURE;
    };
    // The setting survives the exec. If it fails, the program can still notice the end of its standard input.
    if let Err(error) = set_parent_process_death_signal(Some(Signal::TERM)) {
        eprintln!("warning: may outlive the supervisor: {error}");
    }
    let error = Command::new(program).args(arguments).exec();
    eprintln!("error: cannot start {}: {error}", program.display());
    ExitCode::FAILURE
}

fn member(seat: &Seat, shared: &tauscope_detect::Shared) -> Result<Node<'static>, SeatError> {
    let told: Instructions = serde_json::from_value(seat.config.clone())?;
    let cells = told.cells.into_iter().map(Cell::from_facts);
    let cells: Vec<Cell> = cells.collect::<Result<_, _>>()?;
    let site = LiveSite {
        stage: &seat.stage,
        cells: &cells,
        restarts: seat.restarts,
        after_ns: told.after_ns,
        somebody_learns: told.somebody_learns,
        streams: &told.streams,
        provenance: &told.provenance,
        shared,
    };
    Ok(told.settings.live(&site)?)
}
