//! Run loops of a sink: one thread for each input with notifications, and one for all polled inputs.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::health::HealthSender;
use super::report::{InputReport, Outcome, Poster, Report};
use super::{Context, Ledger, Stop, TAKEN_WITHIN, TICK};
use crate::link::{MAX_DEPTH, Received, Sender};
use crate::sample::{Health, SampleRef};
use crate::seat::AnyReceiver;
use crate::stage::{Sink, StageError};

/// A stream that a sink receives.
pub struct SinkInput {
    /// Name of the stage that emits the stream.
    pub from: String,
    /// Receiving end of the link.
    pub receiver: Box<dyn AnyReceiver>,
    /// Polling interval, if no notification wakes the receiver.
    pub looks: Option<Duration>,
}

/// Runs `sink` until all its inputs have ended or a stop is requested. On a stop request it first processes the
/// samples that have arrived. Samples are passed in place, one at a time, in the order of arrival.
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
    // A failure of one input also ends the others, without setting the caller's stop request.
    let broken = Stop::new();
    let ears = inputs.into_iter().enumerate().map(|(index, input)| Ear {
        index,
        input,
        left_to_take: MAX_DEPTH,
        has_ended: false,
    });
    let (calm, woken): (Vec<Ear>, Vec<Ear>) = ears.partition(|ear| ear.input.looks.is_some());
    let pause = calm.iter().filter_map(|ear| ear.input.looks).min();
    let calm = Mutex::new(calm);
    let hall = Hall {
        context,
        shell: &shared,
        broken: &broken,
        calm: &calm,
    };
    std::thread::scope(|scope| {
        let hall = &hall;
        if let Some(pause) = pause {
            scope.spawn(move || hall.settle(hall.look(pause)));
        }
        for mut ear in woken {
            scope.spawn(move || hall.settle(hall.hear(&mut ear)));
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
    /// Time of the last sample or idle call.
    active: Instant,
    failure: Option<StageError>,
    ledger: &'a Ledger,
}

/// State shared by the threads of a sink.
struct Hall<'a, 's> {
    context: &'a Context,
    shell: &'a Mutex<SinkShell<'s>>,
    broken: &'a Stop,
    /// Polled inputs. Locked before the shell.
    calm: &'a Mutex<Vec<Ear>>,
}

/// One input.
struct Ear {
    index: usize,
    input: SinkInput,
    /// Largest number of samples to process after a stop request.
    left_to_take: usize,
    has_ended: bool,
}

impl Hall<'_, '_> {
    fn settle(&self, heard: Result<(), StageError>) {
        if let Err(error) = heard {
            self.broken.stop();
            lock(self.shell).failure.get_or_insert(error);
        }
    }

    /// Receives an input with notifications to its end.
    fn hear(&self, ear: &mut Ear) -> Result<(), StageError> {
        while !self.broken.is_stopped() && !ear.has_ended {
            if self.take(ear, TICK, true)? == Received::Nothing {
                lock(self.shell).idle()?;
            }
        }
        Ok(())
    }

    /// Polls the inputs without notifications to their ends.
    fn look(&self, pause: Duration) -> Result<(), StageError> {
        while !self.broken.is_stopped() {
            let is_over = {
                let mut calm = self.calm();
                self.drain(&mut calm)?;
                calm.iter().all(|ear| ear.has_ended)
            };
            if is_over {
                break;
            }
            lock(self.shell).idle()?;
            if !self.context.stop.is_stopped() {
                std::thread::sleep(pause);
            }
        }
        Ok(())
    }

    /// Processes the available samples of the polled inputs.
    fn drain(&self, calm: &mut [Ear]) -> Result<(), StageError> {
        for ear in calm {
            let mut left = MAX_DEPTH;
            while !ear.has_ended && left > 0 && !self.broken.is_stopped() {
                if self.take(ear, Duration::ZERO, false)? == Received::Nothing {
                    break;
                }
                left -= 1;
            }
        }
        Ok(())
    }

    /// Processes a sample, if one arrives in time. Before an urgent sample of an input with notifications it drains
    /// the polled inputs, whose samples are older.
    fn take(&self, ear: &mut Ear, within: Duration, woken: bool) -> Result<Received, StageError> {
        let stopped = self.context.stop.is_stopped();
        let within = if stopped { Duration::ZERO } else { within };
        let Ear { index, input, .. } = ear;
        let mut accepted = Ok(());
        let received = input.receiver.receive(within, &mut |sample| {
            if woken && sample.is_urgent() {
                accepted = self.drain(&mut self.calm());
            }
            if accepted.is_ok() {
                accepted = lock(self.shell).accept(*index, &input.from, sample);
            }
        })?;
        accepted?;
        let mut shell = lock(self.shell);
        let shell = &mut *shell;
        let report = &mut shell.report.inputs[*index];
        report.counts = input.receiver.counts();
        report.position = input.receiver.position();
        shell.ledger.heard(*index, &report.counts, report.position);
        match received {
            Received::End => {
                report.ended = true;
                ear.has_ended = true;
            }
            Received::Sample if stopped && ear.left_to_take > 0 => ear.left_to_take -= 1,
            _ if stopped => ear.has_ended = true,
            Received::Sample | Received::Nothing => {}
        }
        Ok(received)
    }

    // Only the sink may panic while this lock is held, and its panic ends the whole scope.
    fn calm(&self) -> MutexGuard<'_, Vec<Ear>> {
        self.calm.lock().unwrap_or_else(PoisonError::into_inner)
    }
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

// A panic of the sink ends its thread and the whole scope, so that an inconsistent state is never read.
fn lock<'a, 's>(shared: &'a Mutex<SinkShell<'s>>) -> MutexGuard<'a, SinkShell<'s>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
