//! The loop around a source.

use std::time::{Duration, Instant};

use super::health::HealthClock;
use super::report::{Outcome, Poster, Report};
use super::stage::Out;
use super::{Context, TAKEN_WITHIN};
use crate::link::Sender;
use crate::sample::{Health, Sample};
use crate::stage::{Progress, Source, StageError};

/// How long a source that has nothing now is left alone.
/// Resolution: the delay of a sample, against how often the process wakes up.
const IDLE: Duration = Duration::from_millis(1);
/// How often a source is asked whether it is in trouble.
const ASK_EVERY: Duration = Duration::from_millis(500);

/// Runs `source` into `output` until it ends or is told to stop. When it fails its stream gets no
/// end: it may be started again.
pub fn run_source<T: Sample>(
    context: &Context,
    source: &mut dyn Source<T>,
    output: &mut dyn Sender<T>,
    health: &mut dyn Sender<Health>,
) -> Report {
    let mut shell = SourceShell {
        context,
        health: HealthClock::new(health, &context.stage, context.restarts),
        poster: Poster::new(context.board.clone()),
        report: Report {
            stage: context.stage.clone(),
            ..Report::default()
        },
        emitted: Instant::now(),
        asked: Instant::now(),
    };
    let outcome = shell
        .run(source, output)
        .unwrap_or_else(|error| Outcome::of(&error));
    shell.count(source, output);
    shell.report.outcome = Some(outcome);
    shell.poster.post(&shell.report);
    shell.report
}

struct SourceShell<'a> {
    context: &'a Context,
    health: HealthClock<&'a mut dyn Sender<Health>>,
    poster: Poster,
    report: Report,
    /// When the newest sample went out, or the start.
    emitted: Instant,
    /// When the source was last asked whether it is in trouble.
    asked: Instant,
}

impl SourceShell<'_> {
    fn run<T: Sample>(
        &mut self,
        source: &mut dyn Source<T>,
        output: &mut dyn Sender<T>,
    ) -> Result<Outcome, StageError> {
        let outcome = self.feed(source, output)?;
        output.end()?;
        self.count(source, output);
        self.health.end(&self.report)?;
        self.report.untaken =
            output.wait_until_taken(TAKEN_WITHIN)? + self.health.wait_until_taken(TAKEN_WITHIN)?;
        Ok(outcome)
    }

    fn feed<T: Sample>(
        &mut self,
        source: &mut dyn Source<T>,
        output: &mut dyn Sender<T>,
    ) -> Result<Outcome, StageError> {
        loop {
            if self.context.stop.is_stopped() {
                return Ok(Outcome::Stopped);
            }
            let mut out = Out::new(output);
            let progress = source.step(&mut out)?;
            let newest = out.newest;
            let due = newest.is_some_and(|header| self.health.note(&header));
            self.ask(source, newest.is_some());
            if due || self.poster.is_due() {
                self.count(source, output);
                self.poster.post(&self.report);
            }
            if due {
                self.health.send(&self.report)?;
            }
            match progress {
                Progress::More => {}
                Progress::Idle => std::thread::sleep(IDLE),
                Progress::End => return Ok(Outcome::Ended),
            }
        }
    }

    /// Asks the source now and then whether it is in trouble; one that gives samples again is asked at once.
    fn ask<T: Sample>(&mut self, source: &mut dyn Source<T>, emitted: bool) {
        let now = Instant::now();
        if emitted {
            self.emitted = now;
        }
        let is_over = emitted && self.report.trouble.is_some();
        if is_over || now.duration_since(self.asked) >= ASK_EVERY {
            self.asked = now;
            self.report.trouble = source.trouble(now.duration_since(self.emitted));
        }
    }

    fn count<T: Sample>(&mut self, source: &dyn Source<T>, output: &dyn Sender<T>) {
        let report = &mut self.report;
        report.count_output(output.counts());
        report.refused = source.dropped();
        report.received = report.emitted + report.refused;
        report.fraction_done = source.fraction_done();
        report.stamp_ns = self.health.stamp_ns();
    }
}
