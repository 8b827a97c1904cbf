//! Whose turn it is among the stages of one thread, for other threads to see.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Whose turn it is, as other threads see it. Clones are one.
#[derive(Debug, Clone, Default)]
pub struct Pulse(Arc<Beat>);

#[derive(Debug, Default)]
struct Beat {
    names: Mutex<Vec<String>>,
    at: AtomicUsize,
    waits: AtomicBool,
}

impl Pulse {
    /// The stage that runs.
    pub fn whose(&self) -> String {
        self.name(self.0.at.load(Ordering::Relaxed))
    }

    /// Whether it waits for a link, which has a patience of its own.
    pub fn waits(&self) -> bool {
        self.0.waits.load(Ordering::Relaxed)
    }

    /// Hands something to a link.
    pub fn waiting<R>(&self, send: impl FnOnce() -> R) -> R {
        self.0.waits.store(true, Ordering::Relaxed);
        let sent = send();
        self.0.waits.store(false, Ordering::Relaxed);
        sent
    }

    /// The name of the stage at `place`.
    pub fn name(&self, place: usize) -> String {
        // A list that is only added to is whole at any time.
        let names = self.0.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.get(place).cloned().unwrap_or_default()
    }

    /// A number for the stage of that name.
    pub fn place(&self, name: &str) -> usize {
        let mut names = self.0.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.push(name.to_owned());
        names.len() - 1
    }

    /// The stage at `place` does its work; where it panics, it stays its turn. One thread calls this.
    pub fn turn_of<R>(&self, place: usize, work: impl FnOnce() -> R) -> R {
        let before = self.0.at.load(Ordering::Relaxed);
        self.0.at.store(place, Ordering::Relaxed);
        let done = work();
        self.0.at.store(before, Ordering::Relaxed);
        done
    }
}
