//! The current stage of a stage group, and the stage that failed.

use std::cell::RefCell;
use std::rc::Rc;

use crate::link::LinkError;
use crate::shell::heartbeat::Heartbeat;
use crate::stage::StageError;

/// State shared by the stages of one group, which run in one thread.
#[derive(Debug, Clone, Default)]
pub struct Turn(Rc<State>);

#[derive(Debug, Default)]
struct State {
    /// Stays at a stage that has panicked.
    heartbeat: Heartbeat,
    failure: RefCell<Option<(usize, StageError)>>,
}

impl Turn {
    /// The state of a group whose thread has this heartbeat.
    pub(super) fn under(heartbeat: Heartbeat) -> Self {
        Self(Rc::new(State {
            heartbeat,
            ..State::default()
        }))
    }

    /// Registers a stage, and returns its index.
    pub(super) fn place(&self, name: &str) -> usize {
        self.0.heartbeat.place(name)
    }

    /// The heartbeat, for other threads.
    pub(super) fn heartbeat(&self) -> Heartbeat {
        self.0.heartbeat.clone()
    }

    /// Runs the work of the stage at `place`, possibly nested in the work of the preceding stage.
    pub(super) fn of(
        &self,
        place: usize,
        work: impl FnOnce() -> Result<(), StageError>,
    ) -> Result<(), LinkError> {
        let result = self.0.heartbeat.turn_of(place, work);
        result.map_err(|error| {
            // Preceding stages pass the failure on; the original error is kept.
            let mut failure = self.0.failure.borrow_mut();
            failure.get_or_insert((place, error));
            LinkError::Send {
                stream: self.name(place),
                reason: "the stage failed".to_owned(),
            }
        })
    }

    /// Name of the current stage.
    pub(super) fn current_stage(&self) -> String {
        self.0.heartbeat.current_stage()
    }

    /// Fails if a stage has failed, even if the preceding stages did not pass the failure on.
    pub(super) fn check(&self) -> Result<(), StageError> {
        match &*self.0.failure.borrow() {
            Some((place, _)) => Err(StageError::Link(LinkError::Send {
                stream: self.name(*place),
                reason: "the stage failed".to_owned(),
            })),
            None => Ok(()),
        }
    }

    /// Returns the failed stage and its error. `error` is the one that reached the run loop.
    pub(super) fn failure(&self, error: StageError) -> (String, StageError) {
        match self.0.failure.take() {
            Some((place, error)) => (self.name(place), error),
            None => (self.current_stage(), error),
        }
    }

    fn name(&self, place: usize) -> String {
        self.0.heartbeat.name(place)
    }
}
