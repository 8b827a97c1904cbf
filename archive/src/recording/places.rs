//! Which recordings a path means, and on which files they depend.

use std::path::{Path, PathBuf};

use crate::error::ArchiveError;
use crate::lerobot::{self, Place};

/// The recordings at `path`: the episodes of a LeRobot data set of several, or `path` itself.
///
/// # Errors
/// If the data set does not tell its episodes.
pub fn recordings_at(path: &Path) -> Result<Vec<PathBuf>, ArchiveError> {
    match lerobot::locate(path)? {
        Some(Place::Set(root)) => {
            let numbers = lerobot::episodes(&root)?;
            // One of one goes by the name of the data set.
            if numbers.len() == 1 {
                return Ok(vec![path.to_owned()]);
            }
            let numbers = numbers.into_iter();
            Ok(numbers.map(|number| lerobot::name(&root, number)).collect())
        }
        _ => Ok(vec![path.to_owned()]),
    }
}

/// What a recording is called: as its file without the ending, as its folder, or as its data set and its number there,
/// `DATASET_episode_000003`.
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

/// Whether there may be a recording at `path`: an episode of a LeRobot data set has a path, but perhaps no file of that
/// path.
pub fn is_there(path: &Path) -> bool {
    path.exists() || matches!(lerobot::locate(path), Ok(Some(_)))
}

/// On what a recording, or another file, depends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sources {
    /// The file itself, the files of the folder in the order of their names, or the rows of an episode and what says
    /// what they are.
    pub files: Vec<PathBuf>,
    /// The number of the episode of a LeRobot data set: a file may hold several.
    pub episode: Option<u64>,
}

/// On what the recording, or another file, at `path` depends.
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
