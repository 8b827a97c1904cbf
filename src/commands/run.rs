//! `tauscope run`.

use std::path::PathBuf;

use anyhow::Context;

use crate::exit::{Exit, Failure};
use crate::pipeline::{Pipeline, Settings};
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
    let summary = supervisor::run(&pipeline, &links, host)?;
    let text = if args.json {
        serde_json::to_string_pretty(&summary).context("cannot encode the summary")?
    } else {
        summary.table()
    };
    super::print(&text)?;
    if !args.json {
        super::print(&written(&pipeline, host))?;
    }
    Ok(summary.exit())
}

/// What this host's recorders wrote, and how to open it.
fn written(pipeline: &Pipeline, host: Option<&str>) -> String {
    let mut text = String::new();
    for stage in &pipeline.stages {
        let Settings::Record(config) = &stage.settings else {
            continue;
        };
        if host.is_some() && stage.host.as_deref() != host {
            continue;
        }
        let picture = config.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        for path in [config.mcap.as_ref(), picture]
            .into_iter()
            .flatten()
            .filter(|p| p.exists())
        {
            let size = std::fs::metadata(path).map_or(0, |file| file.len());
            text += &format!("wrote {} ({:.1} MB)\n", path.display(), size as f64 * 1e-6);
        }
        if let Some(path) = picture.filter(|path| path.exists()) {
            let version = tauscope_record::rerun_version();
            text += &format!(
                "see it: pip install rerun-sdk=={version} && rerun {}\n",
                path.display()
            );
        }
    }
    text
}
