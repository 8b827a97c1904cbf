//! The hidden commands with which `tauscope run` starts its stages.

use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};

use rustix::process::{Signal, set_parent_process_death_signal};
use tauscope_bus::shell::{Child, ChildError};
use tauscope_ingest::SimulatedRobot;
use tauscope_pipeline::build::{self, BuildError};
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::learnt_state::{self, Kept};
use tauscope_pipeline::report::Report;
use tauscope_pipeline::scenario::ScenarioFacts;
use tauscope_pipeline::settings::Settings;

use crate::announce::{self, Announced};
use crate::supervisor::Instructions;

/// A stage of ours: its seat stands on standard input.
#[derive(Debug, clap::Args)]
pub struct StageArgs {}

/// A program that is not ours, which ends when the supervisor does.
#[derive(Debug, clap::Args)]
pub struct ExecArgs {
    /// The program and its arguments.
    #[arg(required = true, last = true)]
    command: Vec<std::ffi::OsString>,
}

/// Why a stage cannot be made from its seat.
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

/// Takes the seat and runs the stage to its end.
pub fn run(_args: &StageArgs) -> ExitCode {
    let child = match Child::take_seat() {
        Ok(child) => child,
        Err(error) => return no_seat(&error),
    };
    match Made::from_seat(&child) {
        Ok(Made::Source(mut source)) => child.source(&mut *source),
        Ok(Made::Twin(mut twin)) => child.stage(&mut *twin),
        Ok(Made::Detect(mut detect)) => child.stage(&mut *detect),
        Ok(Made::Watch(mut watch)) => child.stage(&mut *watch),
        Ok(Made::Record(mut recorder)) => child.sink(&mut *recorder),
        Ok(Made::Publish(mut publisher)) => child.sink(&mut *publisher),
        Err(error) => child.fail(&error),
    }
}

/// Becomes the program, once its end is tied to the supervisor's.
pub fn exec(args: &ExecArgs) -> ExitCode {
    let Some((program, arguments)) = args.command.split_first() else {
        return ExitCode::FAILURE;
    };
    // Survives the exec. Where it fails, the program still sees its standard input end.
    if let Err(error) = set_parent_process_death_signal(Some(Signal::TERM)) {
        eprintln!("warning: may outlive the supervisor: {error}");
    }
    let error = Command::new(program).args(arguments).exec();
    eprintln!("error: cannot start {}: {error}", program.display());
    ExitCode::FAILURE
}

fn no_seat(error: &ChildError) -> ExitCode {
    eprintln!("error: {error}; this command is for `tauscope run`");
    ExitCode::FAILURE
}

/// A stage of ours, made.
enum Made {
    Source(Box<dyn tauscope_bus::Source<tauscope_bus::JointState>>),
    Twin(Box<tauscope_twin::Twin>),
    Detect(Box<Announced<Kept>>),
    Watch(Box<Announced<tauscope_watch::Watch>>),
    Record(Box<tauscope_record::Recorder>),
    Publish(Box<tauscope_publish::Publisher>),
}

impl Made {
    fn from_seat(child: &Child) -> Result<Self, SeatError> {
        let told: Instructions = serde_json::from_value(child.seat().config.clone())?;
        let cells: Vec<Cell> = told
            .cells
            .into_iter()
            .map(Cell::from_facts)
            .collect::<Result<_, _>>()?;
        let cell = || cells.first().ok_or(SeatError::NoCell);
        Ok(match &told.settings {
            Settings::Ingest(config) => {
                let robot: Option<SimulatedRobot> = told
                    .scenario
                    .as_ref()
                    .map(ScenarioFacts::robot)
                    .transpose()?;
                let source = build::ingest(config, robot.as_ref(), cell()?, told.after_ns)?;
                let source = build::commanded(source, config, cell()?)?;
                Self::Source(Box::new(announce::commands::Announced::new(source)))
            }
            Settings::Twin { config, model } => {
                Self::Twin(Box::new(build::twin(config, model.as_ref(), cell()?)?))
            }
            Settings::Detect { config, model } => {
                let mut config = config.clone();
                let path = learnt_state::resume(&mut config).map_err(SeatError::LearntState)?;
                let detect = build::detect(&config, model.as_ref(), cell()?, None)?;
                let detect = Kept::new(detect, path);
                Self::Detect(Box::new(Announced::new(detect, &cell()?.facts)))
            }
            Settings::Explain {
                config,
                model,
                effort_cutoff_hz,
            } => {
                let watch = build::watch(config, model.as_ref(), *effort_cutoff_hz, cell()?)?;
                Self::Watch(Box::new(Announced::new(watch, &cell()?.facts)))
            }
            Settings::Record(config) => {
                let cells: Vec<&Cell> = cells.iter().collect();
                let recorder = build::recorder(config, &cells, &told.streams, &told.provenance)?;
                Self::Record(Box::new(recorder))
            }
            Settings::Publish {
                config,
                commands,
                beside,
            } => {
                let restarted = child.seat().restarts > 0;
                let (commands, streams) = (commands.as_ref(), &told.streams);
                let publisher =
                    build::publisher(config, commands, beside, cell()?, streams, restarted)?;
                Self::Publish(Box::new(publisher))
            }
            Settings::Outside(_) => return Err(SeatError::Outside),
        })
    }
}
