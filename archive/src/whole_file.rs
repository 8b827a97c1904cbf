//! Files that have their name only once they are whole.
//!
//! A file is written beside its name, with `.part` at the end, and gets its name when nothing is
//! missing any more. So a file with its proper name is complete, and a writer that died leaves a
//! `.part` and nothing else. A program that ends on purpose takes its own unfinished files with it
//! ([`remove_unfinished`]).

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What becomes of a file that already has the name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Existing {
    /// It stays as it is.
    #[default]
    Keep,
    /// The new file takes its place.
    Replace,
}

/// The `.part` files that this process has begun and not finished.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// This process begins to write `part`.
pub fn begin(part: &Path) {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    unfinished.insert(part.to_owned());
}

fn end(part: &Path) {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    unfinished.remove(part);
}

/// Removes what this process has begun and not finished: what it would have held is made again by doing
/// the same again. Not for recordings of a live robot.
pub fn remove_unfinished() {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    for part in std::mem::take(&mut *unfinished) {
        // One that is not there any more need not be removed.
        let _ = fs::remove_file(part);
    }
}

/// What a file is called until it is whole: `a.mcap.part` for `a.mcap`.
pub fn part_of(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

/// Writes a file whole, and its folder if there is none.
///
/// # Errors
/// If it cannot be written; [`io::ErrorKind::AlreadyExists`] if there is a file of that name and it
/// is to be kept. No `.part` stays.
pub fn write(path: &Path, contents: impl AsRef<[u8]>, existing: Existing) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let part = part_of(path);
    begin(&part);
    let written = File::create(&part).and_then(|mut file| {
        file.write_all(contents.as_ref())?;
        file.sync_all()
    });
    let placed = written.and_then(|()| put_in_place(&part, path, existing));
    if placed.is_err() {
        // Whatever it was that failed is what the caller is told.
        let _ = fs::remove_file(&part);
        end(&part);
    }
    placed
}

/// Gives the finished `part` its name, in one step that no other process can come between, and makes
/// it outlast a power cut.
///
/// # Errors
/// If it cannot be renamed; [`io::ErrorKind::AlreadyExists`] if there is a file of that name and it
/// is to be kept.
pub fn put_in_place(part: &Path, path: &Path, existing: Existing) -> io::Result<()> {
    match existing {
        Existing::Replace => fs::rename(part, path)?,
        Existing::Keep => rename_to_new(part, path)?,
    }
    end(part);
    match path.parent() {
        Some(folder) if folder != Path::new("") => File::open(folder)?.sync_all(),
        _ => File::open(".")?.sync_all(),
    }
}

/// The first of `a.mcap`, `a.1.mcap`, `a.2.mcap`, ... that no file has.
///
/// # Errors
/// If the folder cannot be read.
pub fn unused_name(path: &Path) -> io::Result<PathBuf> {
    let (mut name, mut n) = (path.to_owned(), 0);
    while name.try_exists()? {
        n += 1;
        name = numbered(path, n);
    }
    Ok(name)
}

/// Moves the `.part` that a dead writer of `path` left behind to `a.1.mcap.part`, `a.2.mcap.part`, ...:
/// it may hold the only copy of a recording. Gives its new name, if there was one.
///
/// # Errors
/// If the folder cannot be read or the file not be renamed.
pub fn set_part_aside(path: &Path) -> io::Result<Option<PathBuf>> {
    let part = part_of(path);
    if !part.try_exists()? {
        return Ok(None);
    }
    let mut n = 1;
    loop {
        let aside = part_of(&numbered(path, n));
        if !aside.try_exists()? {
            rename_to_new(&part, &aside)?;
            return Ok(Some(aside));
        }
        n += 1;
    }
}

/// `a.3.mcap` for `a.mcap` and 3.
fn numbered(path: &Path, n: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{n}"));
    if let Some(extension) = path.extension() {
        name.push(OsStr::new("."));
        name.push(extension);
    }
    path.with_file_name(name)
}

fn rename_to_new(part: &Path, path: &Path) -> io::Result<()> {
    match renameat_with(CWD, part, CWD, path, RenameFlags::NOREPLACE) {
        // Some network file systems know no such rename.
        Err(Errno::INVAL | Errno::NOSYS) => {
            if path.try_exists()? {
                return Err(io::ErrorKind::AlreadyExists.into());
            }
            fs::rename(part, path)
        }
        renamed => Ok(renamed?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is unfinished is the process's own, so one test at a time may write.
    static WRITING: Mutex<()> = Mutex::new(());

    #[test]
    fn a_file_that_is_there_stays_unless_it_is_to_be_replaced() {
        let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/twin.yaml");
        write(&path, "old", Existing::Keep).unwrap();
        let refused = write(&path, "new", Existing::Keep).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        write(&path, "new", Existing::Replace).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert!(!part_of(&path).exists(), "nothing unfinished stays");
    }

    #[test]
    fn what_is_unfinished_is_removed_and_what_is_whole_stays() {
        let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let (whole, torn) = (
            folder.path().join("a.json"),
            folder.path().join("b.mcap.part"),
        );
        write(&whole, "all", Existing::Keep).unwrap();
        begin(&torn);
        fs::write(&torn, "hal").unwrap();
        remove_unfinished();
        assert!(whole.exists() && !torn.exists());
    }

    #[test]
    fn an_unused_name_is_the_first_that_no_file_has() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        assert_eq!(unused_name(&path).unwrap(), path);
        for name in ["a.mcap", "a.1.mcap"] {
            File::create(folder.path().join(name)).unwrap();
        }
        assert_eq!(unused_name(&path).unwrap(), folder.path().join("a.2.mcap"));
    }
}
