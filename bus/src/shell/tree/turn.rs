//! Whose turn it is in a tree, and who failed.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::link::LinkError;
use crate::stage::StageError;

/// Shared by the stages of one tree, which run in one thread.
#[derive(Debug, Clone, Default)]
pub struct Turn(Rc<State>);

#[derive(Debug, Default)]
struct State {
    /// Where one panicked, it stays at that one.
    pulse: Pulse,
    failure: RefCell<Option<(usize, StageError)>>,
}

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
    pub(in crate::shell) fn whose(&self) -> String {
        self.name(self.0.at.load(Ordering::Relaxed))
    }

    /// Whether it waits for a link, which has a patience of its own.
    pub(in crate::shell) fn waits(&self) -> bool {
        self.0.waits.load(Ordering::Relaxed)
    }

    /// Hands something to a link.
    pub(super) fn waiting<R>(&self, send: impl FnOnce() -> R) -> R {
        self.0.waits.store(true, Ordering::Relaxed);
        let sent = send();
        self.0.waits.store(false, Ordering::Relaxed);
        sent
    }

    fn name(&self, place: usize) -> String {
        // A list that is only added to is whole at any time.
        let names = self.0.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.get(place).cloned().unwrap_or_default()
    }
}

impl Turn {
    /// A number for the stage of that name.
    pub(super) fn place(&self, name: &str) -> usize {
        let mut names = (self.0.pulse.0.names.lock()).unwrap_or_else(PoisonError::into_inner);
        names.push(name.to_owned());
        names.len() - 1
    }

    /// The same for other threads.
    pub(super) fn pulse(&self) -> Pulse {
        self.0.pulse.clone()
    }

    /// The stage at `place` does its work, perhaps within the work of the one before it.
    pub(super) fn of(
        &self,
        place: usize,
        work: impl FnOnce() -> Result<(), StageError>,
    ) -> Result<(), LinkError> {
        // One thread writes, so that this needs no exchange.
        let at = &self.0.pulse.0.at;
        let before = at.load(Ordering::Relaxed);
        at.store(place, Ordering::Relaxed);
        let result = work();
        at.store(before, Ordering::Relaxed);
        result.map_err(|error| {
            // Those before it pass on that it failed; what it said itself stays.
            let mut failure = self.0.failure.borrow_mut();
            failure.get_or_insert((place, error));
            LinkError::Send {
                stream: self.name(place),
                reason: "the stage failed".to_owned(),
            }
        })
    }

    /// Whose turn it is.
    pub(super) fn whose(&self) -> String {
        self.0.pulse.whose()
    }

    /// Fails if a stage has failed, though those before it did not pass it on.
    pub(super) fn check(&self) -> Result<(), StageError> {
        match &*self.0.failure.borrow() {
            Some((place, _)) => Err(StageError::Link(LinkError::Send {
                stream: self.name(*place),
                reason: "the stage failed".to_owned(),
            })),
            None => Ok(()),
        }
    }

    /// Which stage failed, and of what; `error` is what came up to the loop.
    pub(super) fn failure(&self, error: StageError) -> (String, StageError) {
        match self.0.failure.take() {
            Some((place, error)) => (self.name(place), error),
            None => (self.whose(), error),
        }
    }

    fn name(&self, place: usize) -> String {
        self.0.pulse.name(place)
    }
}
