//! Files that have their name only once they are whole.
//!
//! A file is written beside its name, with `.part` at the end, and gets its name when nothing is
//! missing any more. So a file with its proper name is complete, and a writer that died leaves a
//! `.part` and nothing else. A program that ends on purpose takes its own unfinished files with it
//! ([`remove_unfinished`]).

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustix::fs::{Access, AtFlags, CWD, RenameFlags, renameat_with};
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

/// The folders that this process has made, each after the one that it is in.
static FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Nothing in here can be left half done, so a panic elsewhere does not matter.
fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens `part`, which this process begins to write. In one step, so that no [`remove_unfinished`] comes between.
///
/// # Errors
/// If it cannot be opened so; then it is none of this process's files.
pub fn create(part: &Path, options: &OpenOptions) -> io::Result<File> {
    let mut unfinished = unfinished();
    let file = options.open(part)?;
    unfinished.insert(part.to_owned());
    Ok(file)
}

fn end(part: &Path) {
    unfinished().remove(part);
}

/// `path` is there, but belongs to a result that is not whole yet: until [`keep`] it counts as unfinished.
pub fn is_part_of_unfinished(path: &Path) {
    unfinished().insert(path.to_owned());
}

/// `path` belongs to a result that is whole now.
pub fn keep(path: &Path) {
    end(path);
}

/// Removes what this process has begun and not finished: what it would have held is made again by doing
/// the same again. Not for recordings of a live robot.
pub fn remove_unfinished() {
    remove(&mut unfinished());
}

/// The program leaves: as [`remove_unfinished`], and while the result lives no other thread begins a file or gives one
/// its name, but waits.
#[must_use = "others go on to write once it is gone"]
pub fn remove_unfinished_and_leave() -> Leaving {
    let mut unfinished = unfinished();
    remove(&mut unfinished);
    Leaving(unfinished)
}

/// Keeps others from beginning to write.
#[derive(Debug)]
pub struct Leaving(
    #[expect(dead_code, reason = "it is held, not read")] MutexGuard<'static, BTreeSet<PathBuf>>,
);

fn remove(unfinished: &mut BTreeSet<PathBuf>) {
    for part in std::mem::take(unfinished) {
        // One that is not there any more need not be removed.
        let _ = fs::remove_file(part);
    }
    let mut made = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
    // The deepest first. One that holds anything stays.
    for folder in std::mem::take(&mut *made).iter().rev() {
        let _ = fs::remove_dir(folder);
    }
}

/// Removes `part`, which this process has begun and does not need any more.
///
/// # Errors
/// If it cannot be removed.
pub fn discard(part: &Path) -> io::Result<()> {
    let removed = fs::remove_file(part);
    end(part);
    removed
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
        create_folder(folder)?;
    }
    let part = part_of(path);
    let options = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .clone();
    let written = create(&part, &options).and_then(|mut file| {
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
    let mut unfinished = unfinished();
    match existing {
        Existing::Replace => fs::rename(part, path)?,
        Existing::Keep => rename_to_new(part, path)?,
    }
    unfinished.remove(part);
    drop(unfinished);
    sync_folder_of(path)
}

/// Makes it outlast a power cut that `path` is there, has its name, or is gone.
///
/// # Errors
/// If the folder that it is in cannot be opened or synced.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    match path.parent() {
        Some(folder) if folder != Path::new("") => File::open(folder)?.sync_all(),
        _ => File::open(".")?.sync_all(),
    }
}

/// Makes `folder`, and those above it, where they are missing; they outlast a power cut.
///
/// # Errors
/// If it cannot be made.
pub fn create_folder(folder: &Path) -> io::Result<()> {
    if folder == Path::new("") || folder.is_dir() {
        return Ok(());
    }
    if let Some(above) = folder.parent() {
        create_folder(above)?;
    }
    match fs::create_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists || !folder.is_dir() => {
            Err(error)
        }
        Ok(()) => {
            let mut made = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
            made.insert(folder.to_owned());
            sync_folder_of(folder)
        }
        Err(_) => sync_folder_of(folder),
    }
}

/// Says to all other processes that `part`, which has just been made, is being written: for as long
/// as it is open.
///
/// # Errors
/// If the file system fails.
pub fn hold(part: &File) -> io::Result<()> {
    match part.lock() {
        // Some network file systems know no locks.
        Err(error) if error.kind() == io::ErrorKind::Unsupported => Ok(()),
        locked => locked,
    }
}

/// Whether a writer of `part` lives.
///
/// # Errors
/// If the file cannot be opened.
pub fn is_being_written(part: &Path) -> io::Result<bool> {
    let file = File::open(part)?;
    Ok(matches!(
        file.try_lock_shared(),
        Err(TryLockError::WouldBlock)
    ))
}

/// Whether this user may make files in `folder`, or make that where it is not there yet.
///
/// # Errors
/// What keeps from it, in the operating system's words.
pub fn check_writable(folder: &Path) -> io::Result<()> {
    // Without the slash at its end, with which a file is said not to be there.
    let folder: PathBuf = folder.components().collect();
    let there = folder.ancestors().find(|above| above.exists());
    let there = there
        .filter(|above| *above != Path::new(""))
        .unwrap_or(Path::new("."));
    if !there.is_dir() {
        return Err(io::ErrorKind::NotADirectory.into());
    }
    if is_made_by_the_kernel(there)? {
        return Err(io::ErrorKind::ReadOnlyFilesystem.into());
    }
    // The effective user: what a service may not do, its file's owner may.
    Ok(rustix::fs::accessat(
        CWD,
        there,
        Access::WRITE_OK | Access::EXEC_OK,
        AtFlags::EACCESS,
    )?)
}

/// Whether the file system at `folder` shows what the kernel knows and keeps no files.
fn is_made_by_the_kernel(folder: &Path) -> io::Result<bool> {
    /// Of sysfs. Physical: the number that Linux gives it.
    const SYSFS_MAGIC: i128 = 0x6265_6572;
    // Its width differs from machine to machine.
    let kind = i128::from(rustix::fs::statfs(folder)?.f_type);
    Ok(kind == i128::from(rustix::fs::PROC_SUPER_MAGIC) || kind == SYSFS_MAGIC)
}

/// Bytes that an ordinary user may still write on the disk of `path`, which need not be there yet.
///
/// # Errors
/// If the file system does not say.
pub fn free_bytes(path: &Path) -> io::Result<u64> {
    let there = path.ancestors().find(|above| above.exists());
    let there = there.filter(|above| *above != Path::new(""));
    let room = rustix::fs::statvfs(there.unwrap_or(Path::new(".")))?;
    Ok(room.f_bavail.saturating_mul(room.f_frsize))
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
/// If the folder cannot be read or the file not be renamed; [`io::ErrorKind::ResourceBusy`] if its
/// writer lives.
pub fn set_part_aside(path: &Path) -> io::Result<Option<PathBuf>> {
    let part = part_of(path);
    if !part.try_exists()? {
        return Ok(None);
    }
    if is_being_written(&part)? {
        let busy = "another process is writing it: give this one another name";
        return Err(io::Error::new(io::ErrorKind::ResourceBusy, busy));
    }
    let mut n = 1;
    loop {
        let name = numbered(path, n);
        let aside = part_of(&name);
        // Where the one before has been repaired, its name is taken.
        if !aside.try_exists()? && !name.try_exists()? {
            rename_to_new(&part, &aside)?;
            return Ok(Some(aside));
        }
        n += 1;
    }
}

/// Renames `a.mcap.part`, all of which that can be read is in another file, to `a.mcap.damaged`, or to the first of
/// `a.1.mcap.damaged`, ... that is free; gives its new name.
///
/// # Errors
/// If the folder cannot be read or synced, or the file not be renamed.
pub fn set_damaged_aside(part: &Path) -> io::Result<PathBuf> {
    let whole = part.with_extension("");
    let named = |name: &Path| {
        let mut damaged = name.as_os_str().to_owned();
        damaged.push(".damaged");
        PathBuf::from(damaged)
    };
    let (mut damaged, mut n) = (named(&whole), 0);
    while damaged.try_exists()? {
        n += 1;
        damaged = named(&numbered(&whole, n));
    }
    rename_to_new(part, &damaged)?;
    sync_folder_of(&damaged)?;
    Ok(damaged)
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
mod tests;
