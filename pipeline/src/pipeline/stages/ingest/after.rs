//! A source that continues after a sample.

use std::task::Waker;
use std::time::Duration;

use tauscope_bus::{Emit, JointState, LinkError, Progress, Source, StageError, Trouble};

/// A source that skips the samples up to a stamp.
pub struct After {
    /// The source.
    pub inner: Box<dyn Source<JointState>>,
    /// The stamp \[ns\].
    pub after_ns: i64,
}

struct EmitAfter<'a> {
    out: &'a mut dyn Emit<JointState>,
    after_ns: i64,
}

impl Emit<JointState> for EmitAfter<'_> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut JointState)) -> Result<(), LinkError> {
        let mut sample = JointState::default();
        write(&mut sample);
        if sample.header.stamp_ns <= self.after_ns {
            return Ok(());
        }
        self.out.emit(&mut |slot| *slot = sample)
    }
}

impl Source<JointState> for After {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        self.inner.step(&mut EmitAfter {
            out,
            after_ns: self.after_ns,
        })
    }

    fn register(&mut self, waker: &Waker) -> bool {
        self.inner.register(waker)
    }

    fn dropped(&self) -> u64 {
        self.inner.dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        self.inner.fraction_done()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        self.inner.trouble(silent_for)
    }
}
