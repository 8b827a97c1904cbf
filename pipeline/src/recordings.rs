//! Expansion of user-given paths to recordings.

use std::path::PathBuf;

use tauscope_archive::recordings_at;

use crate::report::{Problem, Report};

/// Returns the paths, with each LeRobot data set replaced by its episodes.
///
/// # Errors
/// If the episodes of a data set cannot be read.
pub fn expand(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Report> {
    let mut all = Vec::with_capacity(paths.len());
    let mut report = Report::default();
    for path in paths {
        match recordings_at(path) {
            Ok(recordings) => all.extend(recordings),
            Err(error) => report.push(Problem::new(error.to_string())),
        }
    }
    report.into_result(all)
}
