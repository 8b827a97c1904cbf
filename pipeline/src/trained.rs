//! Files of trained detectors: written after training, read before the stage is built.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tauscope_archive::whole_file::{self, Existing};
use tauscope_detect::{Config, LearnError, Lessons, Setup, Trained, TrainedError};

/// File extension.
const ENDING: &str = "safetensors";

/// Error while reading a trained detector.
#[derive(Debug, thiserror::Error)]
pub enum TrainedFileError {
    /// An unreadable file.
    #[error("the trained detector {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file that is no trained detector.
    #[error("{}: {source}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Why.
        source: TrainedError,
    },
}

/// Reads the trained detectors that `config` names into `setup`.
///
/// # Errors
/// If a file cannot be read.
pub fn read(config: &Config, setup: &mut Setup) -> Result<(), TrainedFileError> {
    for (detector, path) in config.clone().trained_files_mut() {
        let failed = |source| TrainedFileError::Read {
            path: path.clone(),
            source,
        };
        let bytes = std::fs::read(&*path).map_err(failed)?;
        let trained = Trained::from_bytes(&bytes).map_err(|source| TrainedFileError::Format {
            path: path.clone(),
            source,
        })?;
        setup.trained.insert(detector.to_owned(), Arc::new(trained));
    }
    Ok(())
}

/// Writes a detector trained on `lessons` to `path` plus the file extension, and returns the full path.
///
/// # Errors
/// If it cannot be written.
pub fn write(
    path: &Path,
    lessons: &Lessons<'_>,
    mut trained: Trained,
) -> Result<PathBuf, LearnError> {
    let provenance = trained.provenance_mut();
    let version = env!("CARGO_PKG_VERSION").to_owned();
    provenance.insert("tauscope".to_owned(), version);
    let names = lessons.train.iter().map(|lesson| lesson.name.as_str());
    let names: Vec<&str> = names.collect();
    provenance.insert("train".to_owned(), names.join(", "));

    let mut name = path.to_owned().into_os_string();
    name.push(".");
    name.push(ENDING);
    let path = PathBuf::from(name);
    let write = || -> Result<(), Box<dyn std::error::Error>> {
        Ok(whole_file::write(
            &path,
            trained.to_bytes()?,
            Existing::Replace,
        )?)
    };
    match write() {
        // Absolute, because the path is copied into pipeline files in other folders.
        Ok(()) => Ok(std::path::absolute(&path).unwrap_or(path)),
        Err(error) => Err(LearnError::NotKept {
            path,
            reason: error.to_string(),
        }),
    }
}
