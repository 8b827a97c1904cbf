//! Counts of a stage over all its incarnations.

use tauscope_bus::ReceiverCounts;
use tauscope_bus::shell::{Account, InputReport, Report};

/// Sum of the reports of all incarnations.
#[derive(Debug, Default)]
pub struct Tally {
    /// Sums of earlier incarnations.
    before: Sums,
    /// Newest report of this incarnation.
    newest: Report,
    /// Whether a report was ever received.
    heard: bool,
}

/// Sums of what a stage has counted.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sums {
    /// Samples that went out.
    pub emitted: u64,
    /// Samples that the stage refused.
    pub refused: u64,
    /// Samples not delivered to receivers that keep all samples.
    pub undelivered: u64,
    /// Files that a recorder has completed.
    pub files_completed: u64,
    /// Counts of each input, in the order of the seat.
    pub inputs: Vec<ReceiverCounts>,
}

impl Tally {
    /// Sets the newest report of this incarnation.
    pub fn note(&mut self, report: Report) {
        self.newest = report;
        self.heard = true;
    }

    /// Adds the counts of a dead stage since its last report; `from` are the senders of its inputs.
    pub fn settle<'a>(&mut self, account: &Account, from: impl Iterator<Item = &'a str>) {
        let Self { newest, heard, .. } = self;
        *heard |= account.emitted > 0 || account.inputs.iter().any(|(it, _)| it.received > 0);
        newest.emitted = newest.emitted.max(account.emitted);
        if account.emitted > 0 {
            newest.stamp_ns = account.stamp_ns;
        }
        if newest.inputs.is_empty() {
            let input = |from: &str| InputReport {
                from: from.to_owned(),
                ..InputReport::default()
            };
            newest.inputs = from.map(input).collect();
        }
        for (input, (counts, position)) in newest.inputs.iter_mut().zip(&account.inputs) {
            if counts.received >= input.counts.received {
                input.counts = *counts;
                input.position = position.or(input.position);
            }
        }
    }

    /// Returns the newest report of this incarnation.
    pub fn newest(&self) -> &Report {
        &self.newest
    }

    /// Ends this incarnation and returns its last report.
    pub fn end_life(&mut self) -> Report {
        self.before = self.sums();
        std::mem::take(&mut self.newest)
    }

    /// Returns whether the stage ever reported its counts; an external program may not.
    pub fn is_known(&self) -> bool {
        self.heard
    }

    /// Returns the sums over all incarnations.
    pub fn sums(&self) -> Sums {
        let mut sums = self.before.clone();
        sums.emitted += self.newest.emitted;
        sums.refused += self.newest.refused;
        sums.undelivered += self.newest.undelivered;
        sums.files_completed += self.newest.files_completed;
        let inputs = &self.newest.inputs;
        sums.inputs.resize(
            sums.inputs.len().max(inputs.len()),
            ReceiverCounts::default(),
        );
        for (sum, input) in sums.inputs.iter_mut().zip(inputs) {
            let counts = input.counts;
            sum.received += counts.received;
            sum.lost = sum.lost.saturating_add(counts.lost);
            sum.refused += counts.refused;
            sum.before += counts.before;
            sum.foreign += counts.foreign;
            sum.broken_off += counts.broken_off;
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(received: u64, lost: u64) -> Report {
        let counts = ReceiverCounts {
            received,
            lost,
            ..ReceiverCounts::default()
        };
        let input = InputReport {
            counts,
            ..InputReport::default()
        };
        Report {
            emitted: received,
            refused: 1,
            inputs: vec![input],
            ..Report::default()
        }
    }

    #[test]
    fn what_a_dead_stage_had_noted_beyond_its_last_report_counts() {
        let mut tally = Tally::default();
        tally.note(report(10, 1));
        let position = tauscope_bus::Position {
            instance: 5,
            next: 14,
        };
        let counts = ReceiverCounts {
            received: 13,
            lost: 1,
            ..ReceiverCounts::default()
        };
        let account = Account {
            emitted: 12,
            stamp_ns: 77,
            inputs: vec![(counts, Some(position))],
        };
        tally.settle(&account, ["twin"].into_iter());
        let last = tally.end_life();
        assert_eq!((last.emitted, last.stamp_ns), (12, 77));
        assert_eq!(last.inputs[0].position, Some(position));
        // A stage that died before its first report.
        tally.settle(&account, ["twin"].into_iter());
        assert_eq!(tally.newest().inputs[0].from, "twin");
        assert_eq!(
            (tally.sums().emitted, tally.sums().inputs[0].received),
            (24, 26)
        );
    }

    #[test]
    fn lives_add_up_and_reports_of_one_life_do_not() {
        let mut tally = Tally::default();
        assert!(!tally.is_known());
        tally.note(report(5, 0));
        tally.note(report(10, 1));
        assert_eq!(tally.end_life().emitted, 10);
        tally.note(report(3, 2));
        let sums = tally.sums();
        assert_eq!((sums.emitted, sums.refused), (13, 2));
        assert_eq!(
            sums.inputs,
            [ReceiverCounts {
                received: 13,
                lost: 3,
                ..ReceiverCounts::default()
            }]
        );
    }
}
