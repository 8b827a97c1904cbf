//! The stages of a group, and the routing of their samples.

use std::time::Duration;

use super::{Post, Turn};
use crate::link::{LinkError, Sender, SenderCounts};
use crate::sample::{Header, Health, Sample};
use crate::shell::Ledger;
use crate::shell::health::HealthSender;
use crate::shell::pulse::Pulse;
use crate::shell::report::{InputReport, Report};
use crate::stage::{Emit, Stage, StageError};

/// Output of a stage: to the stages of its group that receive it, and over links to all others.
pub struct Outlet<'a, T: Sample> {
    branches: Vec<Box<dyn Branch<T> + 'a>>,
    /// `None` without receivers outside the group.
    link: Option<Box<dyn Sender<T> + 'a>>,
    slot: T,
    sent: u64,
    newest: Option<Header>,
    ledger: Ledger,
    pulse: Pulse,
}

impl<'a, T: Sample> Outlet<'a, T> {
    /// An output to these stages, in this order, and over `link`.
    pub fn new(
        branches: Vec<Box<dyn Branch<T> + 'a>>,
        link: Option<Box<dyn Sender<T> + 'a>>,
    ) -> Self {
        Self {
            branches,
            link,
            slot: T::default(),
            sent: 0,
            newest: None,
            ledger: Ledger::default(),
            pulse: Pulse::default(),
        }
    }

    /// Takes the header of the newest sample emitted since the last call.
    pub(super) fn take_newest(&mut self) -> Option<Header> {
        self.newest.take()
    }

    fn counts(&self) -> SenderCounts {
        let link = self.link.as_ref().map(Sender::counts).unwrap_or_default();
        SenderCounts {
            sent: self.sent,
            undelivered: link.undelivered,
        }
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let link = self.link.as_mut();
        link.map_or(Ok(0), |link| link.wait_for_receivers(timeout))
    }

    fn wait_until_taken(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let link = self.link.as_mut();
        link.map_or(Ok(0), |link| link.wait_until_taken(timeout))
    }

    /// Ends the stream for all receivers.
    fn end(&mut self) -> Result<(), StageError> {
        if let Some(link) = &mut self.link {
            link.end()?;
        }
        let mut branches = self.branches.iter_mut();
        branches.try_for_each(|branch| {
            let part = branch.part();
            if let Some(input) = part.input() {
                input.ended = true;
            }
            part.finish()
        })
    }
}

impl<T: Sample> Emit<T> for Outlet<'_, T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let Self {
            branches,
            link,
            slot,
            sent,
            newest,
            ledger,
            pulse,
        } = self;
        if let (Some(link), true) = (&mut *link, branches.is_empty()) {
            pulse.waiting(|| {
                link.send_with(&mut |place| {
                    write(place);
                    *newest = Some(*place.header());
                    ledger.emitted(*sent + 1, place.header());
                })
            })?;
            *sent += 1;
            return Ok(());
        }
        *slot = T::default();
        write(slot);
        slot.header_mut().sequence = *sent;
        *newest = Some(*slot.header());
        *sent += 1;
        ledger.emitted(*sent, slot.header());
        // Stages of the group first: a detector must not wait for a recorder at the other end of the link.
        let heard = branches.iter_mut().try_for_each(|branch| {
            branch.hear(slot)?;
            branch.tell()
        });
        if let Some(link) = link {
            pulse.waiting(|| link.send_with(&mut |place| *place = *slot))?;
        }
        heard
    }
}

/// A stage of a group and all stages behind it, as seen by the preceding stage.
pub trait Branch<I> {
    /// Processes a sample.
    ///
    /// # Errors
    /// If the stage or one behind it fails.
    fn hear(&mut self, sample: &I) -> Result<(), LinkError>;

    /// Sends a health report if one is due.
    ///
    /// # Errors
    /// If the link fails.
    fn tell(&mut self) -> Result<(), LinkError>;

    /// The stage without its sample types.
    fn part(&mut self) -> &mut dyn Part;
}

/// A stage of a group, independent of its sample types.
pub trait Part {
    /// Updates the report.
    fn count(&mut self);

    /// The report as of the last update.
    fn report(&self) -> &Report;

    /// The report of the input; `None` for a source.
    fn input(&mut self) -> Option<&mut InputReport>;

    /// Records the report of the input in the ledger.
    fn keep_input(&mut self);

    /// Waits until the receivers over links are connected, and returns the number of missing ones.
    ///
    /// # Errors
    /// If a link fails.
    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError>;

    /// Finishes the stage and ends its stream, after the end of its input.
    ///
    /// # Errors
    /// If the stage, or one behind it, cannot finish.
    fn finish(&mut self) -> Result<(), StageError>;

    /// Waits until all receivers have read to the end; see [`Sender::wait_until_taken`].
    ///
    /// # Errors
    /// If a link fails.
    fn wait_until_taken(&mut self, timeout: Duration) -> Result<(), LinkError>;

    /// Visits each stage that receives its stream.
    ///
    /// # Errors
    /// The first error of `visit`.
    fn behind(
        &mut self,
        visit: &mut dyn FnMut(&mut dyn Part) -> Result<(), LinkError>,
    ) -> Result<(), LinkError>;
}

/// Visits a stage and all stages behind it.
pub(super) fn walk(
    part: &mut dyn Part,
    visit: &mut dyn FnMut(&mut dyn Part) -> Result<(), LinkError>,
) -> Result<(), LinkError> {
    visit(part)?;
    part.behind(&mut |behind| walk(behind, visit))
}

/// Common parts of all stages of a group: output, report and health.
pub(super) struct Frame<'a, O: Sample> {
    pub place: usize,
    pub turn: Turn,
    pub out: Outlet<'a, O>,
    pub health: HealthSender<Box<dyn Sender<Health> + 'a>>,
    pub report: Report,
    /// A health report is due.
    pub due: bool,
    ledger: Ledger,
}

impl<'a, O: Sample> Frame<'a, O> {
    pub fn new(turn: &Turn, post: Post<'a>, mut out: Outlet<'a, O>) -> Self {
        out.ledger = post.ledger.clone();
        out.pulse = turn.pulse();
        let inputs = if post.from.is_empty() {
            Vec::new()
        } else {
            vec![InputReport {
                from: post.from,
                ..InputReport::default()
            }]
        };
        Self {
            place: turn.place(&post.stage),
            turn: turn.clone(),
            out,
            health: HealthSender::new(post.health, &post.stage, post.restarts),
            report: Report {
                stage: post.stage,
                inputs,
                ..Report::default()
            },
            due: false,
            ledger: post.ledger,
        }
    }

    /// Updates the report, except for the values that only the stage itself knows.
    pub fn count(&mut self, refused: u64) {
        self.report.refused = refused;
        self.report.count_output(self.out.counts());
        self.report.count_inputs();
        self.report.stamp_ns = self.health.stamp_ns();
    }

    pub fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        Ok(self.health.wait_for_receivers(timeout)? + self.out.wait_for_receivers(timeout)?)
    }

    pub fn wait_until_taken(&mut self, timeout: Duration) -> Result<(), LinkError> {
        let data = self.out.wait_until_taken(timeout)?;
        self.report.untaken = data + self.health.wait_until_taken(timeout)?;
        Ok(())
    }

    pub fn end(&mut self) -> Result<(), StageError> {
        self.out.end()
    }

    pub fn behind(
        &mut self,
        visit: &mut dyn FnMut(&mut dyn Part) -> Result<(), LinkError>,
    ) -> Result<(), LinkError> {
        let mut branches = self.out.branches.iter_mut();
        branches.try_for_each(|branch| visit(branch.part()))
    }
}

struct Node<'a, I: Sample, O: Sample> {
    frame: Frame<'a, O>,
    stage: Box<dyn Stage<I, O> + 'a>,
}

/// A stage with all stages of its group behind it.
pub fn branch<'a, I: Sample, O: Sample>(
    turn: &Turn,
    post: Post<'a>,
    stage: Box<dyn Stage<I, O> + 'a>,
    out: Outlet<'a, O>,
) -> Box<dyn Branch<I> + 'a> {
    let frame = Frame::new(turn, post, out);
    Box::new(Node { frame, stage })
}

impl<I: Sample, O: Sample> Branch<I> for Node<'_, I, O> {
    fn hear(&mut self, sample: &I) -> Result<(), LinkError> {
        let Self { frame, stage } = self;
        if let Some(input) = frame.report.inputs.first_mut() {
            input.counts.received += 1;
            let received = input.counts.received;
            frame.ledger.takes(0, received, sample.header());
        }
        frame.due = frame.health.note(sample.header());
        let (turn, out) = (&frame.turn, &mut frame.out);
        turn.of(frame.place, || stage.accept(sample, out))
    }

    fn tell(&mut self) -> Result<(), LinkError> {
        if std::mem::take(&mut self.frame.due) {
            self.count();
            self.frame.health.send(&self.frame.report)?;
        }
        Ok(())
    }

    fn part(&mut self) -> &mut dyn Part {
        self
    }
}

impl<I: Sample, O: Sample> Part for Node<'_, I, O> {
    fn count(&mut self) {
        self.frame.count(self.stage.dropped());
    }

    fn report(&self) -> &Report {
        &self.frame.report
    }

    fn input(&mut self) -> Option<&mut InputReport> {
        self.frame.report.inputs.first_mut()
    }

    fn keep_input(&mut self) {
        if let Some(input) = self.frame.report.inputs.first() {
            self.frame.ledger.heard(0, &input.counts, input.position);
        }
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        self.frame.wait_for_receivers(timeout)
    }

    fn finish(&mut self) -> Result<(), StageError> {
        let Self { frame, stage } = self;
        let (turn, out) = (&frame.turn, &mut frame.out);
        turn.of(frame.place, || stage.finish(out))?;
        frame.end()?;
        self.count();
        self.frame.health.end(&self.frame.report)?;
        Ok(())
    }

    fn wait_until_taken(&mut self, timeout: Duration) -> Result<(), LinkError> {
        self.frame.wait_until_taken(timeout)
    }

    fn behind(
        &mut self,
        visit: &mut dyn FnMut(&mut dyn Part) -> Result<(), LinkError>,
    ) -> Result<(), LinkError> {
        self.frame.behind(visit)
    }
}
