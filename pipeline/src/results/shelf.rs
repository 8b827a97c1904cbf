//! Where results are kept.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use tauscope_archive::whole_file::{self, Existing};

/// A place for whole files. A file that has its name is complete and never changes.
pub trait Shelf: Sync {
    /// Whether `name` is there.
    ///
    /// # Errors
    /// If that cannot be told.
    fn holds(&self, name: &str) -> io::Result<bool>;

    /// A new file on this machine to write `name` into, which nobody else writes to.
    ///
    /// # Errors
    /// If it cannot be made.
    fn begin(&self, name: &str) -> io::Result<(PathBuf, File)>;

    /// Gives the finished `part` its name if nobody has done so before; `part` is gone then. Whether it was this one.
    ///
    /// # Errors
    /// If it cannot be put there.
    fn place(&self, part: &Path, name: &str) -> io::Result<bool>;

    /// Puts a small text there, whatever was there before.
    ///
    /// # Errors
    /// If it cannot be written.
    fn put(&self, name: &str, text: &str) -> io::Result<()>;
}

/// What distinguishes the unfinished files of one process.
static NUMBER: AtomicU64 = AtomicU64::new(0);

/// A folder of this machine, or one that several machines share.
#[derive(Debug)]
pub struct Folder {
    root: PathBuf,
    /// Where files are until they are whole: no glob over the results finds them.
    unfinished: PathBuf,
    /// Different in every process, also in containers, where all have the number 1.
    runner: String,
}

impl Folder {
    /// Opens the folder, makes it where there is none, and removes what runners that have died left unfinished.
    ///
    /// # Errors
    /// If it cannot be made or listed.
    pub fn open(root: &Path) -> io::Result<Self> {
        let unfinished = root.join("unfinished");
        whole_file::create_folder(&unfinished)?;
        for entry in fs::read_dir(&unfinished)? {
            let path = entry?.path();
            // One that another runner finishes at this moment is none of ours. It is locked until it is gone, so that
            // a runner that has just made it notices.
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

    fn begin(&self, name: &str) -> io::Result<(PathBuf, File)> {
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
            let part = self.unfinished.join(name);
            let file = whole_file::create(&part, &new)?;
            whole_file::hold(&file)?;
            if file.metadata()?.nlink() > 0 {
                return Ok((part, file));
            }
            // Before it was locked, a runner that begins took it for one of a dead runner.
            let _ = whole_file::discard(&part);
        }
    }

    fn place(&self, part: &Path, name: &str) -> io::Result<bool> {
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            whole_file::create_folder(folder)?;
        }
        match whole_file::put_in_place(part, &path, Existing::Keep) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                whole_file::discard(part)?;
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
        whole_file::put_in_place(&part, &path, Existing::Replace)
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
        let parts: Vec<_> = ([&one, &two].iter())
            .map(|shelf| shelf.begin(name).unwrap())
            .collect();
        for (n, (part, _)) in parts.iter().enumerate() {
            fs::write(part, n.to_string()).unwrap();
        }
        assert!(!one.holds(name).unwrap());
        assert!(two.place(&parts[1].0, name).unwrap());
        assert!(!one.place(&parts[0].0, name).unwrap());
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
                fs::remove_file(&part)
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
        let dead = living.unfinished.join("b.parquet.0.part");
        fs::write(&dead, "half").unwrap();
        Folder::open(folder.path()).unwrap();
        assert!(part.exists() && !dead.exists());
        drop(file);
        Folder::open(folder.path()).unwrap();
        assert!(!part.exists());
    }
}
