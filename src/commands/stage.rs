//! The hidden commands with which `tauscope run` starts its stages.

use std::collections::BTreeMap;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};

use rustix::process::{Signal, set_parent_process_death_signal};
use tauscope_bus::Seat;
use tauscope_bus::shell::{self, Node, Unmade, worker};
use tauscope_ingest::SimulatedRobot;
use tauscope_pipeline::build::{self, BuildError};
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::learnt_state::{self, Kept};
use tauscope_pipeline::plausible::{self, PlausibleTwin, Watched, WatchedTwin};
use tauscope_pipeline::report::Report;
use tauscope_pipeline::scenario::ScenarioFacts;
use tauscope_pipeline::settings::Settings;

use crate::announce::{self, Announced};
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
    #[error("the seat names no cell")]
    NoCell,
    #[error("an outside stage was started as one of ours")]
    Outside,
    #[error("what was learnt cannot be read:\n{0}")]
    LearntState(Report),
    #[error(transparent)]
    Model(#[from] tauscope_dynamics::ModelError),
    #[error(transparent)]
    Build(#[from] BuildError),
    #[error(transparent)]
    Ingest(#[from] tauscope_ingest::IngestError),
    #[error(transparent)]
    Record(#[from] tauscope_record::RecordError),
    #[error(transparent)]
    Publish(#[from] tauscope_publish::PublishError),
    #[error("cannot take commands: {0}")]
    Commands(#[from] tauscope_bus::LinkError),
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

/// Reports that a restarted stage has lost what it had learnt, if no state was saved.
fn tell_what_is_lost(seat: &Seat, kept: Option<&Path>) {
    if seat.restarts > 0 && kept.is_none_or(|path| !path.exists()) {
        let how = match kept {
            Some(_) => "nothing was kept yet",
            None => "`state: FILE` keeps it",
        };
        let lost = format!("started again: what it had learnt is lost; {how}");
        shell::note(&seat.stage, &lost);
    }
}

fn member(seat: &Seat, shared: &tauscope_detect::Shared) -> Result<Node<'static>, SeatError> {
    let told: Instructions = serde_json::from_value(seat.config.clone())?;
    let cells: Vec<Cell> = told
        .cells
        .into_iter()
        .map(Cell::from_facts)
        .collect::<Result<_, _>>()?;
    let cell = || cells.first().ok_or(SeatError::NoCell);
    Ok(match &told.settings {
        Settings::Ingest(config) => {
            let scenario = told.scenario.as_ref();
            let robot: Option<SimulatedRobot> = scenario.map(ScenarioFacts::robot).transpose()?;
            let source = build::ingest(config, robot.as_ref(), cell()?, told.after_ns)?;
            let source = build::commanded(source, config, cell()?, told.somebody_learns)?;
            let source = Watched::new(&seat.stage, source, plausible::of_cell(cell()?));
            Node::source(Box::new(announce::commands::Announced::new(
                &seat.stage,
                source,
            )))
        }
        Settings::Twin { config, model } => {
            let (model, cell) = (model.as_ref(), cell()?);
            let twin = build::twin(config, model, cell)?;
            let plausible = PlausibleTwin::new(config, model, cell);
            Node::stage(Box::new(WatchedTwin::new(&seat.stage, twin, plausible)))
        }
        Settings::Detect { config, model } => {
            let mut config = config.clone();
            let path = learnt_state::resume(&mut config).map_err(SeatError::LearntState)?;
            if config.learns_when_told() {
                tell_what_is_lost(seat, path.as_deref());
            }
            let detect = build::detect(&config, model.as_ref(), cell()?, Some(shared.clone()))?;
            let detect = Kept::new(detect, path);
            Node::stage(Box::new(Announced::new(
                &seat.stage,
                detect,
                &cell()?.facts,
            )))
        }
        Settings::Watch {
            config,
            model,
            effort_cutoff_hz,
        } => {
            let cell = cell()?;
            let mut watch = build::watch(config, model.as_ref(), *effort_cutoff_hz, cell)?;
            if let Some(path) = &config.state {
                let joints = cell.facts.joint_names.len();
                let memory =
                    learnt_state::of_watch(path, joints).map_err(SeatError::LearntState)?;
                if let Some(memory) = memory {
                    watch = watch.resumed(&memory);
                }
            }
            tell_what_is_lost(seat, config.state.as_deref());
            let watch = Kept::new(watch, config.state.clone());
            Node::stage(Box::new(Announced::new(&seat.stage, watch, &cell.facts)))
        }
        Settings::Record(config) => {
            let cells: Vec<&Cell> = cells.iter().collect();
            let mut recorder = build::recorder(config, &cells, &told.streams, &told.provenance)?;
            recorder.repair_leftovers(config);
            Node::sink(Box::new(recorder))
        }
        Settings::Publish {
            config,
            commands,
            beside,
        } => {
            let restarted = seat.restarts > 0;
            let (commands, streams) = (commands.as_ref(), &told.streams);
            let publisher =
                build::publisher(config, commands, beside, cell()?, streams, restarted)?;
            Node::sink(Box::new(publisher))
        }
        Settings::Outside(_) => return Err(SeatError::Outside),
    })
}
