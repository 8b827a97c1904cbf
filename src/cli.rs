//! The command line.

use clap::{Parser, Subcommand};

use crate::commands::{
    calibrate, check, cluster, completions, diff, doctor, evaluate, explain, export, fleet, info,
    init, man, manifest, physics, query, repair, replay, run, schema, send, simulate, stage, weeks,
};

/// Compare a robot's measured effort with that of its digital twin: stream, detect, record, explain.
///
/// Exit codes: 0 done; 1 failed; 2 wrong arguments or files (nothing was started); 3 done, but data
/// was lost (the summary says which and how much).
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
pub struct Cli {
    /// The command; `run` if none is given.
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// The commands, each in its own module of [`crate::commands`].
#[derive(Debug, Subcommand)]
pub enum Command {
    Run(run::Args),
    Check(check::Args),
    Schema(schema::Args),
    Replay(replay::Args),
    Manifest(manifest::Args),
    Diff(diff::Args),
    Query(query::Args),
    Cluster(cluster::Args),
    Calibrate(calibrate::Args),
    Explain(explain::Args),
    Export(export::Args),
    Evaluate(evaluate::Args),
    Send(send::Args),
    Fleet(fleet::Args),
    Physics(physics::Args),
    Weeks(weeks::Args),
    Simulate(simulate::Args),
    Init(init::Args),
    Info(info::Args),
    Repair(repair::Args),
    Doctor(doctor::Args),
    Completions(completions::Args),
    Man(man::Args),
    #[command(hide = true)]
    Stage(stage::StageArgs),
    #[command(hide = true)]
    Exec(stage::ExecArgs),
}

impl Default for Command {
    fn default() -> Self {
        Self::Run(run::Args::default())
    }
}
