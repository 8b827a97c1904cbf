//! Selection of the recordings for a nightly measurement.

use std::path::{Path, PathBuf};

use tauscope_pipeline::recordings;
use tauscope_pipeline::report::{Problem, Report};

use super::open;

/// Maximum number of recordings in a nightly measurement.
/// Resolution: twelve spread over a day cover the cold and the warm robot.
const MOST: usize = 12;
/// Maximum duration of a recording that is measured, from its start; bounds the computing time \[s\].
/// Resolution: two minutes contain several cycles of most programs.
pub const LONGEST_S: f64 = 120.0;
/// Pause between two recordings above which the robot is assumed to have been switched off \[ns\].
/// Resolution: a joint cools down within an hour.
const PAUSE_NS: i64 = 3_600_000_000_000;

/// Recordings selected for a nightly measurement.
#[derive(Debug, PartialEq)]
pub struct Choice {
    /// The files, oldest first.
    pub recordings: Vec<PathBuf>,
    /// Time since the robot was started, averaged over the recordings \[h\]; `None` if the files do not show the
    /// start.
    pub hours_since_start: Option<f64>,
}

/// Selects at most twelve evenly spaced recordings among the files in `paths` and the MCAP files in its folders.
/// Eligible are those that began at most `hours` before the newest, and files in `paths` of any age.
///
/// # Errors
/// If a file in `paths` cannot be opened, or there is no recording to measure.
pub fn choose(paths: &[PathBuf], hours: f64) -> Result<Choice, Report> {
    let mut report = Report::default();
    let mut all: Vec<(PathBuf, i64, i64)> = Vec::new();
    let mut take = |path: &Path, report: &mut Report| match open(path) {
        Ok(archive) => {
            let begin = archive.start_ns().unwrap_or(0);
            all.push((path.to_owned(), begin, archive.end_ns().unwrap_or(begin)));
        }
        Err(problems) => report.append(problems),
    };
    let paths = &recordings::expand(paths)?;
    for path in paths {
        let is_bag = path.join("metadata.yaml").exists();
        if !path.is_dir() || is_bag {
            take(path, &mut report);
            continue;
        }
        let found = in_folder(path)?;
        for file in &found {
            // Errors are ignored: a file that a recorder is writing cannot be opened yet.
            let mut aside = Report::default();
            take(file, &mut aside);
        }
    }
    report.into_result(())?;
    all.sort_by(|a, b| a.1.cmp(&b.1).then_with(|| a.0.cmp(&b.0)));
    let newest = all.last().map_or(0, |(_, begin, _)| *begin);
    let is_named = |path: &PathBuf| paths.contains(path);
    // Time from the robot's start to each recording \[h\]. A recording after a long pause marks a start.
    let mut since = Vec::with_capacity(all.len());
    let mut run: Option<(i64, i64)> = None;
    for (_, begin, end) in &all {
        let started = run
            .filter(|(_, last)| begin - last < PAUSE_NS)
            .map_or(*begin, |run| run.0);
        run = Some((started, *end));
        since.push((begin - started) as f64 / 3.6e12);
    }
    let of_night: Vec<usize> = (0..all.len())
        .filter(|&at| (newest - all[at].1) as f64 <= hours * 3.6e12 || is_named(&all[at].0))
        .collect();
    let named = of_night.iter().filter(|&&at| is_named(&all[at].0)).count();
    let most = MOST.max(named);
    let step = of_night.len().div_ceil(most).max(1);
    let chosen: Vec<usize> = of_night.into_iter().step_by(step).collect();
    if chosen.is_empty() {
        let problem = Problem::new("there is no recording to measure");
        return Err(problem
            .help("name MCAP files, or the folder that the recorder writes to")
            .into());
    }
    // A single recording does not show when the robot was started.
    let hours_since_start = (all.len() > 1)
        .then(|| chosen.iter().map(|&at| since[at]).sum::<f64>() / chosen.len() as f64);
    let recordings = chosen.into_iter().map(|at| all[at].0.clone()).collect();
    Ok(Choice {
        recordings,
        hours_since_start,
    })
}

/// Returns the recordings in a folder, without its subfolders.
fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, Report> {
    let failed = |error: std::io::Error| Problem::of_file(folder, format!("cannot read: {error}"));
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|ending| ending == "mcap") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}
