//! The wall: what is known of each cell, how fresh that is, and what follows from it.
//!
//! A pure state machine. In go tokens, statuses and records of cells and the ticks of a clock; out come what somebody
//! has to do, and [`Snapshot`]s. A cell is [`State::Running`] only while its token is there, its status is fresh, samples
//! arrive and a detector judges them.

mod cell;
mod latch;
mod life;
mod snapshot;
mod state;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use tauscope_bus::clock::Offset;
use tauscope_publish::message::{Record, RecordMessage, StatusMessage};

pub use cell::Remembered;
use cell::Watched;
pub use snapshot::{CellView, ResidualView, Snapshot, Totals};
pub use state::{Severity, StaleWhy, State, UnknownWhy};

/// Resolution: ten times the thousand cells that a host is meant for.
pub const MAX_CELLS: usize = 10_000;
/// For so long after its token went, the last status of a cell may still come \[ms\].
/// Resolution: both leave the cell together; one that was killed is still known within half a second.
pub const PARTING_MS: u64 = 200;
/// A status comes once a second: three that are missing are a silence \[ms\].
/// Resolution: a pause of a busy host is shorter, and what is cut off is known within 5 s.
pub const STALE_AFTER_MS: u64 = 3_500;
/// So long after its start a fleet host calls a cell of an earlier life lost that is not there \[ms\].
/// Resolution: tokens and statuses are there within seconds of the connection.
pub const BACK_AFTER_MS: u64 = 10_000;
/// Clocks that differ by more are told of \[ns\].
/// Resolution: who lays the records of two cells side by side reads tenths of a second.
pub const CLOCK_LIMIT_NS: i64 = 100_000_000;

/// A time by two clocks: one that only runs, to judge ages by, and one that people read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Now {
    /// Since the fleet host started \[ms\].
    pub running_ms: u64,
    /// By the clock of the fleet host \[ns since the epoch\].
    pub unix_ns: i64,
}

/// What the wall is told.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A publisher of the cell lives: its token is there.
    Alive {
        /// The cell.
        cell: String,
        /// The publisher's life.
        instance: String,
    },
    /// It does not live any more.
    Gone {
        /// The cell.
        cell: String,
        /// The publisher's life.
        instance: String,
    },
    /// How a cell fares.
    Status {
        /// The cell.
        cell: String,
        /// What it says.
        status: Box<StatusMessage>,
    },
    /// How a cell fares, or fared, when it was asked: the answer may come behind what it has said since.
    Answer {
        /// The cell.
        cell: String,
        /// What it says.
        status: Box<StatusMessage>,
    },
    /// A contact or a change of the arm.
    Record {
        /// The cell.
        cell: String,
        /// What it says.
        record: Box<RecordMessage>,
    },
    /// The cell has answered with all records that it keeps, up to this number.
    AllRecords {
        /// The cell.
        cell: String,
        /// The publisher's life.
        instance: String,
        /// The last number.
        number: u64,
    },
    /// The cell has answered what its clock says.
    Clock {
        /// The cell.
        cell: String,
        /// The publisher's life.
        instance: String,
        /// How far it is ahead of this host's.
        offset: Offset,
    },
    /// A message that is none, and why.
    Refused(&'static str),
    /// So many Zenoh sessions are reached.
    Reached(usize),
}

/// What somebody has to do.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// The state of a cell has changed.
    Changed {
        /// The cell.
        cell: String,
        /// What it was.
        before: State,
        /// What it is.
        now: State,
    },
    /// A cell of an earlier life of the fleet host was lost before this one began.
    Missing {
        /// The cell.
        cell: String,
        /// What it is.
        now: State,
    },
    /// A contact or a change was told, for the first time or with more known of it.
    Recorded {
        /// The cell.
        cell: String,
        /// The publisher's life.
        instance: String,
        /// The record's number in that life.
        number: u64,
        /// When it was told, by the clock of the cell's computer \[ns since the epoch\].
        told_ns: i64,
        /// The record.
        record: Box<Record>,
    },
    /// A cell has lost samples.
    Lost {
        /// The cell.
        cell: String,
        /// The stage that misses them.
        stage: String,
        /// How many more.
        samples: u64,
    },
    /// Records are missing: ask the cell for those behind this number.
    AskRecords {
        /// The cell.
        cell: String,
        /// The last number that is known.
        after: u64,
    },
    /// Ask the cell what its clock says.
    AskClock {
        /// The cell.
        cell: String,
    },
    /// A cell lives whose status is not known: ask for it.
    AskStatus {
        /// The cell.
        cell: String,
    },
}

impl Effect {
    /// Whether a fleet host keeps it.
    pub fn is_kept(&self) -> bool {
        match self {
            Self::Changed { .. }
            | Self::Missing { .. }
            | Self::Recorded { .. }
            | Self::Lost { .. } => true,
            Self::AskRecords { .. } | Self::AskStatus { .. } | Self::AskClock { .. } => false,
        }
    }
}

/// All cells.
#[derive(Debug, Default)]
pub struct Wall {
    cells: BTreeMap<String, Watched>,
    refused: BTreeMap<&'static str, u64>,
    reached: usize,
    now: Now,
    /// It was looked which cells of an earlier life are missing.
    has_looked: bool,
}

impl Wall {
    /// A wall on which these cells are expected.
    pub fn new(expected: impl IntoIterator<Item = String>) -> Self {
        let mut wall = Self::default();
        for cell in expected.into_iter().take(MAX_CELLS) {
            wall.cells.entry(cell).or_default().expected = true;
        }
        wall
    }

    /// A cell that was seen in an earlier life of the fleet host. `latched`: the life of its publisher that was
    /// latched, and since when \[ns since the epoch\].
    pub fn remember(&mut self, known: Remembered, latched: Option<(String, i64)>) {
        if let Some(cell) = self.cell(&known.cell) {
            cell.remember(known, latched);
        }
    }

    /// Takes what was told at `now`.
    pub fn take(&mut self, event: Event, now: Now) -> Vec<Effect> {
        self.now = now;
        let mut effects = Vec::new();
        let name = match event {
            Event::Refused(reason) => {
                self.refuse(reason);
                return effects;
            }
            Event::Reached(sessions) => {
                self.reached = sessions;
                return self.tick(now);
            }
            Event::Alive { cell, instance } => {
                let Some(watched) = self.cell(&cell) else {
                    return effects;
                };
                if !watched.alive(instance) {
                    self.refuse("too many lives of one cell");
                } else if watched.awaits_status() {
                    effects.push(Effect::AskStatus { cell: cell.clone() });
                }
                cell
            }
            Event::Gone { cell, instance } => {
                if let Some(watched) = self.cells.get_mut(&cell) {
                    watched.gone(&instance, now);
                }
                cell
            }
            Event::Status { cell, status } => {
                let Some(watched) = self.cell(&cell) else {
                    return effects;
                };
                watched.status(&cell, *status, now, &mut effects);
                cell
            }
            Event::Answer { cell, status } => {
                let Some(watched) = self.cell(&cell) else {
                    return effects;
                };
                watched.answer(&cell, *status, now, &mut effects);
                cell
            }
            Event::Record { cell, record } => {
                let Some(watched) = self.cell(&cell) else {
                    return effects;
                };
                watched.record(&cell, *record, &mut effects);
                cell
            }
            Event::Clock {
                cell,
                instance,
                offset,
            } => {
                if let Some(watched) = self.cells.get_mut(&cell) {
                    watched.clock(&instance, offset, now);
                }
                cell
            }
            Event::AllRecords {
                cell,
                instance,
                number,
            } => {
                if let Some(watched) = self.cells.get_mut(&cell) {
                    watched.all_records(&instance, number);
                }
                cell
            }
        };
        let reached = self.reached;
        if let Some(watched) = self.cells.get_mut(&name) {
            effects.extend(watched.settle(&name, reached, now));
        }
        effects
    }

    /// Time goes on: what was fresh may be stale now.
    pub fn tick(&mut self, now: Now) -> Vec<Effect> {
        self.now = now;
        let reached = self.reached;
        let cells = self.cells.iter_mut();
        let settled = cells.filter_map(|(name, watched)| watched.settle(name, reached, now));
        let mut effects: Vec<Effect> = settled.collect();
        if now.running_ms >= BACK_AFTER_MS && !std::mem::replace(&mut self.has_looked, true) {
            let cells = self.cells.iter();
            effects.extend(cells.filter_map(|(name, watched)| watched.missing(name)));
        }
        effects
    }

    /// The state of a cell.
    pub fn state(&self, cell: &str) -> Option<State> {
        let watched = self.cells.get(cell)?;
        Some(watched.state(self.reached, self.now))
    }

    /// The newest status of a cell.
    pub fn status_of(&self, cell: &str) -> Option<&StatusMessage> {
        self.cells.get(cell)?.newest()
    }

    /// All that is known, the worst first.
    pub fn snapshot(&self) -> Snapshot {
        let views = self.cells.iter();
        let views = views.map(|(name, watched)| watched.view(name, self.reached, self.now));
        Snapshot::new(
            self.now,
            self.reached,
            self.refused.clone(),
            views.collect(),
        )
    }

    /// The cell, new or known; refused where there are too many.
    fn cell(&mut self, name: &str) -> Option<&mut Watched> {
        if self.cells.len() >= MAX_CELLS && !self.cells.contains_key(name) {
            self.refuse("too many cells");
            return None;
        }
        Some(self.cells.entry(name.to_owned()).or_default())
    }

    fn refuse(&mut self, reason: &'static str) {
        *self.refused.entry(reason).or_default() += 1;
    }
}
