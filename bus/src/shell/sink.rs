//! The loops around a sink: one thread per input.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::health::HealthSender;
use super::report::{InputReport, Outcome, Poster, Report};
use super::{Context, Ledger, Stop, TAKEN_WITHIN, TICK};
use crate::link::{MAX_DEPTH, Received, Sender};
use crate::sample::{Health, SampleRef};
use crate::seat::AnyReceiver;
use crate::stage::{Sink, StageError};

/// A stream that a sink hears.
pub struct SinkInput {
    /// The stage it comes from.
    pub from: String,
    /// The link.
    pub receiver: Box<dyn AnyReceiver>,
}

/// Runs `sink` until all its inputs have ended or it is told to stop; then it first deals with what
/// has arrived. Samples are handed over where they lie, one at a time, in the order of arrival.
pub fn run_sink(
    context: &Context,
    sink: &mut dyn Sink,
    inputs: Vec<SinkInput>,
    health: &mut dyn Sender<Health>,
    ledger: &Ledger,
) -> Report {
    let reports = inputs.iter().map(|input| InputReport {
        from: input.from.clone(),
        ..InputReport::default()
    });
    let shared = Mutex::new(SinkShell {
        health: HealthSender::new(health, &context.stage, context.restarts),
        poster: Poster::new(context.board.clone()),
        report: Report {
            stage: context.stage.clone(),
            inputs: reports.collect(),
            ..Report::default()
        },
        sink,
        active: Instant::now(),
        failure: None,
        ledger,
    });
    // One input's failure ends the others too; the caller's own stop is not touched.
    let broken = Stop::new();
    std::thread::scope(|scope| {
        for (index, input) in inputs.into_iter().enumerate() {
            let (shared, broken) = (&shared, &broken);
            scope.spawn(move || {
                if let Err(error) = hear(context, shared, index, input, broken) {
                    broken.stop();
                    lock(shared).failure.get_or_insert(error);
                }
            });
        }
    });
    let mut shell = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    let outcome = shell
        .complete(context)
        .unwrap_or_else(|error| Outcome::of(&error));
    shell.count();
    shell.report.outcome = Some(outcome);
    shell.poster.post(std::slice::from_ref(&shell.report));
    shell.report
}

struct SinkShell<'a> {
    health: HealthSender<&'a mut dyn Sender<Health>>,
    poster: Poster,
    report: Report,
    sink: &'a mut dyn Sink,
    /// When the sink was last given something.
    active: Instant,
    failure: Option<StageError>,
    ledger: &'a Ledger,
}

/// Hears one input to its end.
fn hear(
    context: &Context,
    shared: &Mutex<SinkShell<'_>>,
    index: usize,
    mut input: SinkInput,
    broken: &Stop,
) -> Result<(), StageError> {
    let mut left_to_take = MAX_DEPTH;
    while !broken.is_stopped() {
        let stopped = context.stop.is_stopped();
        let timeout = if stopped { Duration::ZERO } else { TICK };
        let mut accepted = Ok(());
        let received = input.receiver.receive(timeout, &mut |sample| {
            accepted = lock(shared).accept(index, &input.from, sample);
        })?;
        accepted?;
        let mut shell = lock(shared);
        let report = &mut shell.report.inputs[index];
        report.counts = input.receiver.counts();
        report.position = input.receiver.position();
        let (counts, position) = (report.counts, report.position);
        shell.ledger.heard(index, &counts, position);
        let report = &mut shell.report.inputs[index];
        match received {
            Received::End => {
                report.ended = true;
                return Ok(());
            }
            Received::Sample if stopped && left_to_take > 0 => left_to_take -= 1,
            _ if stopped => return Ok(()),
            Received::Sample => {}
            Received::Nothing => shell.idle()?,
        }
    }
    Ok(())
}

impl SinkShell<'_> {
    fn accept(
        &mut self,
        input: usize,
        from: &str,
        sample: SampleRef<'_>,
    ) -> Result<(), StageError> {
        let received = self.report.inputs[input].counts.received + 1;
        self.ledger.takes(input, received, sample.header());
        self.active = Instant::now();
        self.sink.accept(from, sample)?;
        let due = self.health.note(sample.header());
        if due || self.poster.is_due() {
            self.count();
            self.poster.post(std::slice::from_ref(&self.report));
        }
        if due {
            self.health.send(&self.report)?;
        }
        Ok(())
    }

    fn idle(&mut self) -> Result<(), StageError> {
        if self.active.elapsed() >= TICK {
            self.active = Instant::now();
            self.sink.idle()?;
            self.count();
            self.poster.post(std::slice::from_ref(&self.report));
        }
        Ok(())
    }

    fn complete(&mut self, context: &Context) -> Result<Outcome, StageError> {
        if let Some(error) = self.failure.take() {
            return Err(error);
        }
        context.board.ends();
        if !self.report.inputs.iter().all(|input| input.ended) {
            self.sink.cut_short();
        }
        self.sink.finish()?;
        self.count();
        self.health.end(&self.report)?;
        self.report.untaken = self.health.wait_until_taken(TAKEN_WITHIN)?;
        let ended = self.report.inputs.iter().all(|input| input.ended);
        Ok(if ended || !context.stop.is_stopped() {
            Outcome::Ended
        } else {
            Outcome::Stopped
        })
    }

    fn count(&mut self) {
        self.report.count_inputs();
        self.report.refused = self.sink.dropped();
        let (files, completed) = self.sink.completed_files();
        if self.report.files_completed != completed {
            self.report.files = files.to_vec();
            self.report.files_completed = completed;
        }
        self.report.stamp_ns = self.health.stamp_ns();
    }
}

// A sink that panics takes its thread down, and the scope with it: nobody reads a torn state.
fn lock<'a, 's>(shared: &'a Mutex<SinkShell<'s>>) -> MutexGuard<'a, SinkShell<'s>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
