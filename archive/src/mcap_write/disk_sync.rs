//! Syncs written data to the disk on a separate thread, so that a slow disk does not block the writer.

use std::fs::File;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Thread that syncs a file on request, at most once per interval. Requests during a sync are merged into one.
pub(super) struct DiskSync {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    wanted: bool,
    closed: bool,
    /// Error of the first failed sync, until it is reported.
    error: Option<io::Error>,
    slowest: Duration,
}

impl DiskSync {
    pub(super) fn start(file: File, every: Duration) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let own = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("disk_sync".to_owned())
            .spawn(move || own.run(&file, every))?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Requests a sync of all data handed to the operating system so far.
    ///
    /// # Errors
    /// The error of an earlier sync, reported once.
    pub(super) fn ask(&self) -> io::Result<()> {
        let mut state = self.shared.lock();
        state.wanted = true;
        self.shared.changed.notify_all();
        state.error.take().map_or(Ok(()), Err)
    }

    /// Returns the longest duration of a sync.
    pub(super) fn slowest(&self) -> Duration {
        self.shared.lock().slowest
    }
}

impl Drop for DiskSync {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            // It does not panic, and if it did nothing could be done here.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self, file: &File, every: Duration) {
        let mut state = self.lock();
        loop {
            state = self
                .changed
                .wait_while(state, |state| !state.wanted && !state.closed)
                .unwrap_or_else(PoisonError::into_inner);
            if state.closed {
                return;
            }
            state.wanted = false;
            drop(state);
            let begun = Instant::now();
            let synced = file.sync_data();
            let took = begun.elapsed();
            state = self.lock();
            state.slowest = state.slowest.max(took);
            if let Err(error) = synced {
                state.error.get_or_insert(error);
            }
            (state, _) = self
                .changed
                .wait_timeout_while(state, every.saturating_sub(took), |state| !state.closed)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }
}
