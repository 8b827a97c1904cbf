//! `tauscope cluster`: queries over archives on several machines, with Ballista's scheduler and executors.

mod codec;
mod executor;
mod handshake;
mod query;
mod scheduler;

use std::process::ExitCode;

use clap::Parser;
use tauscope_pipeline::report::Report;

/// Time between two heartbeats of an executor \[s\].
/// Resolution: how soon a lost one is detected, against messages of a hundred executors.
const HEARTBEAT_S: u64 = 2;

/// Longest message \[bytes\]. A plan names each recording; a hundred thousand names take some 10 MB.
/// Resolution: bounds memory.
const MAX_MESSAGE_BYTES: u32 = 64 << 20;

/// Queries over archives on several machines (docs/query.md).
#[derive(Debug, Parser)]
#[command(name = "tauscope cluster", version)]
enum Command {
    Scheduler(scheduler::Args),
    Executor(executor::Args),
    Query(query::Args),
}

/// Wrong arguments or files: nothing was started.
#[derive(Debug)]
struct Rejected(Report);

impl std::fmt::Display for Rejected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0.render(false))
    }
}

impl std::error::Error for Rejected {}

fn main() -> ExitCode {
    let command = Command::parse();
    let ended = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(Into::into);
    let ended = ended.and_then(|runtime| {
        runtime.block_on(async {
            match &command {
                Command::Scheduler(args) => scheduler::run(args).await,
                Command::Executor(args) => executor::run(args).await,
                Command::Query(args) => query::run(args).await,
            }
        })
    });
    let Err(error) = ended else {
        return ExitCode::SUCCESS;
    };
    if let Some(rejected) = error.downcast_ref::<Rejected>() {
        eprintln!("{rejected}");
        return ExitCode::from(2);
    }
    eprintln!("error: {}", tauscope_query::problem::of_answer(&error));
    ExitCode::FAILURE
}
