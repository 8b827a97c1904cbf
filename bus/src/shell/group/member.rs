//! A node in its place in a group: its work, its output and its counters.

use std::task::{Poll, Waker};
use std::time::{Duration, Instant};

use super::edge::{Edge, Part};
use super::outlet::Outlet;
use super::turn::Turn;
use super::work::Work;
use crate::link::{LinkError, Position, ReceiverCounts, Sender};
use crate::sample::{Health, SampleKind, SampleRef};
use crate::seat::AnySender;
use crate::shell::Ledger;
use crate::shell::health::HealthClock;
use crate::shell::report::{InputReport, Outcome, Report};
use crate::stage::{Emit as _, Progress, StageError};

/// Time after an idle step of a source that does not wake its thread.
/// Resolution: the delay of a sample, against the number of wake-ups.
const IDLE: Duration = Duration::from_millis(1);

/// Properties of the stage of a node, in addition to its streams.
pub(super) struct Post {
    pub stage: String,
    pub restarts: u64,
    /// Names of the stages whose streams it receives.
    pub inputs: Vec<String>,
    pub health: Option<Box<dyn Sender<Health>>>,
    pub ledger: Ledger,
}

pub(super) struct Member<'a, W: Work> {
    place: usize,
    turn: Turn,
    work: W,
    out: Outlet<'a, W::Out>,
    health: Outlet<'a, Health>,
    clock: HealthClock,
    report: Report,
    /// A health report is due.
    due: bool,
    /// Whether the work wakes its thread for new data.
    wakes: bool,
    /// Number of inputs that are not closed.
    open: usize,
    stopped: bool,
    /// Number of samples at the last look, and the time at which it last changed.
    looked: Option<(u64, Instant)>,
    ledger: Ledger,
}

impl<W: Work> Member<'_, W> {
    pub fn new(
        work: W,
        turn: &Turn,
        post: Post,
        output: Option<AnySender>,
    ) -> Result<Self, LinkError> {
        let output = output.map(|output| output.typed::<W::Out>(&post.stage));
        let inputs = post.inputs.into_iter().map(|from| InputReport {
            from,
            ..InputReport::default()
        });
        let inputs: Vec<InputReport> = inputs.collect();
        let heartbeat = turn.heartbeat();
        Ok(Self {
            place: turn.place(&post.stage),
            turn: turn.clone(),
            work,
            out: Outlet::new(output.transpose()?, post.ledger.clone(), heartbeat.clone()),
            health: Outlet::new(post.health, Ledger::default(), heartbeat),
            clock: HealthClock::new(&post.stage, post.restarts),
            due: false,
            wakes: false,
            open: inputs.len(),
            stopped: false,
            looked: None,
            report: Report {
                stage: post.stage,
                inputs,
                ..Report::default()
            },
            ledger: post.ledger,
        })
    }

    fn send_health(&mut self) -> Result<(), LinkError> {
        let Self {
            clock,
            report,
            health,
            ..
        } = self;
        health.emit(&mut |sample| clock.fill(report, sample))
    }

    /// Samples received or emitted.
    fn moved(&self) -> u64 {
        let received = self.report.inputs.iter();
        let received: u64 = received.map(|input| input.counts.received).sum();
        received + self.out.counts().sent
    }
}

impl<'a, W: Work> Part<'a> for Member<'a, W> {
    fn attach(&mut self, edge: Edge<'a>) -> Result<(), LinkError> {
        let stage = &self.report.stage;
        if W::GIVES.is_none() {
            return Err(LinkError::mismatch(stage, SampleKind::Health, None));
        }
        self.out.attach(stage, edge)
    }

    fn attach_health(&mut self, edge: Edge<'a>) -> Result<(), LinkError> {
        self.health.attach(&self.report.stage, edge)
    }

    fn register(&mut self, waker: &Waker) {
        self.wakes = self.work.register(waker);
    }

    fn step(&mut self) -> Result<Progress, StageError> {
        let Self {
            work, out, turn, ..
        } = self;
        let mut progress = Progress::More;
        turn.of(self.place, || {
            progress = work.step(out)?;
            Ok(())
        })?;
        if let Some(newest) = out.take_newest() {
            self.due = self.clock.note(&newest);
            self.tell()?;
        }
        if progress == Progress::Idle && !self.wakes {
            return Ok(Progress::Until(Instant::now() + IDLE));
        }
        Ok(progress)
    }

    fn accept(&mut self, input: usize, sample: SampleRef<'_>) -> Result<(), LinkError> {
        let Self {
            work, out, turn, ..
        } = self;
        let header = sample.header();
        let InputReport { from, counts, .. } = &mut self.report.inputs[input];
        counts.received += 1;
        self.ledger.takes(input, counts.received, header);
        self.due = self.clock.note(header);
        turn.of(self.place, || work.accept(from, sample, out))
    }

    fn tell(&mut self) -> Result<(), LinkError> {
        if std::mem::take(&mut self.due) {
            self.count();
            self.send_health()?;
        }
        Ok(())
    }

    fn count_link(&mut self, input: usize, counts: ReceiverCounts, position: Option<Position>) {
        let report = &mut self.report.inputs[input];
        report.counts = counts;
        report.position = position;
        self.ledger.heard(input, &counts, position);
    }

    fn close(&mut self, input: usize, ended: bool) -> Result<(), StageError> {
        self.report.inputs[input].ended = ended;
        self.stopped |= !ended;
        self.open -= 1;
        if self.open > 0 {
            return Ok(());
        }
        self.finish()
    }

    fn stop(&mut self) {
        self.stopped = true;
    }

    fn finish(&mut self) -> Result<(), StageError> {
        let Self {
            work, out, turn, ..
        } = self;
        let cut_short = self.stopped;
        turn.of(self.place, || work.finish(cut_short, out))?;
        out.end()?;
        self.count();
        self.send_health()?;
        self.health.end()?;
        self.report.outcome = Some(if self.stopped {
            Outcome::Stopped
        } else {
            Outcome::Ended
        });
        Ok(())
    }

    fn maintain(&mut self, now: Instant) -> Result<(), StageError> {
        let moved = self.moved();
        let since = match self.looked {
            Some((before, since)) if before == moved => since,
            _ => now,
        };
        self.looked = Some((moved, since));
        self.report.trouble = self.work.trouble(now.duration_since(since));
        if since == now || self.report.outcome.is_some() {
            return Ok(());
        }
        let Self { work, turn, .. } = self;
        Ok(turn.of(self.place, || work.idle())?)
    }

    fn fraction_done(&self) -> Option<f64> {
        let done = self.report.outcome.is_some() && self.report.inputs.is_empty();
        if done {
            Some(1.0)
        } else {
            self.work.fraction_done()
        }
    }

    fn count(&mut self) {
        self.report.count_output(self.out.counts());
        self.report.count_inputs();
        self.work.count(&mut self.report);
        self.report.stamp_ns = self.clock.stamp_ns();
    }

    fn report(&self) -> &Report {
        &self.report
    }

    fn missing_receivers(&mut self) -> Result<usize, LinkError> {
        Ok(self.health.missing_receivers()? + self.out.missing_receivers()?)
    }

    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<()>, LinkError> {
        let (data, health) = (
            self.out.poll_taken(timeout)?,
            self.health.poll_taken(timeout)?,
        );
        let (Poll::Ready(data), Poll::Ready(health)) = (data, health) else {
            return Ok(Poll::Pending);
        };
        self.report.untaken = data + health;
        Ok(Poll::Ready(()))
    }
}
