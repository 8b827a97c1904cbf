//! `tauscope manifest`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tauscope_archive::is_there;
use tauscope_archive::whole_file::{self, Existing};
use tauscope_pipeline::parallel;
use tauscope_pipeline::recordings;
use tauscope_pipeline::report::{Problem, Report, without_path};
use tauscope_pipeline::results::{Manifest, Wanted};

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::output::Output;
use crate::progress::{Progress, Quiet};

/// List recordings with their hashes in a manifest, for `replay --manifest`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings or patterns of them in quotes: 'archive/**/*.mcap'. Of a rosbag2 bag or a LeRobot
    /// data set, its folder.
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// The manifest: a line of JSON for each recording, with its path relative to this file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// The `ingest` stage that these recordings replace, if the pipeline has several. Manifests can be joined with
    /// `cat`.
    #[arg(long)]
    source: Option<String>,
    /// Number of recordings read in parallel.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
}

/// Reads the recordings and writes the manifest.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let recordings = expand(&args.recordings)?;
    args.force.check_beside([args.out.clone()], &recordings)?;
    let folder = absolute(args.out.parent().unwrap_or(Path::new("")))?;
    let progress = Progress::new(recordings.len(), args.quiet.show(out));
    let numbered = recordings.iter().enumerate().collect();
    let read = parallel::map(usize::from(args.jobs), numbered, |(index, recording)| {
        let wanted = Wanted::of(recording, args.source.as_deref());
        progress.set(index, 1.0);
        wanted
    });
    drop(progress);
    let mut manifest = Manifest::default();
    let mut wrong = Report::default();
    for (recording, wanted) in recordings.iter().zip(read) {
        match wanted {
            Ok(wanted) => manifest.wanted.push(Wanted {
                recording: absolute(&wanted.recording)?,
                ..wanted
            }),
            Err(error) => wrong.push(Problem::of_file(recording, without_path(recording, error))),
        }
    }
    wrong.into_result(())?;
    let text = manifest.to_text(&folder).context("the manifest")?;
    whole_file::write(&args.out, text, Existing::Replace).context("the manifest")?;
    let count = manifest.wanted.len();
    let bytes: u64 = manifest.wanted.iter().map(|one| one.bytes).sum();
    out.say(&format!(
        "{}: {count} recordings, {:.1} GB",
        args.out.display(),
        bytes as f64 * 1e-9
    ));
    Ok(Exit::Done)
}

fn absolute(path: &Path) -> anyhow::Result<PathBuf> {
    std::path::absolute(if path == Path::new("") {
        Path::new(".")
    } else {
        path
    })
    .with_context(|| format!("where {} is", path.display()))
}

/// Returns the recordings, each once; those of a pattern in the order of their names.
fn expand(given: &[PathBuf]) -> Result<Vec<PathBuf>, Report> {
    let mut found = Vec::new();
    let mut report = Report::default();
    for path in given {
        if is_there(path) {
            found.extend(recordings::expand(std::slice::from_ref(path))?);
            continue;
        }
        let text = path.to_string_lossy();
        let before = found.len();
        match glob::glob(&text) {
            Ok(paths) => found.extend(paths.filter_map(Result::ok)),
            Err(error) => report.push(Problem::new(format!("`{text}` is no pattern: {error}"))),
        }
        if found.len() == before && report.is_empty() {
            report.push(Problem::new(format!("there is no recording `{text}`")));
        }
    }
    let mut seen = std::collections::BTreeSet::new();
    found.retain(|path| seen.insert(path.clone()));
    report.into_result(found)
}
