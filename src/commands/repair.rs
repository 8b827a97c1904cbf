//! `tauscope repair`.

use std::path::PathBuf;

use anyhow::Context;
use serde_json::json;
use tauscope_archive::{Damage, RepairError, repair, repaired_path};

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Rebuild an archive whose writer died, or whose end was cut off: all that can be read of it, with
/// a sound index, in a new file.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The MCAP file; one that ends in `.part`, too.
    recording: PathBuf,
    /// The new file; by default `<name>.repaired.mcap` beside it.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Machine-readable.
    #[arg(long)]
    json: bool,
}

/// Rebuilds it.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let file = args
        .out
        .clone()
        .unwrap_or_else(|| repaired_path(&args.recording));
    let repaired = repair(&args.recording, &file).map_err(|error| match error {
        RepairError::Write(_) => Failure::Failed(error.into()),
        _ => Failure::rejected(error.to_string()),
    })?;
    let text = if args.json {
        let value = json!({
            "file": repaired.written.path,
            "messages": repaired.written.messages,
            "bytes": repaired.written.bytes,
            "damage": repaired.damage,
        });
        serde_json::to_string_pretty(&value).context("cannot encode the result")?
    } else {
        let written = &repaired.written;
        let mut lines = vec![format!(
            "{}: {} messages",
            written.path.display(),
            written.messages
        )];
        lines.extend(
            repaired
                .damage
                .iter()
                .map(|damage| format!("damage: {damage}")),
        );
        lines.join("\n")
    };
    out.print(&text)?;
    Ok(Exit::from_loss(
        repaired.damage.iter().any(Damage::loses_data),
    ))
}
