//! The root of a stage group: a source, or a link.

use std::time::{Duration, Instant};

use super::node::{Branch, Frame, Outlet, Part};
use super::{Opening, Post, Turn};
use crate::link::{LinkError, MAX_DEPTH, Received, Receiver};
use crate::sample::Sample;
use crate::shell::TICK;
use crate::shell::report::{InputReport, Outcome, Report};
use crate::stage::{Progress, Source, StageError};

/// Sleep after a step in which a source has no data.
/// Resolution: the delay of a sample, against the number of wake-ups.
const IDLE: Duration = Duration::from_millis(1);
/// Interval at which a source is checked for trouble.
const ASK_EVERY: Duration = Duration::from_millis(500);

/// Origin of the samples of a stage group.
pub(super) trait Root {
    /// Opens the input link, if there is one.
    fn open(&mut self) -> Result<(), LinkError>;
    /// Processes the next samples, and returns the outcome at the end.
    fn turn(&mut self, stopped: bool) -> Result<Option<Outcome>, StageError>;
    /// Updates the part of the first stage's report that only the root knows.
    fn count(&mut self);
    fn part(&mut self) -> &mut dyn Part;
}

pub(super) struct SourceRoot<'a, T: Sample> {
    frame: Frame<'a, T>,
    source: Box<dyn Source<T> + 'a>,
    /// Time of the newest sample, or of the start.
    emitted: Instant,
    /// Time of the last check for trouble.
    asked: Instant,
}

impl<'a, T: Sample> SourceRoot<'a, T> {
    pub fn new(
        turn: &Turn,
        post: Post<'a>,
        source: Box<dyn Source<T> + 'a>,
        out: Outlet<'a, T>,
    ) -> Self {
        Self {
            frame: Frame::new(turn, post, out),
            source,
            emitted: Instant::now(),
            asked: Instant::now(),
        }
    }

    /// Checks the source for trouble at a fixed interval, and at once when it emits samples again.
    fn ask(&mut self, emitted: bool) {
        let now = Instant::now();
        if emitted {
            self.emitted = now;
        }
        let report = &mut self.frame.report;
        let is_over = emitted && report.trouble.is_some();
        if is_over || now.duration_since(self.asked) >= ASK_EVERY {
            self.asked = now;
            report.trouble = self.source.trouble(now.duration_since(self.emitted));
        }
    }
}

impl<T: Sample> Root for SourceRoot<'_, T> {
    fn open(&mut self) -> Result<(), LinkError> {
        Ok(())
    }

    fn turn(&mut self, stopped: bool) -> Result<Option<Outcome>, StageError> {
        if stopped {
            return Ok(Some(Outcome::Stopped));
        }
        let Self { frame, source, .. } = self;
        let mut progress = Progress::More;
        let (turn, out) = (&frame.turn, &mut frame.out);
        turn.of(frame.place, || {
            progress = source.step(out)?;
            Ok(())
        })?;
        let newest = frame.out.take_newest();
        let due = newest.is_some_and(|header| frame.health.note(&header));
        self.ask(newest.is_some());
        if due {
            Part::count(self);
            self.frame.health.send(&self.frame.report)?;
        }
        Ok(match progress {
            Progress::More => None,
            Progress::Idle => {
                std::thread::sleep(IDLE);
                None
            }
            Progress::End => Some(Outcome::Ended),
        })
    }

    fn count(&mut self) {}

    fn part(&mut self) -> &mut dyn Part {
        self
    }
}

impl<T: Sample> Part for SourceRoot<'_, T> {
    fn count(&mut self) {
        self.frame.count(self.source.dropped());
        let report = &mut self.frame.report;
        report.received = report.emitted + report.refused;
        report.fraction_done = self.source.fraction_done();
    }

    fn report(&self) -> &Report {
        &self.frame.report
    }

    fn input(&mut self) -> Option<&mut InputReport> {
        None
    }

    fn keep_input(&mut self) {}

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        self.frame.wait_for_receivers(timeout)
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.frame.end()?;
        Part::count(self);
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

pub(super) struct Linked<'a, I: Sample> {
    first: Box<dyn Branch<I> + 'a>,
    open: Option<Opening<'a, I>>,
    input: Option<Box<dyn Receiver<I> + 'a>>,
    /// The input stream has ended.
    ended: bool,
    /// Largest number of samples to process after a stop request.
    left_to_take: usize,
}

impl<'a, I: Sample> Linked<'a, I> {
    pub fn new(first: Box<dyn Branch<I> + 'a>, open: Opening<'a, I>) -> Self {
        Self {
            first,
            open: Some(open),
            input: None,
            ended: false,
            left_to_take: MAX_DEPTH,
        }
    }
}

impl<I: Sample> Root for Linked<'_, I> {
    fn open(&mut self) -> Result<(), LinkError> {
        if let Some(open) = self.open.take() {
            self.input = Some(open()?);
        }
        Ok(())
    }

    /// Ends with the input or, after a stop request, once the samples that have arrived are processed.
    fn turn(&mut self, stopped: bool) -> Result<Option<Outcome>, StageError> {
        let Some(input) = &mut self.input else {
            return Ok(Some(Outcome::Stopped));
        };
        let timeout = if stopped { Duration::ZERO } else { TICK };
        let mut heard = Ok(());
        let first = &mut self.first;
        let received = input.receive(timeout, &mut |sample| heard = first.hear(sample))?;
        heard?;
        self.ended = received == Received::End;
        self.count();
        self.first.tell()?;
        Ok(match received {
            Received::End => Some(Outcome::Ended),
            Received::Sample if stopped && self.left_to_take > 0 => {
                self.left_to_take -= 1;
                None
            }
            _ if stopped => Some(Outcome::Stopped),
            Received::Sample | Received::Nothing => None,
        })
    }

    fn count(&mut self) {
        let Some(receiver) = &self.input else { return };
        if let Some(input) = self.first.part().input() {
            input.counts = receiver.counts();
            input.position = receiver.position();
            input.ended = self.ended;
        }
        self.first.part().keep_input();
    }

    fn part(&mut self) -> &mut dyn Part {
        self.first.part()
    }
}
