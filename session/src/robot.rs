//! A robot's URDF, read from its file.

use std::path::Path;

use tauscope_archive::file_kind;
use tauscope_dynamics::{Model, ModelError};

/// Why there is no robot.
#[derive(Debug, thiserror::Error)]
pub enum UrdfError {
    /// The file cannot be read as text.
    #[error("cannot read the URDF: {0}")]
    Unreadable(String),
    /// It is no robot that the algorithms can work on.
    #[error("cannot use the URDF: {0}")]
    Unusable(#[from] ModelError),
}

/// Longest file \[bytes\].
/// Resolution: bounds memory.
const MAX_BYTES: u64 = 16 << 20;

/// The text and the robot at `path`.
///
/// # Errors
/// If there is no such file, it is of another kind, or the robot cannot be used.
pub fn read(path: &Path) -> Result<(String, Model), UrdfError> {
    let large = std::fs::metadata(path).map_or(0, |file| file.len());
    if large > MAX_BYTES {
        let path = path.display();
        let title = format!("{path} has {large} bytes, the limit is {MAX_BYTES}");
        return Err(UrdfError::Unreadable(title));
    }
    let text = std::fs::read_to_string(path).map_err(|error| {
        let kind = file_kind(path);
        UrdfError::Unreadable(match (error.kind(), kind) {
            (std::io::ErrorKind::NotFound, _) => format!("there is no file {}", path.display()),
            (_, Some(kind)) => format!("{} is {kind}", path.display()),
            (_, None) => format!("{}: {error}", path.display()),
        })
    })?;
    let model = Model::from_urdf(&text)?;
    Ok((text, model))
}
