//! The loop around a stage.

use std::time::Duration;

use super::health::HealthClock;
use super::report::{InputReport, Outcome, Poster, Report};
use super::{Context, TAKEN_WITHIN, TICK};
use crate::link::{LinkError, MAX_DEPTH, Received, Receiver, Sender};
use crate::sample::{Header, Health, Sample};
use crate::stage::{Emit, Stage, StageError};

/// Runs `stage` from `input` to `output` until the input ends or it is told to stop.
///
/// Told to stop, it first deals with what has arrived. When the stage fails its stream gets no end:
/// it may be started again.
pub fn run_stage<I: Sample, O: Sample>(
    context: &Context,
    stage: &mut dyn Stage<I, O>,
    from: &str,
    input: &mut dyn Receiver<I>,
    output: &mut dyn Sender<O>,
    health: &mut dyn Sender<Health>,
) -> Report {
    let mut shell = StageShell {
        context,
        health: HealthClock::new(health, &context.stage, context.restarts),
        poster: Poster::new(context.board.clone()),
        report: Report {
            stage: context.stage.clone(),
            inputs: vec![InputReport {
                from: from.to_owned(),
                ..InputReport::default()
            }],
            ..Report::default()
        },
    };
    let outcome = shell
        .run(stage, input, output)
        .unwrap_or_else(|error| Outcome::of(&error));
    shell.count(stage, input, output);
    shell.report.outcome = Some(outcome);
    shell.poster.post(&shell.report);
    shell.report
}

struct StageShell<'a> {
    context: &'a Context,
    health: HealthClock<&'a mut dyn Sender<Health>>,
    poster: Poster,
    report: Report,
}

impl StageShell<'_> {
    fn run<I: Sample, O: Sample>(
        &mut self,
        stage: &mut dyn Stage<I, O>,
        input: &mut dyn Receiver<I>,
        output: &mut dyn Sender<O>,
    ) -> Result<Outcome, StageError> {
        let outcome = self.feed(stage, input, output)?;
        stage.finish(&mut Out::new(output))?;
        output.end()?;
        self.count(stage, input, output);
        self.health.end(&self.report)?;
        self.report.untaken =
            output.wait_until_taken(TAKEN_WITHIN)? + self.health.wait_until_taken(TAKEN_WITHIN)?;
        Ok(outcome)
    }

    /// Until the input ends, or, once it is to stop, has nothing more that arrived before.
    fn feed<I: Sample, O: Sample>(
        &mut self,
        stage: &mut dyn Stage<I, O>,
        input: &mut dyn Receiver<I>,
        output: &mut dyn Sender<O>,
    ) -> Result<Outcome, StageError> {
        let mut left_to_take = MAX_DEPTH;
        loop {
            let stopped = self.context.stop.is_stopped();
            let timeout = if stopped { Duration::ZERO } else { TICK };
            let mut accepted = Ok(());
            let mut due = false;
            let received = input.receive(timeout, &mut |sample| {
                due = self.health.note(sample.header());
                accepted = stage.accept(sample, &mut Out::new(output));
            })?;
            accepted?;
            if due || self.poster.is_due() {
                self.count(stage, input, output);
                self.poster.post(&self.report);
            }
            if due {
                self.health.send(&self.report)?;
            }
            match received {
                Received::End => {
                    self.report.inputs[0].ended = true;
                    return Ok(Outcome::Ended);
                }
                Received::Sample if stopped && left_to_take > 0 => left_to_take -= 1,
                _ if stopped => return Ok(Outcome::Stopped),
                Received::Sample | Received::Nothing => {}
            }
        }
    }

    fn count<I: Sample, O: Sample>(
        &mut self,
        stage: &dyn Stage<I, O>,
        input: &dyn Receiver<I>,
        output: &dyn Sender<O>,
    ) {
        let report = &mut self.report;
        report.inputs[0].counts = input.counts();
        report.inputs[0].position = input.position();
        report.count_inputs();
        report.count_output(output.counts());
        report.refused = stage.dropped();
        report.stamp_ns = self.health.stamp_ns();
    }
}

/// A link as the stage sees it, which remembers the newest header.
pub(super) struct Out<'a, T> {
    link: &'a mut dyn Sender<T>,
    pub(super) newest: Option<Header>,
}

impl<'a, T: Sample> Out<'a, T> {
    pub(super) fn new(link: &'a mut dyn Sender<T>) -> Self {
        Self { link, newest: None }
    }
}

impl<T: Sample> Emit<T> for Out<'_, T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let newest = &mut self.newest;
        self.link.send_with(&mut |slot| {
            write(slot);
            *newest = Some(*slot.header());
        })
    }
}
