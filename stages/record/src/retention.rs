//! Retention of recordings: the oldest files are removed first.
//!
//! A wrong system clock must not delete recordings. The age of files of this run is measured by the monotonic clock.
//! The age of other files is the time up to the completion of the newest file. After a jump ahead, the system clock
//! is trusted only after a day. The newest file is always kept.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};

use tauscope_archive::whole_file;

use crate::config::Keep;
use crate::file_name::FileName;

/// Advance of the system clock over the monotonic clock above which it has jumped.
/// Resolution: a disciplined clock drifts less between two files.
const JUMP: Duration = Duration::from_hours(1);
/// Time after a jump ahead until the system clock is trusted.
/// Resolution: a plant is inspected once a day.
const BELIEVED_AFTER: Duration = Duration::from_hours(24);

/// A complete file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Closed {
    path: PathBuf,
    bytes: u64,
    modified: SystemTime,
    /// Time at which this run completed it; `None` for other runs. Files of this run are newer, whatever their clock
    /// time.
    completed: Option<Instant>,
}

/// An instant by the system clock and by the monotonic clock.
#[derive(Debug, Clone, Copy)]
struct Now {
    clock: SystemTime,
    running: Instant,
}

impl Now {
    fn get() -> Self {
        Self {
            clock: SystemTime::now(),
            running: Instant::now(),
        }
    }
}

/// Removal of old recordings.
#[derive(Debug)]
pub(crate) struct Retention {
    clock: Steady,
    /// Completion times of the files of this run.
    completed: BTreeMap<PathBuf, Instant>,
}

impl Retention {
    pub fn new() -> Self {
        Self {
            clock: Steady::new(Now::get()),
            completed: BTreeMap::new(),
        }
    }

    /// Records that these files were completed now.
    pub fn complete(&mut self, paths: &[PathBuf]) {
        let now = Instant::now();
        let new = paths.iter().map(|path| (path.clone(), now));
        self.completed.extend(new);
    }

    /// Removes the complete files of the name `of` that exceed the limits of `keep`; returns them.
    pub fn remove_what_is_beyond(
        &mut self,
        keep: &Keep,
        of: &FileName,
        cell: &str,
    ) -> io::Result<Vec<PathBuf>> {
        let files = self.closed(of, cell)?;
        let now = Now::get();
        let clock = self.clock.read(now);
        self.remove(beyond(keep, &files, Now { clock, ..now }))
    }

    /// Removes the oldest complete file of the name `of`; returns it.
    pub fn remove_oldest(&mut self, of: &FileName, cell: &str) -> io::Result<Vec<PathBuf>> {
        let files = self.closed(of, cell)?;
        self.remove(files.into_iter().take(1).map(|file| file.path).collect())
    }

    /// Complete files, the oldest first.
    fn closed(&self, of: &FileName, cell: &str) -> io::Result<Vec<Closed>> {
        let mut files = Vec::new();
        for path in of.all_like(cell, "")? {
            let of_file = fs::metadata(&path)?;
            if of_file.is_file() {
                files.push(Closed {
                    bytes: of_file.len(),
                    modified: of_file.modified()?,
                    completed: self.completed.get(&path).copied(),
                    path,
                });
            }
        }
        files.sort_by(|a, b| {
            (a.completed, a.modified, &a.path).cmp(&(b.completed, b.modified, &b.path))
        });
        Ok(files)
    }

    fn remove(&mut self, paths: Vec<PathBuf>) -> io::Result<Vec<PathBuf>> {
        for path in &paths {
            fs::remove_file(path)?;
            whole_file::sync_folder_of(path)?;
            self.completed.remove(path);
        }
        Ok(paths)
    }
}

/// The system clock with delayed trust in jumps ahead.
#[derive(Debug)]
struct Steady {
    /// The last trusted instant.
    last: Now,
    /// Beginning of the current jump ahead.
    ahead: Option<Instant>,
}

impl Steady {
    fn new(now: Now) -> Self {
        Self {
            last: now,
            ahead: None,
        }
    }

    /// Returns the trusted time.
    fn read(&mut self, now: Now) -> SystemTime {
        let steady = self.last.clock + now.running.saturating_duration_since(self.last.running);
        let jump = now.clock.duration_since(steady).unwrap_or_default();
        if jump > JUMP {
            if self.ahead.is_none() {
                let hours = jump.as_secs_f64() / 3600.0;
                tracing::warn!(
                    "the clock jumped ahead by {hours:.0} h; for one day `keep` removes no recording because of it"
                );
            }
            let since = *self.ahead.get_or_insert(now.running);
            if now.running.saturating_duration_since(since) < BELIEVED_AFTER {
                return steady;
            }
        }
        *self = Self::new(now);
        now.clock
    }
}

/// Selects the files to be removed from `files`, which are sorted from the oldest.
fn beyond(keep: &Keep, files: &[Closed], now: Now) -> Vec<PathBuf> {
    let Some((newest, before)) = files.split_last() else {
        return Vec::new();
    };
    let reference = now.clock.min(newest.modified);
    let age = |file: &Closed| match file.completed {
        Some(completed) => now.running.saturating_duration_since(completed),
        None => reference.duration_since(file.modified).unwrap_or_default(),
    };
    // The newest file is kept whatever its size; otherwise none might remain.
    let mut mb = newest.bytes as f64 * 1e-6;
    let mut is_full = false;
    let mut gone = Vec::new();
    for file in before.iter().rev() {
        let days = age(file).as_secs_f64() / 86_400.0;
        let is_old = keep.at_most_days.is_some_and(|limit| days > limit);
        if !is_old {
            mb += file.bytes as f64 * 1e-6;
            is_full |= keep.at_most_mb.is_some_and(|limit| mb > limit);
        }
        if is_old || is_full {
            gone.push(file.path.clone());
        }
    }
    gone.reverse();
    gone
}

#[cfg(test)]
mod tests {
    use super::*;

    const DAY: Duration = Duration::from_hours(24);

    /// Day 1000 by the clock of the files.
    fn today() -> Now {
        Now {
            clock: SystemTime::UNIX_EPOCH + 1000 * DAY,
            running: Instant::now() + 100 * DAY,
        }
    }

    /// Files of 10 MB of other runs, completed these numbers of days ago.
    fn files(days: &[u32]) -> Vec<Closed> {
        let file = |&days: &u32| Closed {
            path: format!("{days}").into(),
            bytes: 10_000_000,
            modified: today().clock - days * DAY,
            completed: None,
        };
        days.iter().map(file).collect()
    }

    fn gone(keep: Keep, files: &[Closed], now: Now) -> Vec<PathBuf> {
        beyond(&keep, files, now)
    }

    fn at_most_days(days: f64) -> Keep {
        Keep {
            at_most_mb: None,
            at_most_days: Some(days),
        }
    }

    #[test]
    fn the_oldest_go_by_size_and_by_age() {
        let by_size = Keep {
            at_most_mb: Some(25.0),
            at_most_days: None,
        };
        let all = files(&[9, 5, 2, 1]);
        assert_eq!(gone(by_size, &all, today()), ["9", "5"].map(PathBuf::from));
        let by_age = gone(at_most_days(3.0), &all, today());
        assert_eq!(by_age, ["9", "5"].map(PathBuf::from));
        assert!(gone(Keep::default(), &all, today()).is_empty());
        assert!(gone(at_most_days(3.0), &[], today()).is_empty());
    }

    #[test]
    fn the_newest_stays_though_it_alone_is_too_large_or_too_old() {
        let keep = Keep {
            at_most_mb: Some(1.0),
            at_most_days: Some(30.0),
        };
        let all = files(&[200, 100]);
        assert_eq!(gone(keep, &all, today()), ["200"].map(PathBuf::from));
    }

    #[test]
    fn a_wrong_clock_makes_no_recording_old() {
        let all = files(&[9, 5, 2, 1]);
        // A run that begins ten years ahead.
        let ahead = Now {
            clock: today().clock + 3650 * DAY,
            ..today()
        };
        assert!(gone(at_most_days(30.0), &all, ahead).is_empty());
        // A file that was completed while the clock was set back to the epoch, and one after it was set right.
        let mut all = all;
        for (name, modified, hour) in [
            ("epoch", SystemTime::UNIX_EPOCH, 1),
            ("right", today().clock, 2),
        ] {
            all.push(Closed {
                path: name.into(),
                bytes: 10_000_000,
                modified,
                completed: Some(Instant::now() + 99 * DAY + Duration::from_hours(hour)),
            });
        }
        assert!(gone(at_most_days(30.0), &all, today()).is_empty());
        all.pop();
        assert!(gone(at_most_days(30.0), &all, today()).is_empty());
        // Files of this run age, too.
        let later = Now {
            running: today().running + 40 * DAY,
            ..today()
        };
        let mut newest = all[3].clone();
        newest.completed = Some(later.running);
        all.push(newest);
        let epoch = gone(at_most_days(30.0), &all, later);
        assert_eq!(epoch, ["epoch"].map(PathBuf::from));
    }

    #[test]
    fn a_clock_that_jumps_ahead_is_believed_after_a_day() {
        let begin = today();
        let mut steady = Steady::new(begin);
        let mut after = |hours: u64, ahead_h: u64| {
            let running = Duration::from_hours(hours);
            let clock = begin.clock + running + Duration::from_hours(ahead_h);
            let read = steady.read(Now {
                clock,
                running: begin.running + running,
            });
            read.duration_since(begin.clock).unwrap().as_secs() / 3600
        };
        assert_eq!(after(5, 0), 5);
        assert_eq!(after(6, 8760), 6);
        assert_eq!(after(20, 8760), 20);
        // The clock is corrected.
        assert_eq!(after(21, 0), 21);
        assert_eq!(after(22, 8760), 22);
        assert_eq!(after(45, 8760), 45);
        assert_eq!(after(46, 8760), 46 + 8760);
        assert_eq!(after(47, 8760), 47 + 8760);
    }
}
