//! What one life of a cell's publisher has told so far.

use std::collections::BTreeMap;

use tauscope_bus::clock::ClockFilter;
use tauscope_publish::message::StatusMessage;

use super::{Effect, Now};

/// How often a cell is asked for its clock \[ms\], and how often until it was so many times.
/// Resolution: traffic, against how soon a clock that was set is told of; a first burst as of NTP.
const CLOCK_EVERY_MS: u64 = 10_000;
const CLOCK_BURST: (u64, usize) = (900, 4);

/// A life of a publisher. Two that speak at a time are not taken for one that begins with each status.
#[derive(Debug, Default)]
pub struct Life {
    /// The last number of a record.
    pub records: u64,
    /// Lost samples by stage, as last told; `None` before the first status.
    lost: Option<BTreeMap<String, u64>>,
    pub clock: ClockFilter,
    /// When it was asked for its clock \[ms\].
    clock_asked: Option<u64>,
}

impl Life {
    /// Takes a status of the cell `name`.
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
        // What was lost before this host first heard of the life was told then, or nobody knows when it was.
        if let Some(known) = &self.lost {
            for (stage, dropped) in &told {
                // A stage that was started again counts from 0.
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

    /// Samples that its stages have lost.
    pub fn lost_samples(&self) -> u64 {
        let lost = self.lost.iter().flat_map(BTreeMap::values);
        lost.fold(0, |sum, lost| sum.saturating_add(*lost))
    }
}
