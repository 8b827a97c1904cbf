//! Which recordings the paths mean that people give.

use std::path::PathBuf;

use tauscope_archive::recordings_at;

use crate::report::{Problem, Report};

/// Every path, and in the place of a LeRobot data set its episodes.
///
/// # Errors
/// If a data set does not tell its episodes.
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
