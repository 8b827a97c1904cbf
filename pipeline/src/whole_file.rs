//! Files that are there whole or not at all.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Writes `content` beside `path`, with `.part` at its end, and moves it there once it is whole.
///
/// # Errors
/// If the file system refuses.
pub fn write(path: &Path, content: &[u8]) -> std::io::Result<()> {
    let mut part: OsString = path.into();
    part.push(".part");
    let part = PathBuf::from(part);
    std::fs::write(&part, content)?;
    std::fs::rename(&part, path)
}
