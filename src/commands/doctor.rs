//! `tauscope doctor`.

use std::path::PathBuf;

use serde_json::json;
use tauscope_pipeline::pipeline::Pipeline;

use crate::doctor::{Level, Verdict, facts, verdicts};
use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Look for what on this machine would keep a pipeline from running, and say what to do about it.
///
/// Exit code 0 if nothing would, 1 if something would.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A pipeline file: its folders, ports, peers and certificates are looked at, too.
    #[arg(long, value_name = "FILE")]
    pipeline: Option<PathBuf>,
    /// Which of the file's hosts this is, where it names several.
    #[arg(long, value_name = "NAME", requires = "pipeline")]
    host: Option<String>,
    /// Machine-readable.
    #[arg(long)]
    json: bool,
}

/// Looks, and prints a line for each thing.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let host = args.host.as_deref();
    let pipeline = args.pipeline.as_ref();
    // A recorder's folder that cannot be written to is one of its errors: told as `check` tells it.
    let pipeline = pipeline
        .map(|path| Pipeline::load(path, host))
        .transpose()?;
    let verdicts = verdicts::all(&facts::read(pipeline.as_ref(), host));
    let text = if args.json {
        let text = serde_json::to_string_pretty(&json!({ "checks": verdicts }));
        text.map_err(anyhow::Error::from)?
    } else {
        table(&verdicts)
    };
    out.print(&text)?;
    let worst = verdicts.iter().map(|verdict| verdict.level).max();
    Ok(if worst == Some(Level::Error) {
        Exit::Failed
    } else {
        Exit::Done
    })
}

fn table(verdicts: &[Verdict]) -> String {
    let mut lines = Vec::new();
    for verdict in verdicts {
        let (word, check, found) = (verdict.level.word(), verdict.check, &verdict.found);
        lines.push(format!("{word:<8} {check}: {found}"));
        if let Some(remedy) = &verdict.remedy {
            lines.push(format!("{:<8} = help: {remedy}", ""));
        }
    }
    lines.join("\n")
}
