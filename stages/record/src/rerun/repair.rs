//! Repair of a picture that a crashed recorder left unfinished.

use std::fs::{self, File, OpenOptions};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use rerun::external::re_log_encoding::DecoderApp;
use tauscope_archive::whole_file::{self, Existing};

use super::file::{PictureFile, failed};
use crate::error::RecordError;

/// Repairs `part`, a file `a.rrd.part` of a crashed recorder, to `a.rrd` or to the first unused name of `a.1.rrd`,
/// ... Then `part` is removed. If more than its torn end is unreadable, it is renamed to `a.rrd.damaged` instead.
/// Returns `None` if a process is writing the file or if it is empty.
///
/// # Errors
/// If it contains no picture, or the new file cannot be written; then `part` is kept.
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
        // The recorder was killed before it wrote anything.
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
        // A torn end gives no error: the decoder ignores an incomplete message.
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

/// Removes `part`, or renames it if it is damaged, after its readable content was written to another file.
fn settle(part: &Path, is_damaged: bool) -> Result<(), RecordError> {
    let settled = if is_damaged {
        whole_file::set_damaged_aside(part).map(drop)
    } else {
        fs::remove_file(part).and_then(|()| whole_file::sync_folder_of(part))
    };
    settled.map_err(|error| failed(part, &error))
}
