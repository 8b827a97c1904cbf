//! Health reports, scheduled by stream time.

use super::report::Report;
use crate::sample::{Header, Health, Name};

/// Stream time between two reports.
/// Resolution: size of the archive, against the detection delay of a loss.
const SECOND_NS: i64 = 1_000_000_000;

/// Schedules the [`Health`] samples of a stage, and fills them.
pub(super) struct HealthClock {
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

    /// Stamp of the newest sample \[ns since the epoch\].
    pub fn stamp_ns(&self) -> i64 {
        self.newest.stamp_ns
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
