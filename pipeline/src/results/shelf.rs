//! Storage of results.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use tauscope_archive::whole_file::{self, Existing};

/// A store of complete files. A file under its final name is complete and never changes.
pub trait Shelf: Sync {
    /// Whether the file `name` exists.
    ///
    /// # Errors
    /// If that cannot be determined.
    fn holds(&self, name: &str) -> io::Result<bool>;

    /// Creates a local temporary file for the content of `name`, with this process as its only writer.
    ///
    /// # Errors
    /// If it cannot be created.
    fn begin(&self, name: &str) -> io::Result<(Part, File)>;

    /// Moves the finished `part` to `name`, unless that file exists, and removes `part`. Returns whether it was
    /// moved.
    ///
    /// # Errors
    /// If it cannot be moved.
    fn place(&self, part: Part, name: &str) -> io::Result<bool>;

    /// Writes a small text file and replaces an existing one.
    ///
    /// # Errors
    /// If it cannot be written.
    fn put(&self, name: &str, text: &str) -> io::Result<()>;
}

/// An unfinished file. Its lock is held while this value lives, also after its writer has closed it: other runners
/// take an unlocked file for that of a crashed one and remove it.
#[derive(Debug)]
pub struct Part {
    path: PathBuf,
    _lock: File,
}

impl Part {
    /// Removes the file.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn discard(self) -> io::Result<()> {
        whole_file::discard(&self.path)
    }
}

/// Counter that makes the names of a process's unfinished files unique.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// A local folder, or one that several machines share.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    /// Folder of unfinished files, which no glob over the results matches.
    unfinished: PathBuf,
    /// Random identifier of this process; process ids are not unique across containers.
    runner: String,
}

impl Folder {
    /// Opens the folder, creates it if missing, and removes unfinished files of crashed runners.
    ///
    /// # Errors
    /// If it cannot be created or listed.
    pub fn open(root: &Path) -> io::Result<Self> {
        let unfinished = root.join("unfinished");
        whole_file::create_folder(&unfinished)?;
        for entry in fs::read_dir(&unfinished)? {
            let path = entry?.path();
            // A file that another runner still writes is locked and is left alone. The lock is held until the file is
            // removed, so that a runner that has just created it notices.
            if let Ok(file) = File::open(&path)
                && file.try_lock().is_ok()
            {
                let _ = fs::remove_file(&path);
            }
        }
        let random = std::hash::BuildHasher::hash_one(
            &std::collections::hash_map::RandomState::new(),
            std::process::id(),
        );
        Ok(Self {
            root: root.to_owned(),
            unfinished,
            runner: format!("{random:016x}"),
        })
    }
}

impl Shelf for Folder {
    fn holds(&self, name: &str) -> io::Result<bool> {
        self.root.join(name).try_exists()
    }

    fn begin(&self, name: &str) -> io::Result<(Part, File)> {
        let file_name = Path::new(name).file_name().unwrap_or_default();
        let file_name = file_name.to_string_lossy();
        let new = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .clone();
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let name = format!("{file_name}.{}.{number}.part", self.runner);
            let path = self.unfinished.join(name);
            let file = whole_file::create(&path, &new)?;
            whole_file::hold(&file)?;
            // A duplicate of the descriptor shares the lock, which ends with the last of them (flock(2)).
            let part = Part {
                path,
                _lock: file.try_clone()?,
            };
            if file.metadata()?.nlink() > 0 {
                return Ok((part, file));
            }
            // A starting runner removed the file before it was locked, as if its owner had crashed.
            let _ = part.discard();
        }
    }

    fn place(&self, part: Part, name: &str) -> io::Result<bool> {
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            whole_file::create_folder(folder)?;
        }
        match whole_file::put_in_place(&part.path, &path, Existing::Keep) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                part.discard()?;
                Ok(false)
            }
            placed => placed.map(|()| true),
        }
    }

    fn put(&self, name: &str, text: &str) -> io::Result<()> {
        let (part, mut file) = self.begin(name)?;
        io::Write::write_all(&mut file, text.as_bytes())?;
        file.sync_all()?;
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            whole_file::create_folder(folder)?;
        }
        whole_file::put_in_place(&part.path, &path, Existing::Replace)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_to_finish_is_kept_and_nothing_unfinished_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (one, two) = (
            Folder::open(folder.path()).unwrap(),
            Folder::open(folder.path()).unwrap(),
        );
        let name = "cell=c/day=d/k.parquet";
        let [first, second] = [&one, &two].map(|shelf| shelf.begin(name).unwrap().0);
        fs::write(&first.path, "0").unwrap();
        fs::write(&second.path, "1").unwrap();
        assert!(!one.holds(name).unwrap());
        assert!(two.place(second, name).unwrap());
        assert!(!one.place(first, name).unwrap());
        assert!(one.holds(name).unwrap());
        assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), "1");
        assert_eq!(fs::read_dir(&one.unfinished).unwrap().count(), 0);
    }

    #[test]
    fn runners_that_begin_take_nothing_from_one_that_works() {
        let folder = tempfile::tempdir().unwrap();
        let working = Folder::open(folder.path()).unwrap();
        let done = std::sync::atomic::AtomicBool::new(false);
        let results: Vec<_> = std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    Folder::open(folder.path()).unwrap();
                }
            });
            let results = (0..20_000).map(|_| {
                let (part, _file) = working.begin("a.parquet")?;
                part.discard()
            });
            let results = results.collect();
            done.store(true, Ordering::Relaxed);
            results
        });
        let lost: Vec<_> = results.into_iter().filter(io::Result::is_err).collect();
        assert!(lost.is_empty(), "{}: {:?}", lost.len(), lost[0]);
    }

    #[test]
    fn what_a_dead_runner_left_is_removed_and_what_a_living_one_writes_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let living = Folder::open(folder.path()).unwrap();
        let (part, file) = living.begin("a.parquet").unwrap();
        let path = part.path.clone();
        let dead = living.unfinished.join("b.parquet.0.part");
        fs::write(&dead, "half").unwrap();
        Folder::open(folder.path()).unwrap();
        assert!(path.exists() && !dead.exists());
        // The writer of a result closes its file before the runner moves it.
        drop(file);
        Folder::open(folder.path()).unwrap();
        assert!(path.exists());
        drop(part);
        Folder::open(folder.path()).unwrap();
        assert!(!path.exists());
    }
}
