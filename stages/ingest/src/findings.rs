//! A handle to the findings about a recording.

use std::sync::{Arc, Mutex, PoisonError};

use tauscope_session::Finding;

/// Findings about a recording, complete once its source has ended. A handle: the source may be on another thread.
#[derive(Debug, Clone, Default)]
pub struct Findings(Arc<Mutex<Vec<Finding>>>);

impl Findings {
    /// The findings so far.
    pub fn get(&self) -> Vec<Finding> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.clone()
    }

    pub(crate) fn set(&self, all: Vec<Finding>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = all;
    }
}
