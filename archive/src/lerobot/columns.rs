//! Columns file next to a data set. It describes columns whose names do not identify their quantity or joint.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::csv_file::Columns;
use crate::error::ArchiveError;
use crate::lerobot_error::{LerobotError, LerobotProblem};

/// Extension of the columns file of a data set: `DATASET.columns.yaml`, as for a CSV table.
const BESIDE: &str = "columns.yaml";

/// Contents of the columns file; every key is optional.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ColumnsFile {
    /// Joint names of the robot, in the order of the positions.
    pub(super) joints: Option<Vec<String>>,
    pub(super) position: Option<Columns>,
    pub(super) velocity: Option<Columns>,
    pub(super) effort: Option<Columns>,
    /// Whether positions and velocities are in degrees.
    pub(super) degrees: Option<bool>,
}

impl ColumnsFile {
    /// Returns the path of the columns file of the data set in the folder `root`, whether or not the file exists.
    pub(super) fn path(root: &Path) -> PathBuf {
        let named = root.file_name().map(|_| root.to_owned());
        // The paths `.` and `..` have no file name until they are resolved.
        let root = named.or_else(|| root.canonicalize().ok());
        let root = root.unwrap_or_else(|| PathBuf::from("dataset"));
        let mut name = root.file_name().unwrap_or_default().to_owned();
        name.push(".");
        name.push(BESIDE);
        root.with_file_name(name)
    }

    /// Reads the columns file, if it exists.
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
