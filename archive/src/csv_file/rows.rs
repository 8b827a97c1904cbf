//! Sequential access to the rows of a table.

use std::path::Path;

use super::CsvMapping;
use super::error::{CsvProblem, shown};
use super::mapping::Found;
use super::number::Numbers;
use super::records::Records;
use super::scales::Scales;
use super::time::Clock;
use crate::error::ArchiveError;
use crate::ros::{JointState, Time};

const NS_PER_S: f64 = 1e9;

/// Result of reading a row.
pub(super) enum Row {
    /// A joint state, which [`Rows::state`] returns.
    State { line: u64, time_ns: i64 },
    /// The file ends within this line; its values are incomplete.
    Torn { line: u64 },
    /// End of the file.
    End,
}

pub(super) struct Rows {
    records: Records,
    width: usize,
    found: Found,
    scales: Scales,
    numbers: Numbers,
    /// Whether the current record is the first row, read ahead for the number of columns.
    first_is_read: bool,
    clock: Clock,
    before_ns: Option<i64>,
    state: JointState,
}

impl Rows {
    /// Opens the table at `path`. Its time is in seconds unless [`Rows::with_clock`] sets another clock.
    pub(super) fn open(
        path: &Path,
        mapping: &CsvMapping,
        joints: &[String],
    ) -> Result<Self, ArchiveError> {
        let records = Records::open(path, mapping.delimiter_byte(path)?, mapping.skip_lines)?;
        let mut rows = Self {
            numbers: Numbers::new(records.delimiter()),
            records,
            width: 0,
            found: Found::default(),
            scales: Scales::default(),
            first_is_read: false,
            clock: Clock::SECONDS,
            before_ns: None,
            state: JointState {
                name: joints.to_vec(),
                ..JointState::default()
            },
        };
        let mut header = Vec::new();
        if mapping.header && rows.records.read()? {
            header = rows.records.cells();
            rows.width = header.len();
        }
        rows.first_is_read = rows.records.read()?;
        if rows.first_is_read {
            if rows.width == 0 {
                rows.width = rows.records.width();
            }
            rows.found = mapping.find(path, &header, rows.width, joints.len())?;
            rows.scales = Scales::of(&header, &mut rows.found).map_err(|(what, reason)| {
                ArchiveError::CsvMapping {
                    path: path.to_owned(),
                    what: what.to_owned(),
                    reason,
                }
            })?;
        }
        Ok(rows)
    }

    pub(super) fn with_clock(mut self, clock: Clock) -> Self {
        self.clock = clock;
        self
    }

    /// Returns the joint state of the last row read.
    pub(super) fn state(&self) -> &JointState {
        &self.state
    }

    /// Returns the time cell of the first row; `None` once another row was read.
    pub(super) fn first_time(&self) -> Option<&[u8]> {
        (self.first_is_read && self.records.width() == self.width)
            .then(|| self.records.cell(self.found.time))
    }

    /// Returns the unit of the time in the header, if it has one \[ns\].
    pub(super) fn headed_unit_ns(&self) -> Option<u64> {
        self.scales.time_unit_ns
    }

    /// Returns remarks for the user on units and number format of the rows read so far.
    pub(super) fn remarks(&self) -> Vec<String> {
        let mut remarks = self.scales.remarks.clone();
        if self.numbers.have_commas() {
            remarks.push("Numbers are read with decimal commas.".to_owned());
        }
        remarks
    }

    /// Reads the next row.
    pub(super) fn next_row(&mut self) -> Result<Row, ArchiveError> {
        let row = self.next_record()?;
        let Row::State { line, .. } = row else {
            return Ok(row);
        };
        let refuse = |rows: &Self, problem| rows.records.refuse(problem);
        let time_ns = self.take_time().map_err(|problem| refuse(self, problem))?;
        self.take_states()
            .map_err(|problem| refuse(self, problem))?;
        Ok(Row::State { line, time_ns })
    }

    /// Reads the next row without its time, whose unit is not yet known.
    pub(super) fn next_raw(&mut self) -> Result<Row, ArchiveError> {
        let row = self.next_record()?;
        if let Row::State { .. } = row {
            self.take_states()
                .map_err(|problem| self.records.refuse(problem))?;
        }
        Ok(row)
    }

    /// Returns the time of the last row read in the unit of the table, if it is a non-negative number.
    pub(super) fn raw_time(&mut self) -> Option<f64> {
        let time = self.numbers.number(self.records.cell(self.found.time))?;
        (time.is_finite() && time >= 0.0).then_some(time)
    }

    /// Returns the error that the time did not advance over `rows` rows.
    pub(super) fn clock_stands_still(&self, rows: u64, time_ns: i64) -> ArchiveError {
        self.records.refuse(CsvProblem::ClockStandsStill {
            column: self.found.time + 1,
            rows,
            time_s: time_ns as f64 / NS_PER_S,
        })
    }

    fn next_record(&mut self) -> Result<Row, ArchiveError> {
        if !std::mem::take(&mut self.first_is_read) && !self.records.read()? {
            return Ok(Row::End);
        }
        let (line, found) = (self.records.line(), self.records.width());
        if found == self.width {
            return Ok(Row::State { line, time_ns: 0 });
        }
        if let Some(column) = self.records.column_of_several_lines() {
            let column = Some(column);
            return Err(self.records.refuse(CsvProblem::OpenQuote { column }));
        }
        if self.records.is_last_unended() && found < self.width {
            return Ok(Row::Torn { line });
        }
        Err(self.records.refuse(CsvProblem::Width {
            found,
            expected: self.width,
        }))
    }

    fn take_time(&mut self) -> Result<i64, CsvProblem> {
        let (cell, column) = (self.records.cell(self.found.time), self.found.time + 1);
        let time_ns = self.clock.time_ns(cell, &mut self.numbers);
        let time_ns = time_ns.ok_or_else(|| {
            let text = shown(cell);
            match self.clock {
                Clock::Dates => CsvProblem::Date { column, text },
                Clock::Numbers { .. } => CsvProblem::Time { column, text },
            }
        })?;
        if let Some(before_ns) = self.before_ns.filter(|&before_ns| time_ns < before_ns) {
            return Err(CsvProblem::Backwards {
                column,
                time_s: time_ns as f64 / NS_PER_S,
                before_s: before_ns as f64 / NS_PER_S,
            });
        }
        self.before_ns = Some(time_ns);
        self.state.header.stamp = Time::from_ns(time_ns);
        Ok(time_ns)
    }

    fn take_states(&mut self) -> Result<(), CsvProblem> {
        let Self {
            state,
            records,
            found,
            scales,
            numbers,
            ..
        } = self;
        let quantities = [
            (
                "position",
                &found.position,
                &scales.position,
                &mut state.position,
            ),
            (
                "velocity",
                &found.velocity,
                &scales.velocity,
                &mut state.velocity,
            ),
            ("effort", &found.effort, &scales.effort, &mut state.effort),
        ];
        for (quantity, columns, factors, values) in quantities {
            values.clear();
            for (i, &column) in columns.iter().enumerate() {
                let cell = records.cell(column);
                let number = numbers.number(cell).ok_or_else(|| CsvProblem::NotANumber {
                    column: column + 1,
                    what: format!("{quantity} of {}", state.name[i]),
                    text: shown(cell),
                })?;
                values.push(factors.get(i).map_or(number, |factor| number * factor));
            }
        }
        Ok(())
    }
}
