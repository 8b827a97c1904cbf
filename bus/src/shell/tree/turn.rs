//! Whose turn it is in a tree, and who failed.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use crate::link::LinkError;
use crate::stage::StageError;

/// Shared by the stages of one tree, which run in one thread.
#[derive(Debug, Clone, Default)]
pub struct Turn(Rc<State>);

#[derive(Debug, Default)]
struct State {
    names: RefCell<Vec<String>>,
    /// The stage that runs; where one panicked, it stays.
    at: Cell<usize>,
    failure: RefCell<Option<(usize, StageError)>>,
}

impl Turn {
    /// A number for the stage of that name.
    pub(super) fn place(&self, name: &str) -> usize {
        let mut names = self.0.names.borrow_mut();
        names.push(name.to_owned());
        names.len() - 1
    }

    /// The stage at `place` does its work, perhaps within the work of the one before it.
    pub(super) fn of(
        &self,
        place: usize,
        work: impl FnOnce() -> Result<(), StageError>,
    ) -> Result<(), LinkError> {
        let before = self.0.at.replace(place);
        let result = work();
        self.0.at.set(before);
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
        self.name(self.0.at.get())
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
        let names = self.0.names.borrow();
        names.get(place).cloned().unwrap_or_default()
    }
}
