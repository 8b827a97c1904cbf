//! `tauscope run`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use tauscope_pipeline::pipeline::{Pipeline, Stage};
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;
use tauscope_record::Existing;

use crate::doctor;
use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::plan;
use crate::supervisor::{self, Care, Summary, Verbosity};

/// Run a pipeline: check the file, start this host's stages, and supervise them until the source ends or Ctrl-C.
#[derive(Debug, Default, clap::Args)]
pub struct Args {
    /// The pipeline file; by default `pipeline.yaml`.
    #[arg(conflicts_with = "pipeline")]
    file: Option<PathBuf>,
    /// The pipeline file, given as an option as for `replay`.
    #[arg(long, value_name = "FILE")]
    pipeline: Option<PathBuf>,
    /// Name of this host in the file, if the file has several.
    #[arg(long, value_name = "NAME")]
    host: Option<String>,
    /// Let recorders replace existing files.
    #[arg(long)]
    force: bool,
    /// Fail if a source emits no usable sample within this time, from the start or since the last one.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    expect_data: Option<Duration>,
    #[command(flatten)]
    telling: Telling,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Verbosity options.
#[derive(Debug, Default, clap::Args)]
struct Telling {
    /// Print only warnings, errors and the summary at the end.
    #[arg(short, long, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more: each step of the start, and a status line every 2 s.
    #[arg(short, long)]
    verbose: bool,
}

impl Telling {
    fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        }
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.1..=1e6).contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        _ => Err("expected seconds, from 0.1 to 1000000".to_owned()),
    }
}

/// Runs the pipeline and prints the summary.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let mut pipeline = Pipeline::load(
        super::pipeline_file(args.file.as_ref(), args.pipeline.as_ref()),
        args.host.as_deref(),
    )?;
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
    if args.force {
        replace_files(&mut pipeline);
    } else {
        keep_files(&pipeline, host)?;
    }
    if let Some(verdict) = doctor::no_shared_memory() {
        let problem = Problem::new(verdict.found).help(verdict.remedy.unwrap_or_default());
        return Err(Failure::Rejected(problem.into()));
    }
    let links = plan::links(&pipeline);
    let care = Care {
        expect_data: args.expect_data,
        for_data: None,
        verbosity: args.telling.verbosity(),
    };
    let summary = supervisor::run(&pipeline, &links, host, care)?;
    let text = if args.json {
        serde_json::to_string_pretty(&summary).context("cannot encode the summary")?
    } else {
        summary.table()
    };
    out.print(&text)?;
    if !args.json {
        out.print(&written(&summary))?;
    }
    Ok(summary.exit())
}

/// Lets all recorders replace files.
fn replace_files(pipeline: &mut Pipeline) {
    for stage in &mut pipeline.stages {
        if let Some(config) = stage.settings.get_mut::<tauscope_record::Config>() {
            config.existing = Existing::Replace;
        }
    }
}

/// Fails if a recorder on `host` would have to replace a file.
fn keep_files(pipeline: &Pipeline, host: Option<&str>) -> Result<(), Failure> {
    let mut report = Report::default();
    let here = |stage: &&Stage| host.is_none() || stage.host.as_deref() == host;
    for stage in pipeline.stages.iter().filter(here) {
        let Some(config) = stage.settings.get::<tauscope_record::Config>() else {
            continue;
        };
        if config.existing == Existing::Replace {
            continue;
        }
        let cell = stage.cells.first().map_or("", String::as_str);
        for file in config.in_the_way(cell) {
            let title = format!("`{}` would replace {}", stage.name, file.display());
            report.push(Problem::new(title).help(
                "put `{date}`, `{time}` or `{n}` into the name, or replace the file with --force",
            ));
        }
    }
    Ok(report.into_result(())?)
}

/// Lists the files that this host's recorders have completed, and how to view them.
fn written(summary: &Summary) -> String {
    let mut lines = Vec::new();
    for stage in summary.stages.iter().filter(|stage| !stage.failed) {
        for path in &stage.files {
            let Ok(file) = path.metadata() else { continue };
            let megabytes = file.len() as f64 * 1e-6;
            lines.push(format!("wrote {} ({megabytes:.1} MB)", path.display()));
        }
        let before = stage
            .files_completed
            .saturating_sub(stage.files.len() as u64);
        if before > 0 {
            lines.push(format!("and {before} files before"));
        }
        let is_picture = |path: &&PathBuf| path.extension().is_some_and(|kind| kind == "rrd");
        if let Some(path) = stage.files.iter().find(is_picture) {
            let version = tauscope_record::rerun_version();
            let path = path.display();
            lines.push(format!(
                "see it: pip install rerun-sdk=={version} && rerun {path}"
            ));
        }
    }
    lines.join("\n")
}
