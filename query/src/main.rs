//! `tauscope query`: SQL over archives and over results of replays.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use datafusion::prelude::SessionContext;
use tauscope_query::output::Answer;

/// SQL over archives and over results of `tauscope replay --manifest` (docs/query.md).
///
/// Tables: `recordings` and `joints` of the archives; `replays`, `residuals`, `events`, `physics` and `detections` of the
/// results. `replay('pipeline.yaml', 'archive/*.mcap')` replays recordings as the query asks.
#[derive(Debug, Parser)]
#[command(name = "tauscope query", version)]
struct Args {
    /// The query.
    sql: String,
    /// Recordings, manifests and folders of results, or patterns of them in quotes.
    paths: Vec<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let runtime = match tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
    {
        Ok(runtime) => runtime,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    runtime.block_on(run(&args))
}

async fn run(args: &Args) -> ExitCode {
    let context = SessionContext::new();
    let planned = async {
        args.answer.check()?;
        tauscope_query::register(&context, &args.paths).await?;
        tauscope_query::plan(&context, &args.sql).await
    };
    let frame = match planned.await {
        Ok(frame) => frame,
        Err(report) => {
            eprintln!(
                "{}",
                report.render(std::io::IsTerminal::is_terminal(&std::io::stderr()))
            );
            return ExitCode::from(2);
        }
    };
    match args.answer.write(frame).await {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", tauscope_query::problem::of_answer(&error));
            ExitCode::FAILURE
        }
    }
}
