//! Whose turn it is in a tree, and who failed.

use std::cell::RefCell;
use std::rc::Rc;

use crate::link::LinkError;
use crate::shell::pulse::Pulse;
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

impl Turn {
    /// A number for the stage of that name.
    pub(super) fn place(&self, name: &str) -> usize {
        self.0.pulse.place(name)
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
        let result = self.0.pulse.turn_of(place, work);
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
