//! The recordings at a path, and the files on which they depend.

use std::path::{Path, PathBuf};

use crate::error::ArchiveError;
use crate::lerobot::{self, Place};

/// Returns the recordings at `path`: the episodes of a LeRobot data set of several, or `path` itself.
///
/// # Errors
/// If the data set does not list its episodes.
pub fn recordings_at(path: &Path) -> Result<Vec<PathBuf>, ArchiveError> {
    match lerobot::locate(path)? {
        Some(Place::Set(root)) => {
            let numbers = lerobot::episodes(&root)?;
            // A single episode has the name of the data set.
            if numbers.len() == 1 {
                return Ok(vec![path.to_owned()]);
            }
            let numbers = numbers.into_iter();
            Ok(numbers.map(|number| lerobot::name(&root, number)).collect())
        }
        _ => Ok(vec![path.to_owned()]),
    }
}

/// Returns the name of a recording: the file name without extension, the folder name, or the data set with the number
/// of the episode, `DATASET_episode_000003`.
pub fn name_of(path: &Path) -> String {
    if let Ok(Some(Place::Episode(root, number))) = lerobot::locate(path) {
        let root = root.canonicalize().unwrap_or(root);
        let set = root.file_name().unwrap_or_default().to_string_lossy();
        return format!("{set}_episode_{number:06}");
    }
    let name = if path.is_dir() {
        path.file_name()
    } else {
        path.file_stem()
    };
    let name = name.map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "recording".to_owned())
}

/// Returns whether there may be a recording at `path`. An episode of a LeRobot data set has a path, but not
/// necessarily a file of that name.
pub fn is_there(path: &Path) -> bool {
    path.exists() || matches!(lerobot::locate(path), Ok(Some(_)))
}

/// Files on which a recording, or another file, depends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sources {
    /// The file itself, the files of the folder in the order of their names, or the rows of an episode and their
    /// descriptions.
    pub files: Vec<PathBuf>,
    /// The number of the episode of a LeRobot data set, because a file may hold several.
    pub episode: Option<u64>,
}

/// Returns the files on which the recording, or another file, at `path` depends.
///
/// # Errors
/// If a folder cannot be read, or has no such episode.
pub fn sources(path: &Path) -> Result<Sources, ArchiveError> {
    if let Some(place) = lerobot::locate(path)? {
        let (root, number) = place.one()?;
        return Ok(Sources {
            files: lerobot::files(&root, number)?,
            episode: Some(number),
        });
    }
    if !path.is_dir() {
        return Ok(Sources {
            files: vec![path.to_owned()],
            episode: None,
        });
    }
    let entries = std::fs::read_dir(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.map_err(ArchiveError::io(path))?.into_iter();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.retain(|path| path.is_file());
    files.sort();
    Ok(Sources {
        files,
        episode: None,
    })
}
