//! `tauscope run`.

use std::path::PathBuf;

use anyhow::Context;

use crate::exit::{Exit, Failure};
use crate::pipeline::Pipeline;
use crate::plan;
use crate::report::Problem;
use crate::suggest;
use crate::supervisor;

/// Run a pipeline: check the file, start this host's stages, look after them until the source ends
/// or Ctrl-C.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The pipeline file.
    #[arg(default_value = DEFAULT)]
    pipeline: PathBuf,
    /// Which of the file's hosts this is, where it names several.
    #[arg(long, value_name = "NAME")]
    host: Option<String>,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

const DEFAULT: &str = "pipeline.yaml";

impl Default for Args {
    fn default() -> Self {
        Self {
            pipeline: DEFAULT.into(),
            host: None,
            json: false,
        }
    }
}

/// Runs it.
pub fn run(args: &Args) -> Result<Exit, Failure> {
    let pipeline = Pipeline::load(&args.pipeline, args.host.as_deref())?;
    let names = || pipeline.hosts.keys().map(String::as_str);
    let host = match (&args.host, pipeline.hosts.len()) {
        (None, 2..) => {
            let title = "the pipeline runs on several hosts: which one is this?";
            let help = format!("give `--host`, one of {}", suggest::list(names()));
            return Err(Failure::Rejected(Problem::new(title).help(help).into()));
        }
        (host, _) => host.as_deref(),
    };
    let links = plan::links(&pipeline);
    // One thread: it waits for pipes, processes and signals. And Linux ties a child's life to the
    // thread that started it.
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot wait for processes")?;
    let summary = runtime.block_on(supervisor::run(&pipeline, &links, host))?;
    let text = if args.json {
        serde_json::to_string_pretty(&summary).context("cannot encode the summary")?
    } else {
        summary.table()
    };
    super::print(&text)?;
    Ok(summary.exit())
}
