//! Health reports, scheduled by stream time.

use super::report::Report;
use crate::link::{LinkError, Sender};
use crate::sample::{Header, Health, Name};

/// Stream time between two reports.
/// Resolution: size of the archive, against the detection delay of a loss.
const SECOND_NS: i64 = 1_000_000_000;

/// Schedules the [`Health`] samples of a stage, and fills them.
pub struct HealthClock {
    stage: Name,
    restarts: u64,
    /// Second of stream time of the newest sample.
    second: Option<i64>,
    newest: Header,
}

impl HealthClock {
    /// Clock of the stage of that name, which was restarted `restarts` times.
    pub fn new(stage: &str, restarts: u64) -> Self {
        Self {
            stage: Name::new(stage),
            restarts,
            second: None,
            newest: Header::default(),
        }
    }

    /// Processes the header of a sample, and returns whether a report is due: at the first sample of each second,
    /// also when the clock jumps back.
    pub fn note(&mut self, header: &Header) -> bool {
        self.newest = *header;
        let second = header.stamp_ns.div_euclid(SECOND_NS);
        let before = self.second.replace(second);
        before.is_some_and(|before| before != second)
    }

    /// Fills a sample from `report`.
    pub fn fill(&self, report: &Report, health: &mut Health) {
        health.header.stamp_ns = self.newest.stamp_ns;
        health.header.received_ns = self.newest.received_ns;
        health.stage = self.stage;
        health.received = report.received;
        health.emitted = report.emitted;
        health.dropped = report.dropped();
        health.restarts = self.restarts;
    }
}

/// Sends a [`Health`] sample once a second of stream time and at the end.
pub(super) struct HealthSender<S> {
    clock: HealthClock,
    out: S,
}

impl<S: Sender<Health>> HealthSender<S> {
    /// Sender of the stage of that name, which was restarted `restarts` times.
    pub fn new(out: S, stage: &str, restarts: u64) -> Self {
        let clock = HealthClock::new(stage, restarts);
        Self { clock, out }
    }

    /// See [`HealthClock::note`].
    pub fn note(&mut self, header: &Header) -> bool {
        self.clock.note(header)
    }

    pub(super) fn stamp_ns(&self) -> i64 {
        self.clock.newest.stamp_ns
    }

    /// Sends a report.
    ///
    /// # Errors
    /// If the link fails.
    pub fn send(&mut self, report: &Report) -> Result<(), LinkError> {
        let clock = &self.clock;
        self.out.send_with(&mut |health| clock.fill(report, health))
    }

    /// Sends the last report, and the end of the stream.
    ///
    /// # Errors
    /// If the link fails.
    pub fn end(&mut self, report: &Report) -> Result<(), LinkError> {
        self.send(report)?;
        self.out.end()
    }

    pub(super) fn wait_for_receivers(
        &mut self,
        timeout: std::time::Duration,
    ) -> Result<usize, LinkError> {
        self.out.wait_for_receivers(timeout)
    }

    pub(super) fn wait_until_taken(
        &mut self,
        timeout: std::time::Duration,
    ) -> Result<usize, LinkError> {
        self.out.wait_until_taken(timeout)
    }
}
