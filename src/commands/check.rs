//! `tauscope check`.

use std::path::PathBuf;

use clap::ValueEnum;
use serde_json::json;
use tauscope_pipeline::files::FileKind;
use tauscope_pipeline::pipeline::Pipeline;

use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::plan;

/// Check a pipeline file, and print its stages, hosts and links; or check another kind of file.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The pipeline file, or another one with `--kind`; by default `pipeline.yaml`.
    #[arg(conflicts_with = "pipeline")]
    file: Option<PathBuf>,
    /// The pipeline file, given as an option as for `replay`.
    #[arg(long, value_name = "FILE")]
    pipeline: Option<PathBuf>,
    /// Kind of the file. Files other than pipelines are checked against their schema: keys, types and enumerated
    /// values.
    #[arg(long, value_enum, default_value_t)]
    kind: FileKind,
    /// Look for recordings and programs for the stages of this host only.
    #[arg(long, value_name = "NAME")]
    host: Option<String>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Short for `--format json`.
    #[arg(long, conflicts_with = "format")]
    json: bool,
}

impl Args {
    fn format(&self) -> Format {
        if self.json { Format::Json } else { self.format }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Format {
    /// Tables.
    #[default]
    Table,
    /// A Mermaid flowchart.
    Mermaid,
    /// A Graphviz digraph.
    Dot,
    /// JSON.
    Json,
}

/// Checks the file and prints the result. In JSON, errors are part of the result: an empty list if there are none.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let outcome = check(args, out);
    if let Err(Failure::Rejected(report)) = &outcome
        && args.format() == Format::Json
    {
        let text = serde_json::to_string_pretty(&report.json());
        out.print(&text.map_err(anyhow::Error::from)?)?;
        return Ok(Exit::Rejected);
    }
    outcome
}

fn check(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let file = super::pipeline_file(args.file.as_ref(), args.pipeline.as_ref());
    if args.kind != FileKind::Pipeline {
        args.kind.check_shape(file)?;
        if args.format() == Format::Json {
            out.print("{\n  \"errors\": []\n}")?;
        }
        return Ok(Exit::Done);
    }
    let pipeline = Pipeline::load(file, args.host.as_deref())?;
    let host = args.host.as_deref();
    let warnings = pipeline.warnings(host).into_iter();
    for warning in warnings.chain(pipeline.rate_warnings(host)) {
        out.say(&format!("warning: {warning}"));
    }
    let links = plan::links(&pipeline);
    let text = match args.format() {
        Format::Table => plan::table(&pipeline, &links),
        Format::Mermaid => plan::mermaid(&pipeline, &links),
        Format::Dot => plan::dot(&pipeline, &links),
        Format::Json => {
            let text = serde_json::to_string_pretty(&json(&pipeline, &links));
            text.map_err(anyhow::Error::from)?
        }
    };
    out.print(&text)?;
    Ok(Exit::Done)
}

fn json(pipeline: &Pipeline, links: &[plan::Link]) -> serde_json::Value {
    let name = |index: usize| &pipeline.stages[index].name;
    let stages = pipeline.stages.iter().map(|stage| {
        json!({
            "name": stage.name,
            "is": stage.role.kind.key,
            "host": stage.host,
            "process": stage.process,
            "cells": stage.cells,
            "inputs": stage.inputs.iter().map(|&input| name(input)).collect::<Vec<_>>(),
        })
    });
    let links = links.iter().map(|link| {
        json!({
            "from": name(link.from),
            "to": name(link.to),
            "stream": link.stream,
            "type": link.carries.type_name(),
            "over": link.over,
            "keep": plan::keep_word(link.keep),
        })
    });
    json!({
        "errors": [],
        "stages": stages.collect::<Vec<_>>(),
        "hosts": pipeline.hosts,
        "links": links.collect::<Vec<_>>(),
    })
}
