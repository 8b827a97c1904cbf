//! Heartbeat of a thread: the stage that it currently runs, visible to other threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Heartbeat of a thread that runs stages. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Heartbeat(Arc<Beat>);

#[derive(Debug, Default)]
struct Beat {
    names: Mutex<Vec<String>>,
    at: AtomicUsize,
    waits: AtomicBool,
}

impl Heartbeat {
    /// Name of the current stage.
    pub fn current_stage(&self) -> String {
        self.name(self.0.at.load(Ordering::Relaxed))
    }

    /// Whether the thread waits for a link, which has a stall timeout of its own.
    pub fn waits(&self) -> bool {
        self.0.waits.load(Ordering::Relaxed)
    }

    /// Runs `send`, marked as waiting for a link.
    pub fn waiting<R>(&self, send: impl FnOnce() -> R) -> R {
        self.0.waits.store(true, Ordering::Relaxed);
        let sent = send();
        self.0.waits.store(false, Ordering::Relaxed);
        sent
    }

    /// The name of the stage at `place`.
    pub fn name(&self, place: usize) -> String {
        // The list is append-only, hence consistent at any time.
        let names = self.0.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.get(place).cloned().unwrap_or_default()
    }

    /// Registers a stage, and returns its index. A restarted stage keeps its index.
    pub fn place(&self, name: &str) -> usize {
        let mut names = self.0.names.lock().unwrap_or_else(PoisonError::into_inner);
        let known = names.iter().position(|known| known == name);
        known.unwrap_or_else(|| {
            names.push(name.to_owned());
            names.len() - 1
        })
    }

    /// Runs the work of the stage at `place`, which stays the current stage after a panic. Called by one thread only.
    pub fn turn_of<R>(&self, place: usize, work: impl FnOnce() -> R) -> R {
        let before = self.0.at.load(Ordering::Relaxed);
        self.0.at.store(place, Ordering::Relaxed);
        let done = work();
        self.0.at.store(before, Ordering::Relaxed);
        done
    }
}
