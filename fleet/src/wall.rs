//! The wall: the state of each cell and the age of its data.
//!
//! A pure state machine. Its inputs are tokens, statuses and records of cells and the ticks of a clock; its outputs
//! are [`Effect`]s and [`Snapshot`]s. A cell is [`State::Running`] only while its token exists, its status is fresh,
//! samples arrive and a detector evaluates them.

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

/// Maximum number of cells.
/// Resolution: ten times the thousand cells that a host is meant for.
pub const MAX_CELLS: usize = 10_000;
/// Grace period after the loss of a token in which the last status of the cell may still arrive \[ms\].
/// Resolution: both leave the cell together; a killed cell is still reported within half a second.
pub const PARTING_MS: u64 = 200;
/// Age of the newest status above which a cell is stale: three missing statuses at one per second \[ms\].
/// Resolution: a pause of a busy host is shorter, and a disconnected cell is reported within 5 s.
pub const STALE_AFTER_MS: u64 = 3_500;
/// Grace period after start before a known but absent cell is reported as lost \[ms\].
/// Resolution: tokens and statuses arrive within seconds of the connection.
pub const BACK_AFTER_MS: u64 = 10_000;
/// Clock offset above which the fleet page shows a warning \[ns\].
/// Resolution: records of two cells are compared to tenths of a second.
pub const CLOCK_LIMIT_NS: i64 = 100_000_000;

/// A time by two clocks: a monotonic one for ages, and the system clock for display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Now {
    /// Monotonic time since the fleet host started \[ms\].
    pub running_ms: u64,
    /// Time by the clock of the fleet host \[ns since the epoch\].
    pub unix_ns: i64,
}

/// An input of the wall.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A publisher of the cell is connected: its token exists.
    Alive {
        /// The cell.
        cell: String,
        /// The publisher instance.
        instance: String,
    },
    /// A publisher of the cell is disconnected: its token is lost.
    Gone {
        /// The cell.
        cell: String,
        /// The publisher instance.
        instance: String,
    },
    /// A periodic status of a cell.
    Status {
        /// The cell.
        cell: String,
        /// The status.
        status: Box<StatusMessage>,
    },
    /// The answer to a status query. It may arrive after a newer periodic status.
    Answer {
        /// The cell.
        cell: String,
        /// The status.
        status: Box<StatusMessage>,
    },
    /// A contact or a change of the arm.
    Record {
        /// The cell.
        cell: String,
        /// The record.
        record: Box<RecordMessage>,
    },
    /// The cell has answered with all records that it keeps, up to this number.
    AllRecords {
        /// The cell.
        cell: String,
        /// The publisher instance.
        instance: String,
        /// The last number.
        number: u64,
    },
    /// The cell has answered a clock query.
    Clock {
        /// The cell.
        cell: String,
        /// The publisher instance.
        instance: String,
        /// Offset of its clock from this host's.
        offset: Offset,
    },
    /// A message that was rejected, with the reason.
    Refused(&'static str),
    /// Number of connected Zenoh sessions.
    Reached(usize),
}

/// An output of the wall: something to store, or a query to send.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// The state of a cell has changed.
    Changed {
        /// The cell.
        cell: String,
        /// The previous state.
        before: State,
        /// The new state.
        now: State,
    },
    /// A cell of an earlier run of the fleet host was lost before this run began.
    Missing {
        /// The cell.
        cell: String,
        /// Its state.
        now: State,
    },
    /// A contact or a change was reported, for the first time or with more detail.
    Recorded {
        /// The cell.
        cell: String,
        /// The publisher instance.
        instance: String,
        /// The record's number in that instance.
        number: u64,
        /// Send time, by the clock of the cell's computer \[ns since the epoch\].
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
        /// Number of newly lost samples.
        samples: u64,
    },
    /// Records are missing: query the cell for those after this number.
    AskRecords {
        /// The cell.
        cell: String,
        /// The last known number.
        after: u64,
    },
    /// Query the clock of the cell.
    AskClock {
        /// The cell.
        cell: String,
    },
    /// The status of a connected cell is unknown: query it.
    AskStatus {
        /// The cell.
        cell: String,
    },
}

impl Effect {
    /// Returns whether a fleet host stores it.
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
    /// Whether missing cells of an earlier run have been reported.
    has_looked: bool,
}

impl Wall {
    /// Creates a wall on which these cells are expected.
    pub fn new(expected: impl IntoIterator<Item = String>) -> Self {
        let mut wall = Self::default();
        for cell in expected.into_iter().take(MAX_CELLS) {
            wall.cells.entry(cell).or_default().expected = true;
        }
        wall
    }

    /// Adds a cell that was seen in an earlier run of the fleet host. `latched`: its publisher instance that was
    /// latched, and the start of the latch \[ns since the epoch\].
    pub fn remember(&mut self, known: Remembered, latched: Option<(String, i64)>) {
        if let Some(cell) = self.cell(&known.cell) {
            cell.remember(known, latched);
        }
    }

    /// Processes an event at `now`.
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

    /// Advances the time: fresh data may have become stale.
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

    /// Returns the state of a cell.
    pub fn state(&self, cell: &str) -> Option<State> {
        let watched = self.cells.get(cell)?;
        Some(watched.state(self.reached, self.now))
    }

    /// Returns the newest status of a cell.
    pub fn status_of(&self, cell: &str) -> Option<&StatusMessage> {
        self.cells.get(cell)?.newest()
    }

    /// Returns a snapshot of all cells, the most severe first.
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

    /// Returns the cell, new or known; `None` if there are too many.
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
