//! `tauscope replay --manifest`: replays each recording of an archive into a result of its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde::Serialize;
use tauscope_archive::whole_file;
use tauscope_pipeline::parallel;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::replay::{Replay, ReplayError, TwinChoice};
use tauscope_pipeline::report::{Problem, Report, without_path};
use tauscope_pipeline::results::{
    Done, Folder, Identity, Manifest, Shelf, Unit, UnitError, Wanted,
};

use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Show};
use crate::terminal;

/// Interval of the progress lines where no bar can be drawn.
/// Resolution: length of a log against the delay until progress shows.
const TOLD_EVERY: Duration = Duration::from_mins(1);

/// Maximum number of failures printed; the list of failures has all.
const MAX_TOLD: usize = 10;

/// One of several parts of a manifest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(index, of)| {
            Some(Self {
                index: index.parse().ok()?,
                of: of.parse().ok()?,
            })
        });
        match parsed {
            Some(shard) if shard.index < shard.of => Ok(shard),
            Some(Self { of, .. }) if of > 0 => {
                Err(format!("the shards of {of} are 0/{of} to {}/{of}", of - 1))
            }
            _ => Err("not INDEX/COUNT, such as 3/16".to_owned()),
        }
    }
}

/// A replay of a manifest.
#[derive(Debug)]
pub struct Job<'a> {
    /// The manifest.
    pub manifest: &'a Path,
    /// The part of the manifest to replay; all of it if `None`.
    pub shard: Option<Shard>,
    /// The folder of the results.
    pub out: &'a str,
    /// Number of recordings replayed in parallel.
    pub jobs: u16,
    /// Whether a twin's effort in an archive is recomputed or kept.
    pub twin: TwinChoice,
    /// Whether results also have a row for each judged sample.
    pub with_scores: bool,
    /// Whether the summary is printed as JSON.
    pub json: bool,
    /// Kind of progress display.
    pub show: Show,
}

/// Numbers of recordings by outcome, and of lost samples.
#[derive(Debug, Default, Serialize)]
struct Summary {
    recordings: usize,
    done_before: usize,
    replayed: usize,
    by_another_runner: usize,
    failed: Vec<Failed>,
    lossy: usize,
    left: usize,
    lost_samples: u64,
}

/// A recording without a result.
#[derive(Debug, Clone, Serialize)]
struct Failed {
    recording: PathBuf,
    sha256: String,
    why: String,
}

/// Outcome of one recording. Small, because there may be a hundred thousand.
enum End {
    Done(Done),
    Failed(Box<Failed>),
    Left,
}

/// Replays the recordings that have no result yet.
pub fn run(job: &Job<'_>, pipeline: &Pipeline, out: &mut Output) -> Result<Exit, Failure> {
    let manifest = Manifest::load(job.manifest)?;
    let manifest = match job.shard {
        Some(Shard { index, of }) => manifest.shard(index, of),
        None => manifest,
    };
    let replays = replays(job, pipeline, &manifest)?;
    let identity = Identity::of(pipeline, job.twin, job.with_scores)?;
    let shelf = Folder::open(&folder(job.out)?).with_context(|| job.out.to_owned())?;
    let hold = interrupt::hold();
    let ends = replay_all(job, &manifest, &|wanted, progress| {
        let unit = Unit {
            replay: &replays[&wanted.source],
            identity: &identity,
            shelf: &shelf,
            with_scores: job.with_scores,
        };
        unit.run(wanted, progress)
    });
    let summary = sum(ends);
    let interrupted = summary.left > 0;
    if interrupted {
        whole_file::remove_unfinished();
    }
    let list = put_failures(job, &shelf, &summary.failed)?;
    drop(hold);
    if job.json {
        out.print(&serde_json::to_string_pretty(&summary).context("the summary")?)?;
    } else {
        tell(&summary, &list, out)?;
    }
    if interrupted {
        let done = summary.recordings - summary.left;
        return Err(Failure::Interrupted(format!(
            "after {done} of {} recordings; run the same command again to continue",
            summary.recordings
        )));
    }
    let failed = if summary.failed.is_empty() {
        Exit::Done
    } else {
        Exit::Failed
    };
    Ok(Exit::from_loss(summary.lossy > 0).and(failed))
}

/// Returns a replay that is prepared to run `jobs` times in parallel.
pub fn prepared<'a>(
    pipeline: &'a Pipeline,
    source: Option<&str>,
    twin: TwinChoice,
    jobs: u16,
) -> Result<Replay<'a>, Failure> {
    let replay = Replay::new(pipeline, source, twin);
    let replay = replay.map_err(|error| Failure::rejected(error.to_string()))?;
    Ok(replay.reading_ahead(parallel::has_spare_core(usize::from(jobs))))
}

/// Returns a replay for each source that the manifest names.
fn replays<'a>(
    job: &Job<'_>,
    pipeline: &'a Pipeline,
    manifest: &Manifest,
) -> Result<BTreeMap<Option<String>, Replay<'a>>, Failure> {
    let mut replays = BTreeMap::new();
    for wanted in &manifest.wanted {
        if !replays.contains_key(&wanted.source) {
            let source = wanted.source.as_deref();
            let replay = prepared(pipeline, source, job.twin, job.jobs)?;
            replays.insert(wanted.source.clone(), replay);
        }
    }
    Ok(replays)
}

/// Returns the folder that `--out` names.
fn folder(out: &str) -> Result<PathBuf, Report> {
    match out.split_once("://") {
        None => Ok(out.into()),
        Some(("file", path)) if path.starts_with('/') => Ok(path.into()),
        Some((scheme, _)) => {
            let title = format!("results cannot be kept at `{scheme}://`");
            let help = "give a folder, or file:///a/folder; mount an object store to write to it";
            Err(Problem::new(title).help(help).into())
        }
    }
}

type Work<'a> = dyn Fn(&Wanted, &mut dyn FnMut(f64) -> bool) -> Result<Done, UnitError> + Sync + 'a;

/// Replays all recordings of the manifest; returns their outcomes.
fn replay_all(job: &Job<'_>, manifest: &Manifest, work: &Work<'_>) -> Vec<End> {
    let count = manifest.wanted.len();
    // `Log` prints the progress lines of this command.
    let bar = match job.show {
        Show::BarOrLines => Show::Bar,
        other => other,
    };
    let progress = Progress::new(count, bar);
    let log = Log::new(count, job.show);
    // Concurrent runners start at different recordings, so that they rarely replay the same one.
    let first = std::hash::BuildHasher::hash_one(
        &std::collections::hash_map::RandomState::new(),
        std::process::id(),
    );
    let first = (first % count.max(1) as u64) as usize;
    let order = (first..count).chain(0..first).collect();
    parallel::map(usize::from(job.jobs), order, |index: usize| {
        let wanted = &manifest.wanted[index];
        if interrupt::is_asked() {
            return End::Left;
        }
        let result = work(wanted, &mut |fraction| {
            progress.set(index, fraction);
            !interrupt::is_asked()
        });
        progress.set(index, 1.0);
        let end = match result {
            Ok(done) => End::Done(done),
            Err(UnitError::Replay(ReplayError::Interrupted)) => End::Left,
            Err(error) => End::Failed(Box::new(Failed {
                recording: wanted.recording.clone(),
                sha256: wanted.sha256.clone(),
                why: without_path(&wanted.recording, error.to_string()),
            })),
        };
        log.note(&end);
        end
    })
}

/// Progress lines where no bar can be drawn, such as in the log of a cluster's job.
struct Log {
    count: usize,
    show: Show,
    begun: Instant,
    told: Mutex<Instant>,
    ended: AtomicUsize,
    failed: AtomicUsize,
    /// Recordings that were replayed; the remaining time is estimated from these.
    replayed: AtomicUsize,
}

impl Log {
    fn new(count: usize, show: Show) -> Self {
        Self {
            count,
            show,
            begun: Instant::now(),
            told: Mutex::new(Instant::now()),
            ended: AtomicUsize::new(0),
            failed: AtomicUsize::new(0),
            replayed: AtomicUsize::new(0),
        }
    }

    fn note(&self, end: &End) {
        let count = |of: &AtomicUsize, one: bool| {
            of.fetch_add(usize::from(one), Ordering::Relaxed) + usize::from(one)
        };
        let ended = count(&self.ended, true);
        let failed = count(&self.failed, matches!(end, End::Failed(_)));
        let replayed = count(&self.replayed, !matches!(end, End::Done(Done::Before)));
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let has_lines = self.show == Show::BarOrLines && !terminal::can_redraw();
        if !has_lines || told.elapsed() < TOLD_EVERY {
            return;
        }
        *told = Instant::now();
        let each_s = self.begun.elapsed().as_secs_f64() / replayed.max(1) as f64;
        let left_min = each_s * (self.count - ended) as f64 / 60.0;
        eprintln!(
            "{ended} of {} recordings, {failed} failed, at most {left_min:.0} min left",
            self.count
        );
    }
}

fn sum(ends: Vec<End>) -> Summary {
    let mut summary = Summary {
        recordings: ends.len(),
        ..Summary::default()
    };
    for end in ends {
        match end {
            End::Done(Done::Before) => summary.done_before += 1,
            End::Done(Done::ByAnother) => summary.by_another_runner += 1,
            End::Done(Done::Now { lost }) => {
                summary.replayed += 1;
                summary.lossy += usize::from(lost > 0);
                summary.lost_samples += lost;
            }
            End::Failed(failed) => summary.failed.push(*failed),
            End::Left => summary.left += 1,
        }
    }
    summary.failed.sort_by(|a, b| a.recording.cmp(&b.recording));
    summary
}

/// Writes the list of failures, one line of JSON each, even if it is empty; returns its name.
fn put_failures(job: &Job<'_>, shelf: &Folder, failed: &[Failed]) -> anyhow::Result<String> {
    let Shard { index, of } = job.shard.unwrap_or(Shard { index: 0, of: 1 });
    let manifest = job
        .manifest
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    let name = format!("failed/{manifest}-{index}-of-{of}.jsonl");
    let mut text = String::new();
    for one in failed {
        text += &serde_json::to_string(one).context("the list of failures")?;
        text.push('\n');
    }
    shelf.put(&name, &text).context("the list of failures")?;
    Ok(name)
}

fn tell(summary: &Summary, list: &str, out: &mut Output) -> anyhow::Result<()> {
    let Summary {
        recordings,
        done_before,
        replayed,
        by_another_runner,
        failed,
        lossy,
        lost_samples,
        ..
    } = summary;
    out.print(&format!(
        "{recordings} recordings: {done_before} done before, {replayed} replayed, \
         {by_another_runner} done by another runner meanwhile, {} failed",
        failed.len()
    ))?;
    if *lossy > 0 {
        out.say(&format!(
            "warning: {lossy} recordings lost {lost_samples} samples: the column `lost_samples` tells which"
        ));
    }
    for one in failed.iter().take(MAX_TOLD) {
        out.say(&format!("error: {}: {}", one.recording.display(), one.why));
    }
    if !failed.is_empty() {
        out.say(&format!("all failures are in {list} of the results"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_count_from_0_as_the_index_of_a_cluster_job_does() {
        assert_eq!("3/16".parse(), Ok(Shard { index: 3, of: 16 }));
        let error = "16/16".parse::<Shard>().unwrap_err();
        assert!(error.contains("0/16 to 15/16"), "{error}");
        for wrong in ["", "3", "/", "0/0", "-1/4", "a/b"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn results_go_to_a_folder_or_its_url() {
        assert_eq!(folder("a/b").unwrap(), PathBuf::from("a/b"));
        assert_eq!(folder("file:///a/b").unwrap(), PathBuf::from("/a/b"));
        assert!(folder("s3://bucket/a").is_err());
    }
}
