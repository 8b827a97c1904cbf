//! The file beside a data set that says what its names do not.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::csv_file::Columns;
use crate::error::ArchiveError;
use crate::lerobot_error::{LerobotError, LerobotProblem};

/// Ending of the file beside a data set `DATASET`: `DATASET.columns.yaml`, as beside a table.
const BESIDE: &str = "columns.yaml";

/// What it says; all of it may be left out.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ColumnsFile {
    /// The robot's names of the joints, in the order of the positions.
    pub(super) joints: Option<Vec<String>>,
    pub(super) position: Option<Columns>,
    pub(super) velocity: Option<Columns>,
    pub(super) effort: Option<Columns>,
    /// Whether positions and velocities are in degrees.
    pub(super) degrees: Option<bool>,
}

impl ColumnsFile {
    /// Where the one of the data set in the folder `root` lies, there or not.
    pub(super) fn path(root: &Path) -> PathBuf {
        let named = root.file_name().map(|_| root.to_owned());
        // `.` and `..` have a name once they are followed.
        let root = named.or_else(|| root.canonicalize().ok());
        let root = root.unwrap_or_else(|| PathBuf::from("dataset"));
        let mut name = root.file_name().unwrap_or_default().to_owned();
        name.push(".");
        name.push(BESIDE);
        root.with_file_name(name)
    }

    /// Reads it, if it is there.
    pub(super) fn beside(root: &Path) -> Result<Self, ArchiveError> {
        let path = Self::path(root);
        if !path.exists() {
            return Ok(Self::default());
        }
        let text = std::fs::read_to_string(&path).map_err(ArchiveError::io(&path))?;
        serde_saphyr::from_str(&text).map_err(|error| {
            let problem = LerobotProblem::Broken(error.to_string());
            LerobotError::new(&path, problem).into()
        })
    }
}
