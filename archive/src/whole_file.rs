//! Atomic writing of files.
//!
//! A file is written under its name with `.part` appended, and renamed when it is complete. So a file with its final
//! name is complete, and a writer that crashed leaves only a `.part`. A program that ends on purpose removes its own
//! unfinished files ([`remove_unfinished`]).

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

/// Policy for a file that already has the name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Existing {
    /// The existing file is kept.
    #[default]
    Keep,
    /// The new file replaces it.
    Replace,
}

/// The `.part` files that this process has created and not finished.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The folders that this process has created, each after its parent.
static FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Locks the set of unfinished files. A poisoned lock is harmless, because no update of the set is interrupted.
fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens `part` and registers it as unfinished, atomically with respect to [`remove_unfinished`].
///
/// # Errors
/// If it cannot be opened; it is then not registered.
pub fn create(part: &Path, options: &OpenOptions) -> io::Result<File> {
    let mut unfinished = unfinished();
    let file = options.open(part)?;
    unfinished.insert(part.to_owned());
    Ok(file)
}

fn end(part: &Path) {
    unfinished().remove(part);
}

/// Registers the existing `path` as part of an incomplete result: until [`keep`] it is treated as unfinished.
pub fn is_part_of_unfinished(path: &Path) {
    unfinished().insert(path.to_owned());
}

/// Marks `path` as part of a complete result.
pub fn keep(path: &Path) {
    end(path);
}

/// Removes the files that this process has created and not finished, for results that a second run produces again.
/// Not for recordings of a live robot.
pub fn remove_unfinished() {
    remove(&mut unfinished());
}

/// Removes unfinished files before the program exits, like [`remove_unfinished`]. While the returned guard lives,
/// other threads block when they create or rename a file.
#[must_use = "others go on to write once it is gone"]
pub fn remove_unfinished_and_leave() -> Leaving {
    let mut unfinished = unfinished();
    remove(&mut unfinished);
    Leaving(unfinished)
}

/// Guard that prevents other threads from creating and renaming files.
#[derive(Debug)]
pub struct Leaving(
    #[expect(dead_code, reason = "it is held, not read")] MutexGuard<'static, BTreeSet<PathBuf>>,
);

fn remove(unfinished: &mut BTreeSet<PathBuf>) {
    for part in std::mem::take(unfinished) {
        // A file that no longer exists need not be removed.
        let _ = fs::remove_file(part);
    }
    let mut made = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
    // The deepest first. A folder that is not empty stays.
    for folder in std::mem::take(&mut *made).iter().rev() {
        let _ = fs::remove_dir(folder);
    }
}

/// Removes `part`, which this process has created and no longer needs.
///
/// # Errors
/// If it cannot be removed.
pub fn discard(part: &Path) -> io::Result<()> {
    let removed = fs::remove_file(part);
    end(part);
    removed
}

/// Returns the name of a file until it is complete: `a.mcap.part` for `a.mcap`.
pub fn part_of(path: &Path) -> PathBuf {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    part.into()
}

/// Writes a complete file, and creates its folder if necessary.
///
/// # Errors
/// If it cannot be written; [`io::ErrorKind::AlreadyExists`] if there is a file of that name and it is to be kept. No
/// `.part` remains.
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
        // The caller gets the first error, not that of the removal.
        let _ = fs::remove_file(&part);
        end(&part);
    }
    placed
}

/// Renames the finished `part` to `path` atomically, and syncs the folder so that the name survives a power failure.
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

/// Syncs the folder of `path`, so that its creation, renaming or removal survives a power failure.
///
/// # Errors
/// If the folder cannot be opened or synced.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    match path.parent() {
        Some(folder) if folder != Path::new("") => File::open(folder)?.sync_all(),
        _ => File::open(".")?.sync_all(),
    }
}

/// Creates `folder` and its missing parents, and syncs them so that they survive a power failure.
///
/// # Errors
/// If it cannot be created.
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

/// Locks the new file `part`, so that other processes see that it is being written while it is open.
///
/// # Errors
/// If the file system fails.
pub fn hold(part: &File) -> io::Result<()> {
    match part.lock() {
        // Some network file systems do not support locks.
        Err(error) if error.kind() == io::ErrorKind::Unsupported => Ok(()),
        locked => locked,
    }
}

/// Returns whether a process is writing `part`.
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

/// Checks that this user may create files in `folder`, or create `folder` if it does not exist.
///
/// # Errors
/// The operating system's error if not.
pub fn check_writable(folder: &Path) -> io::Result<()> {
    // Without a trailing slash, with which `exists` is false for a file.
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
    // Check the effective user, not the real one: its rights apply to the writes.
    Ok(rustix::fs::accessat(
        CWD,
        there,
        Access::WRITE_OK | Access::EXEC_OK,
        AtFlags::EACCESS,
    )?)
}

/// Returns whether the file system at `folder` is procfs or sysfs, which store no files.
fn is_made_by_the_kernel(folder: &Path) -> io::Result<bool> {
    /// Magic number of sysfs.
    /// Physical: defined by Linux.
    const SYSFS_MAGIC: i128 = 0x6265_6572;
    // The width of `f_type` depends on the architecture.
    let kind = i128::from(rustix::fs::statfs(folder)?.f_type);
    Ok(kind == i128::from(rustix::fs::PROC_SUPER_MAGIC) || kind == SYSFS_MAGIC)
}

/// Returns the free space for an unprivileged user on the disk of `path`, which need not exist yet \[bytes\].
///
/// # Errors
/// If the file system does not report it.
pub fn free_bytes(path: &Path) -> io::Result<u64> {
    let there = path.ancestors().find(|above| above.exists());
    let there = there.filter(|above| *above != Path::new(""));
    let room = rustix::fs::statvfs(there.unwrap_or(Path::new(".")))?;
    Ok(room.f_bavail.saturating_mul(room.f_frsize))
}

/// Returns the first of `a.mcap`, `a.1.mcap`, `a.2.mcap`, ... that does not exist.
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

/// Renames the `.part` of a crashed writer of `path` to the first free name of `a.1.mcap.part`, `a.2.mcap.part`, ...
/// It may be the only copy of a recording. Returns its new name, if there was one.
///
/// # Errors
/// If the folder cannot be read or the file cannot be renamed; [`io::ErrorKind::ResourceBusy`] if a process is still
/// writing it.
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
        // A repaired earlier file may have taken `name`.
        if !aside.try_exists()? && !name.try_exists()? {
            rename_to_new(&part, &aside)?;
            return Ok(Some(aside));
        }
        n += 1;
    }
}

/// Renames `a.mcap.part`, whose readable data are in another file, to `a.mcap.damaged`, or to the first free name of
/// `a.1.mcap.damaged`, ... Returns its new name.
///
/// # Errors
/// If the folder cannot be read or synced, or the file cannot be renamed.
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

/// Returns `a.3.mcap` for `a.mcap` and 3.
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
        // Some network file systems do not support this flag.
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
