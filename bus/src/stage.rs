//! What a stage is, to those that run it.
//!
//! Three roles, so that a wrong wiring does not compile: a [`Source`] makes a stream, a [`Stage`]
//! turns one into another, a [`Sink`] takes many and gives none.

use std::path::PathBuf;
use std::time::Duration;

use crate::link::LinkError;
use crate::sample::{Sample, SampleRef};
use crate::trouble::Trouble;

/// Where a stage puts its output: a slot is loaned, written in place and sent.
pub trait Emit<T: Sample> {
    /// Loans a slot (a default `T`), lets `write` fill it, and sends it. The sequence number is set
    /// by the link.
    ///
    /// # Errors
    /// What the link says if it cannot send.
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError>;
}

/// Why a stage cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The link it writes to failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// What it reads from or writes to failed.
    #[error("{0}")]
    Failed(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// Its input is not what it was configured for: it would fail again however often it is started.
    #[error("{0}")]
    Unfit(String),
}

impl StageError {
    /// Wraps a stage's own error.
    pub fn failed(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Failed(error.into())
    }
}

/// What a source has to say after a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// More may follow at once.
    More,
    /// Nothing now; a live source waits for its peer. Ask again soon.
    Idle,
    /// The source has ended.
    End,
}

/// Makes a stream. The only stage that may do input of its own, and wait.
pub trait Source<T: Sample>: Send {
    /// Emits what comes next, at most a few samples, and returns within a tenth of a second.
    ///
    /// # Errors
    /// If the source cannot be read any further.
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError>;

    /// Samples this source had to drop so far (NaN, unreadable), and what was lost on the way to it.
    fn dropped(&self) -> u64 {
        0
    }

    /// How far a source of known length is, from 0 to 1, for a progress bar.
    fn fraction_done(&self) -> Option<f64> {
        None
    }

    /// Why nothing that can be used comes, `silent_for` after the last sample (or the start); `None` while all is
    /// well. Asked twice a second, and answers within a tenth of one.
    fn trouble(&mut self, _silent_for: Duration) -> Option<Trouble> {
        None
    }
}

impl<T: Sample, S: Source<T> + ?Sized> Source<T> for Box<S> {
    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError> {
        (**self).step(out)
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

/// Turns a stream into another: a pure state machine, without I/O and without a clock of its own.
pub trait Stage<I: Sample, O: Sample>: Send {
    /// Takes one sample and emits what follows from it.
    ///
    /// # Errors
    /// If the output cannot be sent, or the stage cannot go on.
    fn accept(&mut self, sample: &I, out: &mut dyn Emit<O>) -> Result<(), StageError>;

    /// The input has ended: emits what is still held back.
    ///
    /// # Errors
    /// As [`Stage::accept`].
    fn finish(&mut self, _out: &mut dyn Emit<O>) -> Result<(), StageError> {
        Ok(())
    }

    /// Samples this stage had to refuse so far.
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

/// Takes any number of streams. The only stage besides a source that may do I/O.
pub trait Sink: Send {
    /// Takes one sample of the stream that the stage named `from` puts out.
    ///
    /// # Errors
    /// If it cannot be written.
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError>;

    /// Called about ten times a second while nothing comes, so that nothing stays in a buffer.
    ///
    /// # Errors
    /// If it cannot be written.
    fn idle(&mut self) -> Result<(), StageError> {
        Ok(())
    }

    /// Nothing more will come, though an input has not ended: a stage before it has failed. [`finish`](Self::finish)
    /// follows.
    fn cut_short(&mut self) {}

    /// All inputs have ended: completes what was written.
    ///
    /// # Errors
    /// If it cannot be completed.
    fn finish(&mut self) -> Result<(), StageError>;

    /// The files that it completed last, and how many in all.
    fn completed_files(&self) -> (&[PathBuf], u64) {
        (&[], 0)
    }

    /// Samples this sink had to drop so far.
    fn dropped(&self) -> u64 {
        0
    }
}
