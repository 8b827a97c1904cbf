//! Joint states from a table of numbers.
//!
//! A row is one instant. All of it is checked when it is opened, so that a broken table is refused
//! before anything is started; the rows are then read again as they are needed. Columns, units and time are
//! recognised by the header and the numbers, and reported in remarks.

mod error;
mod known;
mod layout;
mod lines;
mod mapping;
mod number;
mod records;
mod rows;
mod scales;
mod survey;
mod time;
mod units;

use std::path::{Path, PathBuf};

pub use error::{CsvError, CsvProblem};
pub(crate) use known::mapping_of;
pub use mapping::{Column, Columns, CsvMapping};

use crate::cursor::{Cursor, RawMessage};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::ros;
use rows::{Row, Rows};
use time::Clock;

/// Beyond these a number in a table is refused.
pub mod limits {
    /// Of a time: from zero to what a ROS stamp can hold \[s\].
    /// Physical: `builtin_interfaces/Time` holds seconds as an `int32`.
    pub const TIME_S: f64 = i32::MAX as f64;
}

/// The topic that the rows of a table appear on.
pub(crate) const TOPIC: &str = "/joint_states";

/// A table that has been checked.
#[derive(Debug)]
pub(crate) struct CsvTable {
    path: PathBuf,
    mapping: CsvMapping,
    joints: Vec<String>,
    clock: Clock,
    /// Sentences on what was recognised.
    pub(crate) remarks: Vec<String>,
    pub(crate) rows: u64,
    /// Time of the first and the last row \[ns\].
    pub(crate) times_ns: Option<(i64, i64)>,
    pub(crate) damage: Vec<Damage>,
}

impl CsvTable {
    /// Checks the table at `path`. `joints` are the names that the columns of a quantity stand for,
    /// unless the mapping has its own. `remark` says how the mapping was recognised.
    pub(crate) fn check(
        path: &Path,
        mapping: &CsvMapping,
        joints: &[String],
        remark: Option<String>,
    ) -> Result<Self, ArchiveError> {
        let joints = mapping.joints.as_deref().unwrap_or(joints).to_vec();
        if joints.is_empty() {
            return Err(ArchiveError::CsvMapping {
                path: path.to_owned(),
                what: "joints".to_owned(),
                reason: "there are none that the columns could stand for".to_owned(),
            });
        }
        let mut table = Self {
            path: path.to_owned(),
            mapping: mapping.clone(),
            joints,
            clock: Clock::SECONDS,
            remarks: remark.into_iter().collect(),
            rows: 0,
            times_ns: None,
            damage: Vec::new(),
        };
        let (clock, clock_remark) = survey::clock_of(table.open()?, mapping.time_unit_ns);
        table.clock = clock;
        let mut rows = table.open()?;
        loop {
            match rows.next_row()? {
                Row::State { time_ns, .. } => {
                    table.rows += 1;
                    let (start_ns, _) = table.times_ns.unwrap_or((time_ns, time_ns));
                    table.times_ns = Some((start_ns, time_ns));
                }
                Row::Torn { line } => {
                    table.damage.push(Damage {
                        path: path.to_owned(),
                        at: line,
                        kind: DamageKind::TornTail,
                        readable_until_ns: table.times_ns.map(|(_, end_ns)| end_ns),
                    });
                    break;
                }
                Row::End => break,
            }
        }
        if let Some((start_ns, end_ns)) = table.times_ns
            && start_ns == end_ns
            && table.rows > 1
        {
            return Err(rows.clock_stands_still(table.rows, start_ns));
        }
        table.remarks.extend(clock_remark);
        table.remarks.extend(rows.remarks());
        Ok(table)
    }

    fn open(&self) -> Result<Rows, ArchiveError> {
        let rows = Rows::open(&self.path, &self.mapping, &self.joints)?;
        Ok(rows.with_clock(self.clock))
    }

    pub(crate) fn cursor(&self) -> Result<CsvCursor, ArchiveError> {
        Ok(CsvCursor {
            path: self.path.clone(),
            rows: self.open()?,
            current: None,
            body: Vec::new(),
        })
    }
}

pub(crate) struct CsvCursor {
    path: PathBuf,
    rows: Rows,
    /// Line and time of the row that was read last.
    current: Option<(u64, i64)>,
    body: Vec<u8>,
}

impl Cursor for CsvCursor {
    fn advance(&mut self) -> Result<bool, ArchiveError> {
        self.current = None;
        if let Row::State { line, time_ns } = self.rows.next_row()? {
            ros::encode(self.rows.state(), &mut self.body).map_err(|source| {
                ArchiveError::Encode {
                    path: self.path.clone(),
                    topic: TOPIC.to_owned(),
                    source,
                }
            })?;
            self.current = Some((line, time_ns));
        }
        Ok(self.current.is_some())
    }

    fn current(&self) -> Option<RawMessage<'_>> {
        self.current.map(|(line, time_ns)| RawMessage {
            topic: 0,
            log_time_ns: time_ns,
            publish_time_ns: time_ns,
            sequence: 0,
            at: line,
            body: &self.body,
        })
    }
}
