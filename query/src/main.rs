//! `tauscope query`: SQL over archives and over results of replays.

mod archives;
mod output;
mod replay;
mod results;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Parser;
use datafusion::prelude::{SessionConfig, SessionContext};

/// SQL over archives and over results of `tauscope replay --manifest`.
///
/// Tables: `recordings` and `joints` of the archives; `replays`, `residuals`, `events`, `physics` and `detections` of the
/// results. `replay('pipeline.yaml', 'archive/*.mcap')` replays recordings as the query asks and gives their events.
#[derive(Debug, Parser)]
#[command(name = "tauscope query", version)]
struct Args {
    /// The query.
    sql: String,
    /// Recordings, folders of results, or patterns of either in quotes.
    paths: Vec<PathBuf>,
    /// How the answer is written.
    #[arg(long, value_enum, default_value_t)]
    format: output::Format,
    /// The file of the answer; without it, the terminal. Parquet and Arrow need one.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    if let Err(error) = output::check(args.format, args.out.as_deref()) {
        eprintln!("error: {error:#}");
        return ExitCode::from(2);
    }
    let runtime = match tokio::runtime::Builder::new_multi_thread().build() {
        Ok(runtime) => runtime,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    match runtime.block_on(answer(&args)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

async fn answer(args: &Args) -> anyhow::Result<()> {
    let context = SessionContext::new_with_config(SessionConfig::new());
    let (recordings, folders) = sort(&args.paths)?;
    archives::register(&context, recordings)?;
    results::register(&context, &folders).await?;
    context.register_udtf("replay", std::sync::Arc::new(replay::ReplayFunction));
    let frame = context.sql(&args.sql).await.context("the query")?;
    output::write(frame, args.format, args.out.as_deref()).await
}

/// Recordings, and results: folders with Parquet files, or such files.
fn sort(paths: &[PathBuf]) -> anyhow::Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let (mut recordings, mut results) = (Vec::new(), Vec::new());
    for path in expand(paths)? {
        let is_bag = path.join("metadata.yaml").exists();
        let is_parquet = path.extension().is_some_and(|ending| ending == "parquet");
        if is_parquet || (path.is_dir() && !is_bag) {
            results.push(path);
        } else {
            recordings.push(path);
        }
    }
    Ok((recordings, results))
}

/// The paths, those of a pattern in the order of their names.
pub(crate) fn expand(paths: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in paths {
        if path.exists() {
            found.push(path.clone());
            continue;
        }
        let text = path.to_string_lossy();
        let before = found.len();
        found.extend(glob::glob(&text)?.filter_map(Result::ok));
        anyhow::ensure!(found.len() > before, "there is no file {text}");
    }
    Ok(found)
}
