//! Free disk space, polled during recording so that a filling disk is noticed before it is full.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tauscope_archive::whole_file;

/// Poll interval of the free space.
/// Resolution: unnoticed filling of the disk, against the cost of a system call.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Ratio of the free space for resuming to that for pausing.
/// Resolution: hysteresis, so that not every few samples begin a file.
const AMPLE: f64 = 1.25;

/// Query of the free space of a disk \[bytes\].
type Ask = fn(&Path) -> io::Result<u64>;

/// Free space of the disk that a recorder writes to.
pub(crate) struct Room {
    folder: PathBuf,
    min_free_mb: f64,
    ask: Ask,
    looked: Option<Instant>,
    /// Free space at the last poll \[bytes\]; `None` if the file system does not report it.
    free_bytes: Option<u64>,
}

impl Room {
    /// Creates the check for the disk of `folder`, which need not exist yet.
    pub fn new(folder: PathBuf, min_free_mb: f64) -> Self {
        Self::asked(folder, min_free_mb, whole_file::free_bytes)
    }

    fn asked(folder: PathBuf, min_free_mb: f64, ask: Ask) -> Self {
        Self {
            folder,
            min_free_mb,
            ask,
            looked: None,
            free_bytes: None,
        }
    }

    /// Whether there is enough space to continue, with `reserve_bytes` for completing open files. The required space
    /// is larger if recording is `paused`.
    pub fn is_enough(&mut self, reserve_bytes: u64, paused: bool) -> bool {
        let due = self.looked.is_none_or(|at| at.elapsed() >= LOOK_EVERY);
        if due {
            self.look();
        }
        let ample = if paused { AMPLE } else { 1.0 };
        let needed_mb = self.min_free_mb * ample + reserve_bytes as f64 * 1e-6;
        self.free_mb().is_none_or(|free_mb| free_mb >= needed_mb)
    }

    /// Polls now.
    pub fn look(&mut self) {
        self.looked = Some(Instant::now());
        self.free_bytes = (self.ask)(&self.folder).ok();
    }

    /// Free space at the last poll \[MB\].
    pub fn free_mb(&self) -> Option<f64> {
        self.free_bytes.map(|bytes| bytes as f64 * 1e-6)
    }
}

impl std::fmt::Display for Room {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let folder = if self.folder == Path::new("") {
            Path::new(".")
        } else {
            &self.folder
        };
        match self.free_mb() {
            Some(free_mb) => write!(
                f,
                "the disk of {} has {free_mb:.0} MB left (`min_free_mb` is {})",
                folder.display(),
                self.min_free_mb
            ),
            None => write!(f, "the disk of {} is full", folder.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room(ask: Ask) -> Room {
        Room::asked("out".into(), 100.0, ask)
    }

    #[test]
    fn the_end_of_what_is_open_needs_room_too() {
        let mut room = room(|_| Ok(110_000_000));
        assert!(room.is_enough(0, false));
        assert!(room.is_enough(10_000_000, false));
        assert!(!room.is_enough(11_000_000, false));
    }

    #[test]
    fn who_paused_goes_on_when_there_is_more_room_than_made_it_pause() {
        assert!(!room(|_| Ok(110_000_000)).is_enough(0, true));
        assert!(room(|_| Ok(125_000_000)).is_enough(0, true));
    }

    #[test]
    fn a_file_system_that_does_not_say_keeps_nobody_from_recording() {
        let mut room = room(|_| Err(io::ErrorKind::Unsupported.into()));
        assert!(room.is_enough(u64::MAX, false));
    }

    #[test]
    fn it_says_where_and_how_much() {
        let mut room = room(|_| Ok(42_000_000));
        room.look();
        assert_eq!(
            room.to_string(),
            "the disk of out has 42 MB left (`min_free_mb` is 100)"
        );
    }
}
