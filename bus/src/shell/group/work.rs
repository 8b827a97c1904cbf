//! The work of the three kinds of nodes.

use std::task::Waker;
use std::time::Duration;

use crate::link::LinkError;
use crate::sample::{Health, Sample, SampleKind, SampleRef};
use crate::shell::report::Report;
use crate::stage::{Emit, Progress, Sink, Source, Stage, StageError};
use crate::trouble::Trouble;

/// The work of a node, by kind.
pub(super) trait Work: Send {
    /// Samples that it emits. A sink emits none; its type is that of the health reports.
    type Out: Sample;
    /// Kind of these samples.
    const GIVES: Option<SampleKind>;

    /// See [`Source::step`].
    fn step(&mut self, _out: &mut dyn Emit<Self::Out>) -> Result<Progress, StageError> {
        Ok(Progress::End)
    }

    /// See [`Source::register`].
    fn register(&mut self, _waker: &Waker) -> bool {
        false
    }

    /// Processes a sample of the stage `from`.
    fn accept(
        &mut self,
        from: &str,
        sample: SampleRef<'_>,
        out: &mut dyn Emit<Self::Out>,
    ) -> Result<(), StageError>;

    /// Completes the output; `cut_short` if an input has not ended.
    fn finish(
        &mut self,
        _cut_short: bool,
        _out: &mut dyn Emit<Self::Out>,
    ) -> Result<(), StageError> {
        Ok(())
    }

    /// See [`Sink::idle`].
    fn idle(&mut self) -> Result<(), StageError> {
        Ok(())
    }

    /// See [`Source::trouble`].
    fn trouble(&mut self, _silent_for: Duration) -> Option<Trouble> {
        None
    }

    /// See [`Source::fraction_done`].
    fn fraction_done(&self) -> Option<f64> {
        None
    }

    /// Updates the parts of the report that only it knows.
    fn count(&self, report: &mut Report);
}

impl<T: Sample> Work for Box<dyn Source<T> + '_> {
    type Out = T;
    const GIVES: Option<SampleKind> = Some(T::KIND);

    fn step(&mut self, out: &mut dyn Emit<T>) -> Result<Progress, StageError> {
        (**self).step(out)
    }

    fn register(&mut self, waker: &Waker) -> bool {
        (**self).register(waker)
    }

    fn accept(&mut self, _: &str, _: SampleRef<'_>, _: &mut dyn Emit<T>) -> Result<(), StageError> {
        Ok(())
    }

    fn trouble(&mut self, silent_for: Duration) -> Option<Trouble> {
        (**self).trouble(silent_for)
    }

    fn fraction_done(&self) -> Option<f64> {
        (**self).fraction_done()
    }

    fn count(&self, report: &mut Report) {
        report.refused = self.dropped();
        report.received = report.emitted + report.refused;
        report.fraction_done = Work::fraction_done(self);
    }
}

impl<I: Sample, O: Sample> Work for Box<dyn Stage<I, O> + '_> {
    type Out = O;
    const GIVES: Option<SampleKind> = Some(O::KIND);

    fn accept(
        &mut self,
        from: &str,
        sample: SampleRef<'_>,
        out: &mut dyn Emit<O>,
    ) -> Result<(), StageError> {
        let typed = I::of(sample);
        let typed = typed.ok_or_else(|| LinkError::mismatch(from, I::KIND, Some(sample.kind())))?;
        (**self).accept(typed, out)
    }

    fn finish(&mut self, _: bool, out: &mut dyn Emit<O>) -> Result<(), StageError> {
        (**self).finish(out)
    }

    fn count(&self, report: &mut Report) {
        report.refused = self.dropped();
    }
}

impl Work for Box<dyn Sink + '_> {
    type Out = Health;
    const GIVES: Option<SampleKind> = None;

    fn accept(
        &mut self,
        from: &str,
        sample: SampleRef<'_>,
        _: &mut dyn Emit<Health>,
    ) -> Result<(), StageError> {
        (**self).accept(from, sample)
    }

    fn finish(&mut self, cut_short: bool, _: &mut dyn Emit<Health>) -> Result<(), StageError> {
        if cut_short {
            self.cut_short();
        }
        (**self).finish()
    }

    fn idle(&mut self) -> Result<(), StageError> {
        (**self).idle()
    }

    fn count(&self, report: &mut Report) {
        report.refused = self.dropped();
        let (files, completed) = self.completed_files();
        if report.files_completed != completed {
            report.files = files.to_vec();
            report.files_completed = completed;
        }
    }
}
