//! Which recordings a path means, and on which files they depend.

use std::path::{Path, PathBuf};

use crate::error::ArchiveError;
use crate::lerobot::{self, Place};

/// The recordings at `path`: the episodes of a LeRobot data set, or `path` itself.
///
/// # Errors
/// If the data set does not tell its episodes.
pub fn recordings_at(path: &Path) -> Result<Vec<PathBuf>, ArchiveError> {
    match lerobot::locate(path)? {
        Some(Place::Set(root)) => {
            let numbers = lerobot::episodes(&root)?.into_iter();
            Ok(numbers.map(|number| lerobot::name(&root, number)).collect())
        }
        _ => Ok(vec![path.to_owned()]),
    }
}

/// Whether there may be a recording at `path`: an episode of a LeRobot data set has a path, but perhaps no file of that
/// path.
pub fn is_there(path: &Path) -> bool {
    path.exists() || matches!(lerobot::locate(path), Ok(Some(_)))
}

/// The files on which the recording at `path` depends: itself, the files of its folder in the order of their names, or
/// the rows of an episode and what says what they are.
///
/// # Errors
/// If a folder cannot be read, or has no such episode.
pub fn source_files(path: &Path) -> Result<Vec<PathBuf>, ArchiveError> {
    if let Some(place) = lerobot::locate(path)? {
        let (root, number) = place.one()?;
        return lerobot::files(&root, number);
    }
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.map_err(ArchiveError::io(path))?.into_iter();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.retain(|path| path.is_file());
    files.sort();
    Ok(files)
}
