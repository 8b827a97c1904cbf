//! Traits of the stages.
//!
//! There are three roles, so that wrong wiring does not compile: a [`Source`] emits a stream, a [`Stage`] transforms
//! one stream into another, and a [`Sink`] accepts any number of streams and emits none.

use std::path::PathBuf;
use std::task::Waker;
use std::time::{Duration, Instant};

use crate::link::LinkError;
use crate::sample::{Sample, SampleRef};
use crate::trouble::Trouble;

/// Output of a stage: it loans a slot, which is written in place and sent.
pub trait Emit<T: Sample> {
    /// Loans a slot (a default `T`), lets `write` fill it, and sends it. The sequence number is set
    /// by the link.
    ///
    /// # Errors
    /// If the link cannot send.
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError>;
}

/// Failure of a stage.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// Failure of the output link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Failure of the stage itself, or of a resource that it reads or writes.
    #[error("{0}")]
    Failed(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// Input that does not match the configuration: every restart would fail again.
    #[error("{0}")]
    Unfit(String),
}

impl StageError {
    /// Wraps a stage's own error.
    pub fn failed(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Failed(error.into())
    }
}

/// State of a source after a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// More samples may follow at once.
    More,
    /// No data now, for example a live source that waits for its peer; call again once it has woken its waker
    /// ([`Source::register`]), or soon.
    Idle,
    /// No data before this time, for example a source that plays a recording at its own rate.
    Until(Instant),
    /// The source has ended.
    End,
}

/// Emits a stream. The only kind of stage that may read input of its own. It does not wait: other sources share its
/// thread.
pub trait Source<T: Sample>: Send {
    /// Emits the next samples, at most a few.
    ///
    /// # Errors
    /// If the source cannot be read any further.
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError>;

    /// Stores the waker of the thread that calls [`Source::step`]. A source that receives data in a thread of its own
    /// wakes it for new data; without that, a step follows a millisecond after one that was [`Progress::Idle`].
    /// Returns whether the source will do so.
    fn register(&mut self, _waker: &Waker) -> bool {
        false
    }

    /// Number of samples dropped so far (NaN, unreadable) or lost on the way to this source.
    fn dropped(&self) -> u64 {
        0
    }

    /// Progress of a source of known length, from 0 to 1, for a progress bar.
    fn fraction_done(&self) -> Option<f64> {
        None
    }

    /// Reason why no usable data arrives, `silent_for` after the last sample (or the start); `None` while data
    /// arrives. Called ten times a second.
    fn trouble(&mut self, _silent_for: Duration) -> Option<Trouble> {
        None
    }
}

impl<T: Sample, S: Source<T> + ?Sized> Source<T> for Box<S> {
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError> {
        (**self).step(out)
    }

    fn register(&mut self, waker: &Waker) -> bool {
        (**self).register(waker)
    }

    fn dropped(&self) -> u64 {
        (**self).dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        (**self).fraction_done()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        (**self).trouble(silent_for)
    }
}

impl<T: Sample, S: Source<T> + ?Sized> Source<T> for &mut S {
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError> {
        (**self).step(out)
    }

    fn register(&mut self, waker: &Waker) -> bool {
        (**self).register(waker)
    }

    fn dropped(&self) -> u64 {
        (**self).dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        (**self).fraction_done()
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        (**self).trouble(silent_for)
    }
}

/// Transforms a stream into another: a pure state machine, without I/O and without a clock of its own.
pub trait Stage<I: Sample, O: Sample>: Send {
    /// Processes one sample and emits the results.
    ///
    /// # Errors
    /// If the output cannot be sent, or the stage fails.
    fn accept(&mut self, sample: &I, out: &mut dyn Emit<O>) -> Result<(), StageError>;

    /// Emits the pending results, after the end of the input.
    ///
    /// # Errors
    /// See [`Stage::accept`].
    fn finish(&mut self, _out: &mut dyn Emit<O>) -> Result<(), StageError> {
        Ok(())
    }

    /// Number of samples refused so far.
    fn dropped(&self) -> u64 {
        0
    }
}

impl<I: Sample, O: Sample, S: Stage<I, O> + ?Sized> Stage<I, O> for &mut S {
    fn accept(&mut self, sample: &I, out: &mut dyn Emit<O>) -> Result<(), StageError> {
        (**self).accept(sample, out)
    }

    fn finish(&mut self, out: &mut dyn Emit<O>) -> Result<(), StageError> {
        (**self).finish(out)
    }

    fn dropped(&self) -> u64 {
        (**self).dropped()
    }
}

/// Accepts any number of streams. The only kind of stage, except for a source, that may do I/O.
pub trait Sink: Send {
    /// Processes one sample of the stream that the stage named `from` emits.
    ///
    /// # Errors
    /// If it cannot be written.
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError>;

    /// Called about ten times a second while no samples arrive, to flush buffers.
    ///
    /// # Errors
    /// If it cannot be written.
    fn idle(&mut self) -> Result<(), StageError> {
        Ok(())
    }

    /// Called before [`finish`](Self::finish) if no more samples arrive although an input has not ended, for example
    /// because a preceding stage has failed.
    fn cut_short(&mut self) {}

    /// Completes the output, after the last sample.
    ///
    /// # Errors
    /// If the output cannot be completed.
    fn finish(&mut self) -> Result<(), StageError>;

    /// The files completed last, and the number of all completed files.
    fn completed_files(&self) -> (&[PathBuf], u64) {
        (&[], 0)
    }

    /// Number of samples dropped so far.
    fn dropped(&self) -> u64 {
        0
    }
}
