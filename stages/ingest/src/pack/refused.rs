//! Reports of messages that were refused.

use tauscope_archive::Twice;
use tauscope_session::{Effect, Finding, Gather, Unusable};

use super::Packer;

/// Findings that are listed in one report.
/// Resolution: length of the message.
const LISTED: usize = 6;
/// Interval of the reports while a live source sends messages that are refused \[ns\].
/// Resolution: what a person reads.
const INTERVAL_NS: i64 = 60_000_000_000;

/// Time of the newest report, and the number of refused values and messages by then.
#[derive(Debug, Default)]
pub(super) struct Reported {
    count: u64,
    stamp_ns: Option<i64>,
}

impl Reported {
    /// Whether a live source has something to report: `count` values or messages were refused by now.
    fn is_due(&mut self, count: u64, now_ns: i64) -> bool {
        let lately = (self.stamp_ns).is_some_and(|before_ns| now_ns - before_ns < INTERVAL_NS);
        if count == self.count || lately {
            return false;
        }
        self.count = count;
        self.stamp_ns = Some(now_ns);
        true
    }
}

impl Packer {
    /// The first joint, and its field, that came in the states and was never finite.
    pub fn never_finite(&self) -> Option<(String, &'static str)> {
        self.assembler.never_finite()
    }

    /// The joint that messages name more than once, if they do.
    pub fn twice(&self) -> Option<Twice> {
        self.assembler.twice()
    }

    /// Findings about what was refused, in one sentence.
    pub fn refused(&self) -> Option<String> {
        let refused = self.findings().into_iter().filter(|finding| {
            finding.effect() >= Effect::Loss || matches!(finding, Finding::Dropouts { .. })
        });
        let mut all: Vec<String> = refused.map(|finding| finding.to_string()).collect();
        let more = all.len().saturating_sub(LISTED);
        all.truncate(LISTED);
        if more > 0 {
            all.push(format!("{more} more findings of this kind"));
        }
        (!all.is_empty()).then(|| all.join("; "))
    }

    /// Report for a live source: at the first refused message, then at intervals while more are refused.
    pub fn newly_refused(&mut self, now_ns: i64) -> Option<String> {
        let sides: u64 = [&self.command, &self.reference]
            .map(Gather::bad)
            .iter()
            .sum();
        let count = self.assembler.refused() + sides;
        if self.reported.is_due(count, now_ns) {
            return self.refused();
        }
        None
    }

    /// Reports, after the last message, why there was no sample if there was none.
    ///
    /// # Errors
    /// What kept every message from becoming a sample.
    pub fn verdict(&self) -> Result<(), Unusable> {
        if self.packed > 0 || !self.pending.is_empty() {
            return Ok(());
        }
        Err(self.assembler.unusable())
    }
}
