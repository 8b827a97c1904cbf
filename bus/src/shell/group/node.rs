//! The three kinds of nodes, independent of their sample types.

use std::cell::RefCell;
use std::rc::Rc;
use std::task::Waker;
use std::time::Duration;

use super::member::{Member, Part, Post};
use super::{Turn, mismatch};
use crate::link::LinkError;
use crate::sample::{Health, Sample, SampleKind, SampleRef};
use crate::seat::{AnySender, Seat};
use crate::shell::child::ChildError;
use crate::shell::report::Report;
use crate::stage::{Emit, Progress, Sink, Source, Stage, StageError};
use crate::trouble::Trouble;

type Assemble<'a> = dyn FnOnce(&Turn, Post, Option<AnySender>) -> Result<Rc<RefCell<dyn Part<'a> + 'a>>, LinkError>
    + Send
    + 'a;

/// A source, a stage or a sink, independent of its sample types.
pub struct Node<'a> {
    is_source: bool,
    /// Kind of its input; `None` for a source, and for a sink, which accepts all.
    accepts: Option<SampleKind>,
    assemble: Box<Assemble<'a>>,
}

impl<'a> Node<'a> {
    /// A source.
    pub fn source<T: Sample>(source: Box<dyn Source<T> + 'a>) -> Self {
        Self {
            is_source: true,
            ..Self::new(source, None)
        }
    }

    /// A stage.
    pub fn stage<I: Sample, O: Sample>(stage: Box<dyn Stage<I, O> + 'a>) -> Self {
        Self::new(stage, Some(I::KIND))
    }

    /// A sink.
    pub fn sink(sink: Box<dyn Sink + 'a>) -> Self {
        Self::new(sink, None)
    }

    fn new<W: Work + 'a>(work: W, accepts: Option<SampleKind>) -> Self {
        Self {
            is_source: false,
            accepts,
            assemble: Box::new(move |turn, post, output| {
                let member = Member::new(work, turn, post, output)?;
                Ok(Rc::new(RefCell::new(member)))
            }),
        }
    }

    /// Checks that a seat has the inputs and the output of this kind of node.
    pub(in crate::shell) fn check_seat(&self, seat: &Seat) -> Result<(), ChildError> {
        let (inputs, output) = (seat.inputs.len(), seat.output.is_some());
        let (fits, expected) = match (self.is_source, self.accepts) {
            (true, _) => (inputs == 0 && output, "no input and an output"),
            (false, Some(_)) => (inputs == 1 && output, "one input and an output"),
            (false, None) => (inputs > 0 && !output, "inputs and no output"),
        };
        if fits {
            return Ok(());
        }
        let output = if output { "an" } else { "no" };
        Err(ChildError::Shape {
            stage: seat.stage.clone(),
            expected,
            found: format!("{inputs} inputs and {output} output"),
        })
    }

    pub(in crate::shell) fn is_sink(&self) -> bool {
        !self.is_source && self.accepts.is_none()
    }

    /// Whether it is a source.
    pub fn is_source(&self) -> bool {
        self.is_source
    }

    pub(super) fn accepts(&self) -> Option<SampleKind> {
        self.accepts
    }

    pub(super) fn assemble(
        self,
        turn: &Turn,
        post: Post,
        output: Option<AnySender>,
    ) -> Result<Rc<RefCell<dyn Part<'a> + 'a>>, LinkError> {
        (self.assemble)(turn, post, output)
    }
}

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
        let typed = typed.ok_or_else(|| mismatch(from, I::KIND, Some(sample.kind())))?;
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
