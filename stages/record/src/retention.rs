//! Oldest first: what is given up of what was recorded.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

use tauscope_archive::whole_file;

use crate::config::Keep;
use crate::file_name::FileName;

/// A complete file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Closed {
    path: PathBuf,
    bytes: u64,
    modified: SystemTime,
}

/// Removes the complete files of the name `of` that are beyond what is to be kept; says which.
pub(crate) fn remove_what_is_beyond(
    keep: &Keep,
    of: &FileName,
    cell: &str,
) -> io::Result<Vec<PathBuf>> {
    let files = closed(of, cell)?;
    remove(beyond(keep, &files, SystemTime::now()))
}

/// Removes the oldest complete file of the name `of`; says which.
pub(crate) fn remove_oldest(of: &FileName, cell: &str) -> io::Result<Vec<PathBuf>> {
    let files = closed(of, cell)?;
    remove(files.into_iter().take(1).map(|file| file.path).collect())
}

/// The oldest first.
fn closed(of: &FileName, cell: &str) -> io::Result<Vec<Closed>> {
    let mut files = Vec::new();
    for path in of.all_like(cell, "")? {
        let of_file = fs::metadata(&path)?;
        if of_file.is_file() {
            files.push(Closed {
                bytes: of_file.len(),
                modified: of_file.modified()?,
                path,
            });
        }
    }
    files.sort_by(|a, b| (a.modified, &a.path).cmp(&(b.modified, &b.path)));
    Ok(files)
}

/// Of `files`, the oldest first, those to be removed.
fn beyond(keep: &Keep, files: &[Closed], now: SystemTime) -> Vec<PathBuf> {
    let mut mb = 0.0;
    let mut kept = 0;
    for file in files.iter().rev() {
        mb += file.bytes as f64 * 1e-6;
        let age = now.duration_since(file.modified).unwrap_or(Duration::ZERO);
        let days = age.as_secs_f64() / 86_400.0;
        let old = keep.at_most_days.is_some_and(|limit| days > limit);
        // The newest stays whatever its size: there would be nothing else.
        let much = kept > 0 && keep.at_most_mb.is_some_and(|limit| mb > limit);
        if old || much {
            break;
        }
        kept += 1;
    }
    let gone = &files[..files.len() - kept];
    gone.iter().map(|file| file.path.clone()).collect()
}

fn remove(paths: Vec<PathBuf>) -> io::Result<Vec<PathBuf>> {
    for path in &paths {
        fs::remove_file(path)?;
        whole_file::sync_folder_of(path)?;
    }
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of 10 MB that were completed so many days ago.
    fn files(days: &[u64]) -> Vec<Closed> {
        let file = |&days: &u64| Closed {
            path: format!("{days}").into(),
            bytes: 10_000_000,
            modified: SystemTime::UNIX_EPOCH + Duration::from_secs(86_400 * (1000 - days)),
        };
        days.iter().map(file).collect()
    }

    fn gone(keep: Keep, days: &[u64]) -> Vec<PathBuf> {
        let now = SystemTime::UNIX_EPOCH + Duration::from_hours(24 * 1000);
        beyond(&keep, &files(days), now)
    }

    #[test]
    fn the_oldest_go_by_size_and_by_age() {
        let by_size = Keep {
            at_most_mb: Some(25.0),
            at_most_days: None,
        };
        assert_eq!(gone(by_size, &[9, 5, 2, 1]), ["9", "5"].map(PathBuf::from));
        let by_age = Keep {
            at_most_mb: None,
            at_most_days: Some(3.0),
        };
        assert_eq!(gone(by_age, &[9, 5, 2, 1]), ["9", "5"].map(PathBuf::from));
        assert!(gone(Keep::default(), &[9, 5]).is_empty());
    }

    #[test]
    fn the_newest_stays_though_it_alone_is_too_large() {
        let keep = Keep {
            at_most_mb: Some(1.0),
            at_most_days: None,
        };
        assert_eq!(gone(keep, &[2, 1]), ["2"].map(PathBuf::from));
    }
}
