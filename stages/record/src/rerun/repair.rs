//! A picture that a dead recorder left unfinished: what can be read of it becomes a whole one.

use std::fs::{self, File, OpenOptions};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use rerun::external::re_log_encoding::DecoderApp;
use tauscope_archive::whole_file::{self, Existing};

use super::file::{PictureFile, failed};
use crate::error::RecordError;

/// Repairs `part`, what a dead recorder left as `a.rrd.part`, to `a.rrd`, or to the first of `a.1.rrd`, ... that is free.
/// `part` is removed then, or, where more than its torn end cannot be read, becomes `a.rrd.damaged`. Nothing where
/// somebody writes it, or nothing is in it.
///
/// # Errors
/// If no picture is in it, or the new file cannot be written; `part` stays then.
pub(crate) fn repair_in_place(part: &Path) -> Result<Option<PathBuf>, RecordError> {
    let held = File::open(part).map_err(|error| failed(part, &error))?;
    if held.try_lock().is_err() {
        return Ok(None);
    }
    let reader = BufReader::new(held);
    let mut messages = DecoderApp::decode_eager(reader)
        .map_err(|error| failed(part, &error))?
        .peekable();
    if messages.peek().is_none() {
        // Killed before anything of it was written.
        settle(part, false)?;
        return Ok(None);
    }
    let path = part.with_extension("");
    let mut work = path.with_extension("repairing.rrd").into_os_string();
    work.push(".part");
    let anew = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .clone();
    let mut file = PictureFile::begin(&path, work.into(), Existing::Keep, &anew)?;
    let mut is_damaged = false;
    for message in messages {
        // The torn end is silent: what lacks a part of itself is no message yet.
        let Ok(message) = message else {
            is_damaged = true;
            break;
        };
        file.write(&message)?;
    }
    let path = file.finish()?;
    settle(part, is_damaged)?;
    Ok(Some(path))
}

/// What could be read of `part` is in another file.
fn settle(part: &Path, is_damaged: bool) -> Result<(), RecordError> {
    let settled = if is_damaged {
        whole_file::set_damaged_aside(part).map(drop)
    } else {
        fs::remove_file(part).and_then(|()| whole_file::sync_folder_of(part))
    };
    settled.map_err(|error| failed(part, &error))
}
