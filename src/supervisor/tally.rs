//! What a stage has done over all its lives.

use tauscope_bus::ReceiverCounts;
use tauscope_bus::shell::Report;

/// The sum of the reports of all lives.
#[derive(Debug, Default)]
pub struct Tally {
    /// Of the lives before this one.
    before: Sums,
    /// The newest report of this life.
    newest: Report,
    /// Whether it ever reported.
    heard: bool,
}

/// Sums of what a stage has counted.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sums {
    /// Samples that went out.
    pub emitted: u64,
    /// Samples that the stage had to refuse.
    pub refused: u64,
    /// Samples that those who keep all did not get.
    pub undelivered: u64,
    /// Files that a recorder has completed.
    pub files_completed: u64,
    /// Each input, in the order of the seat.
    pub inputs: Vec<ReceiverCounts>,
}

impl Tally {
    /// Takes a report of this life.
    pub fn note(&mut self, report: Report) {
        self.newest = report;
        self.heard = true;
    }

    /// The newest report of this life.
    pub fn newest(&self) -> &Report {
        &self.newest
    }

    /// Closes this life and returns its last report.
    pub fn end_life(&mut self) -> Report {
        self.before = self.sums();
        std::mem::take(&mut self.newest)
    }

    /// Whether the stage ever said what it has done; a program that is not ours may not.
    pub fn is_known(&self) -> bool {
        self.heard
    }

    /// The sums over all lives.
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
            sum.received += input.counts.received;
            sum.lost += input.counts.lost;
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use tauscope_bus::shell::InputReport;

    use super::*;

    fn report(received: u64, lost: u64) -> Report {
        let counts = ReceiverCounts { received, lost };
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
                lost: 3
            }]
        );
    }
}
