//! State of one publisher instance of a cell.

use std::collections::BTreeMap;

use tauscope_bus::clock::ClockFilter;
use tauscope_publish::message::StatusMessage;

use super::{Effect, Now};

/// Interval between clock queries to a cell \[ms\].
/// Resolution: traffic, against the delay until a change of the clock is reported.
const CLOCK_EVERY_MS: u64 = 10_000;
/// Interval between the first clock queries \[ms\], and the number of measurements until then.
/// Resolution: a first burst as in NTP.
const CLOCK_BURST: (u64, usize) = (900, 4);

/// A publisher instance. Two that send at a time are tracked separately, so that their statuses do not look like
/// restarts.
#[derive(Debug, Default)]
pub struct Life {
    /// Number of the last record.
    pub records: u64,
    /// Lost samples by stage, as last reported; `None` before the first status.
    lost: Option<BTreeMap<String, u64>>,
    pub clock: ClockFilter,
    /// Time of the last clock query \[ms\].
    clock_asked: Option<u64>,
}

impl Life {
    /// Processes a status of the cell `name`.
    pub fn take(
        &mut self,
        name: &str,
        status: &StatusMessage,
        now: Now,
        effects: &mut Vec<Effect>,
    ) {
        let every = match CLOCK_BURST {
            (soon_ms, times) if self.clock.len() < times => soon_ms,
            _ => CLOCK_EVERY_MS,
        };
        let is_due = |asked: u64| now.running_ms.saturating_sub(asked) >= every;
        if self.clock_asked.is_none_or(is_due) && !status.ended {
            self.clock_asked = Some(now.running_ms);
            let cell = name.to_owned();
            effects.push(Effect::AskClock { cell });
        }
        self.count_losses(name, status, effects);
        if status.last_record > self.records {
            effects.push(Effect::AskRecords {
                cell: name.to_owned(),
                after: self.records,
            });
        }
    }

    fn count_losses(&mut self, name: &str, status: &StatusMessage, effects: &mut Vec<Effect>) {
        let stages = status.stages.iter();
        let told = stages.map(|stage| (stage.stage.clone(), stage.dropped));
        let told: BTreeMap<String, u64> = told.collect();
        // Losses before the first status were reported earlier, or their time is unknown.
        if let Some(known) = &self.lost {
            for (stage, dropped) in &told {
                // A restarted stage counts from 0.
                let samples = dropped.saturating_sub(known.get(stage).copied().unwrap_or(0));
                if samples > 0 {
                    effects.push(Effect::Lost {
                        cell: name.to_owned(),
                        stage: stage.clone(),
                        samples,
                    });
                }
            }
        }
        self.lost = Some(told);
    }

    /// Returns the number of samples that its stages have lost.
    pub fn lost_samples(&self) -> u64 {
        let lost = self.lost.iter().flat_map(BTreeMap::values);
        lost.fold(0, |sum, lost| sum.saturating_add(*lost))
    }
}
