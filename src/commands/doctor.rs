//! `tauscope doctor`.

use std::path::PathBuf;

use serde_json::json;
use tauscope_pipeline::pipeline::Pipeline;

use crate::doctor::{Level, Verdict, facts, verdicts};
use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Check this machine for anything that would keep a pipeline from running, and suggest remedies.
///
/// Exit code 0 if there is no error, else 1.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A pipeline file, whose folders, ports, peers and certificates are checked, too.
    #[arg(long, value_name = "FILE")]
    pipeline: Option<PathBuf>,
    /// Name of this host in the file, if the file has several.
    #[arg(long, value_name = "NAME", requires = "pipeline")]
    host: Option<String>,
    /// Print the results as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the checks and prints a line for each.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let host = args.host.as_deref();
    let pipeline = args.pipeline.as_ref();
    // Loading rejects a recorder's folder that is not writable, with the same message as `check`.
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
