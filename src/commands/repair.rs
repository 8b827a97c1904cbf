//! `tauscope repair`.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::json;
use tauscope_archive::{
    Damage, RepairError, Repaired, repair, repair_folder, repaired_folder_path, repaired_path,
};

use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Rebuild an archive whose writer died, or whose end was cut off: all that can be read of it, with a complete index,
/// in a new file. Several pieces become one file, a folder becomes a bag.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The MCAP file, also one that ends in `.part`; several, which are joined in the order of their
    /// times; or a folder of them.
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// The new file or folder; by default `<name>.repaired.mcap` or `<folder>.repaired` next to the original.
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Rebuilds the archive.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    match &args.recordings[..] {
        [folder] if folder.is_dir() => of_folder(args, folder, out),
        pieces => {
            if let Some(folder) = pieces.iter().find(|piece| piece.is_dir()) {
                let folder = folder.display();
                let title = format!("{folder} is a folder: give one folder, or files to be joined");
                return Err(Failure::rejected(title));
            }
            of_pieces(args, pieces, out)
        }
    }
}

fn of_pieces(args: &Args, pieces: &[PathBuf], out: &mut Output) -> Result<Exit, Failure> {
    let to = args.out.clone().unwrap_or_else(|| {
        let first = pieces.first().map_or(Path::new(""), PathBuf::as_path);
        repaired_path(first)
    });
    let repaired = repair(pieces, &to).map_err(failure)?;
    let text = if args.json {
        encoded(&as_json(&repaired))?
    } else {
        in_words(&repaired, pieces.len() > 1).join("\n")
    };
    out.print(&text)?;
    Ok(Exit::from_loss(loses_data(&repaired.damage)))
}

fn of_folder(args: &Args, folder: &Path, out: &mut Output) -> Result<Exit, Failure> {
    let to = (args.out.clone()).unwrap_or_else(|| repaired_folder_path(folder));
    let bag = repair_folder(folder, &to).map_err(failure)?;
    let text = if args.json {
        encoded(&json!({
            "folder": bag.path,
            "files": bag.files.iter().map(as_json).collect::<Vec<_>>(),
            "damage": bag.damage,
        }))?
    } else {
        let files = bag.files.iter().flat_map(|file| in_words(file, true));
        let damage = bag.damage.iter().map(damage_in_words);
        files.chain(damage).collect::<Vec<_>>().join("\n")
    };
    out.print(&text)?;
    let lost = |file: &Repaired| loses_data(&file.damage);
    Ok(Exit::from_loss(
        loses_data(&bag.damage) || bag.files.iter().any(lost),
    ))
}

fn failure(error: RepairError) -> Failure {
    match error {
        RepairError::Write(_) => Failure::Failed(error.into()),
        _ => Failure::rejected(error.to_string()),
    }
}

fn loses_data(damage: &[Damage]) -> bool {
    damage.iter().any(Damage::loses_data)
}

fn encoded(value: &serde_json::Value) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(value).context("cannot encode the result")?)
}

fn as_json(repaired: &Repaired) -> serde_json::Value {
    json!({
        "file": repaired.written.path,
        "from": repaired.from,
        "messages": repaired.written.messages,
        "bytes": repaired.written.bytes,
        "damage": repaired.damage,
    })
}

/// Describes a repaired file: its size, its sources if `told`, and the damage.
fn in_words(repaired: &Repaired, told: bool) -> Vec<String> {
    let written = &repaired.written;
    let mut line = format!("{}: {} messages", written.path.display(), written.messages);
    if told {
        let name = |path: &PathBuf| path.display().to_string();
        let from: Vec<String> = repaired.from.iter().map(name).collect();
        line += &format!(", from {}", from.join(", "));
    }
    let damage = repaired.damage.iter().map(damage_in_words);
    std::iter::once(line).chain(damage).collect()
}

fn damage_in_words(damage: &Damage) -> String {
    format!("damage: {damage}")
}
