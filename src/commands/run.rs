//! `tauscope run`.

use std::path::PathBuf;

use anyhow::Context;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::report::Problem;
use tauscope_pipeline::settings::Settings;
use tauscope_pipeline::suggest;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::plan;
use crate::supervisor::{self, Summary};

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
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
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
    for warning in pipeline.warnings(host) {
        out.say(&format!("warning: {warning}"));
    }
    let links = plan::links(&pipeline);
    let summary = supervisor::run(&pipeline, &links, host)?;
    let text = if args.json {
        serde_json::to_string_pretty(&summary).context("cannot encode the summary")?
    } else {
        summary.table()
    };
    out.print(&text)?;
    if !args.json {
        out.print(&written(&pipeline, &summary))?;
    }
    Ok(summary.exit())
}

/// What this host's recorders have completed, and how to open it.
fn written(pipeline: &Pipeline, summary: &Summary) -> String {
    let mut lines = Vec::new();
    for stage in summary.stages.iter().filter(|stage| !stage.failed) {
        let stage = pipeline
            .stages
            .iter()
            .find(|known| known.name == stage.stage);
        let Some(Settings::Record(config)) = stage.map(|stage| &stage.settings) else {
            continue;
        };
        let picture = config.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        let files = config.mcap.iter().chain(picture);
        for (path, file) in files.filter_map(|path| Some((path, path.metadata().ok()?))) {
            let megabytes = file.len() as f64 * 1e-6;
            lines.push(format!("wrote {} ({megabytes:.1} MB)", path.display()));
        }
        if let Some(path) = picture {
            let version = tauscope_record::rerun_version();
            let path = path.display();
            lines.push(format!(
                "see it: pip install rerun-sdk=={version} && rerun {path}"
            ));
        }
    }
    lines.join("\n")
}
