//! Sources of a query, from its paths: recordings, manifests of them, or results.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tauscope_archive::is_there;
use tauscope_pipeline::recordings;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::results::{Manifest, parquet_files};

use crate::scan::Listed;

/// Recordings and results of a query.
#[derive(Debug, Default)]
pub struct Sources {
    /// Recordings, each once.
    pub recordings: Vec<Listed>,
    /// Parquet files of results.
    pub results: Vec<PathBuf>,
}

impl Sources {
    /// Sorts paths and patterns: a `.parquet` file, or a folder that contains some, is a result; a `.jsonl` file is a
    /// manifest; everything else is a recording.
    ///
    /// # Errors
    /// For each path that does not exist.
    pub fn of(paths: &[PathBuf]) -> Result<Self, Report> {
        let mut sources = Self::default();
        let mut report = Report::default();
        for path in expand(paths, &mut report) {
            if let Err(problem) = sources.add(&path) {
                report.append(problem);
            }
        }
        let mut seen = BTreeSet::new();
        sources
            .recordings
            .retain(|one| seen.insert(one.path.clone()));
        report.into_result(sources)
    }

    fn add(&mut self, path: &Path) -> Result<(), Report> {
        let episodes = recordings::expand(&[path.to_owned()])?;
        if episodes != [path] {
            for episode in episodes {
                self.recordings.push(listed(&episode)?);
            }
            return Ok(());
        }
        let ends = |ending| path.extension().is_some_and(|of| of == ending);
        if ends("parquet") {
            self.results.push(absolute(path)?);
        } else if ends("jsonl") {
            for wanted in Manifest::load(path)?.wanted {
                self.recordings.push(Listed {
                    path: absolute(&wanted.recording)?,
                    bytes: wanted.bytes,
                });
            }
        } else if path.is_dir() && !path.join("metadata.yaml").exists() {
            let files =
                parquet_files(path).map_err(|error| Problem::of_file(path, error.to_string()))?;
            if files.is_empty() {
                let problem = Problem::of_file(path, "the folder holds no result");
                return Err(problem
                    .help(format!(
                        "recordings are named by a pattern: '{}/*.mcap'",
                        path.display()
                    ))
                    .into());
            }
            for file in files {
                self.results.push(absolute(&file)?);
            }
        } else {
            self.recordings.push(listed(path)?);
        }
        Ok(())
    }
}

/// The recordings of a pattern.
///
/// # Errors
/// If there is none, or a file is not a recording.
pub fn recordings(pattern: &str) -> Result<Vec<Listed>, Report> {
    let sources = Sources::of(&[PathBuf::from(pattern)])?;
    if sources.recordings.is_empty() {
        return Err(Problem::new(format!(
            "`{pattern}` names results, and replay takes recordings"
        ))
        .into());
    }
    Ok(sources.recordings)
}

fn listed(path: &Path) -> Result<Listed, Report> {
    let failed = |error: std::io::Error| Problem::of_file(path, error.to_string());
    // An episode of a data set has no file of its own.
    let bytes = if path.is_dir() || !path.exists() {
        0
    } else {
        path.metadata().map_err(failed)?.len()
    };
    Ok(Listed {
        path: absolute(path)?,
        bytes,
    })
}

/// Makes a path absolute, so that a plan does not depend on the working folder.
fn absolute(path: &Path) -> Result<PathBuf, Report> {
    Ok(std::path::absolute(path).map_err(|error| Problem::of_file(path, error.to_string()))?)
}

/// Expands the patterns; the matches of each are sorted by name.
fn expand(paths: &[PathBuf], report: &mut Report) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in paths {
        if is_there(path) {
            found.push(path.clone());
            continue;
        }
        let text = path.to_string_lossy();
        let before = found.len();
        match glob::glob(&text) {
            Ok(paths) => found.extend(paths.filter_map(Result::ok)),
            Err(error) => {
                report.push(Problem::new(format!("`{text}` is no pattern: {error}")));
                continue;
            }
        }
        if found.len() == before {
            let problem = Problem::new(format!("there is no file `{text}`"));
            report.push(
                problem.help("recordings, manifests and folders of results stand behind the query"),
            );
        }
    }
    found
}
