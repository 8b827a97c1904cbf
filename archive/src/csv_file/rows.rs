//! A table row by row.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::error::{CsvError, CsvProblem, shown};
use super::limits;
use super::lines::{Lines, MAX_LINE_BYTES};
use super::mapping::{CsvMapping, Found};
use crate::error::ArchiveError;
use crate::ros::{JointState, Time};

const NS_PER_S: f64 = 1e9;

/// What comes next in a table.
pub(super) enum Row {
    /// A joint state, to be had from [`Rows::state`].
    State { line: u64, time_ns: i64 },
    /// The file ends within this line.
    Torn { line: u64 },
    /// There is no more.
    End,
}

pub(super) struct Rows {
    path: PathBuf,
    reader: csv::Reader<Lines<File>>,
    /// Lines and bytes before the reader's first.
    skipped_lines: u64,
    skipped_bytes: u64,
    file_bytes: u64,
    ends_in_a_line: bool,
    fields: csv::ByteRecord,
    width: usize,
    found: Found,
    /// `fields` hold the first row, read to learn the width.
    first_is_read: bool,
    time_unit_s: f64,
    before_s: f64,
    state: JointState,
}

impl Rows {
    pub(super) fn open(
        path: &Path,
        mapping: &CsvMapping,
        joints: &[String],
    ) -> Result<Self, ArchiveError> {
        let delimiter = mapping.delimiter_byte(path)?;
        let mut file = File::open(path).map_err(ArchiveError::io(path))?;
        let (file_bytes, ends_in_a_line) =
            look_at_end(&mut file).map_err(ArchiveError::io(path))?;
        let mut lines = Lines::new(file);
        let mut skipped_bytes = 0;
        for _ in 0..mapping.skip_lines {
            skipped_bytes += lines.skip_line().map_err(ArchiveError::io(path))?;
        }
        let mut rows = Self {
            path: path.to_owned(),
            // Without quoting, a stray quote cannot swallow the rest of the file.
            reader: csv::ReaderBuilder::new()
                .has_headers(false)
                .flexible(true)
                .quoting(false)
                .delimiter(delimiter)
                .trim(csv::Trim::All)
                .from_reader(lines),
            skipped_lines: mapping.skip_lines as u64,
            skipped_bytes,
            file_bytes,
            ends_in_a_line,
            fields: csv::ByteRecord::new(),
            width: 0,
            found: Found::default(),
            first_is_read: false,
            time_unit_s: mapping.time_unit_ns as f64 / NS_PER_S,
            before_s: f64::NEG_INFINITY,
            state: JointState {
                name: joints.to_vec(),
                ..JointState::default()
            },
        };
        let mut header = Vec::new();
        if mapping.header && rows.read()? {
            let name = |field| String::from_utf8_lossy(unquoted(field)).into_owned();
            header = rows.fields.iter().map(name).collect();
            rows.width = header.len();
        }
        rows.first_is_read = rows.read()?;
        if rows.first_is_read {
            if rows.width == 0 {
                rows.width = rows.fields.len();
            }
            rows.found = mapping.find(path, &header, rows.width, joints.len())?;
        }
        Ok(rows)
    }

    /// The joint state of the row that was given last.
    pub(super) fn state(&self) -> &JointState {
        &self.state
    }

    pub(super) fn next_row(&mut self) -> Result<Row, ArchiveError> {
        if !std::mem::take(&mut self.first_is_read) && !self.read()? {
            return Ok(Row::End);
        }
        let line = self.line();
        if self.fields.len() != self.width {
            let consumed = self.skipped_bytes + self.reader.position().byte();
            if self.ends_in_a_line && consumed == self.file_bytes && self.fields.len() < self.width
            {
                return Ok(Row::Torn { line });
            }
            return Err(self.refuse(CsvProblem::Width {
                found: self.fields.len(),
                expected: self.width,
            }));
        }
        let time_ns = self.take_time().map_err(|problem| self.refuse(problem))?;
        self.take_states().map_err(|problem| self.refuse(problem))?;
        Ok(Row::State { line, time_ns })
    }

    fn take_time(&mut self) -> Result<i64, CsvProblem> {
        let column = self.found.time;
        let field = &self.fields[column];
        let time_s = number(field)
            .map(|time| time * self.time_unit_s)
            .filter(|time_s| (0.0..=limits::TIME_S).contains(time_s))
            .ok_or_else(|| CsvProblem::Time {
                column: column + 1,
                text: shown(field),
            })?;
        if time_s < self.before_s {
            return Err(CsvProblem::Backwards {
                column: column + 1,
                time_s,
                before_s: self.before_s,
            });
        }
        self.before_s = time_s;
        let time_ns = (time_s * NS_PER_S).round() as i64;
        self.state.header.stamp = Time::from_ns(time_ns);
        Ok(time_ns)
    }

    fn take_states(&mut self) -> Result<(), CsvProblem> {
        let Self {
            state,
            fields,
            found,
            ..
        } = self;
        let quantities = [
            (
                "position",
                &found.position,
                &mut state.position,
                limits::POSITION,
            ),
            (
                "velocity",
                &found.velocity,
                &mut state.velocity,
                limits::VELOCITY,
            ),
            ("effort", &found.effort, &mut state.effort, limits::EFFORT),
        ];
        for (quantity, columns, values, limit) in quantities {
            values.clear();
            for (&column, joint) in columns.iter().zip(&state.name) {
                let field = &fields[column];
                let what = || format!("{quantity} of {joint}");
                let value = number(field).ok_or_else(|| CsvProblem::NotANumber {
                    column: column + 1,
                    what: what(),
                    text: shown(field),
                })?;
                if value.abs() > limit {
                    return Err(CsvProblem::Implausible {
                        column: column + 1,
                        what: what(),
                        text: shown(field),
                        limit,
                    });
                }
                values.push(value);
            }
        }
        Ok(())
    }

    /// Reads the next line that is not empty; `false` at the end.
    fn read(&mut self) -> Result<bool, ArchiveError> {
        self.reader
            .read_byte_record(&mut self.fields)
            .map_err(|error| {
                let line = self.skipped_lines + self.reader.position().line();
                match error.into_kind() {
                    csv::ErrorKind::Io(error) if error.kind() == io::ErrorKind::InvalidData => {
                        let limit = MAX_LINE_BYTES;
                        self.refuse_line(line, CsvProblem::LineTooLong { limit })
                    }
                    csv::ErrorKind::Io(error) => ArchiveError::io(&self.path)(error),
                    // Records of bytes, of any length: nothing else can be wrong with them.
                    other => ArchiveError::io(&self.path)(io::Error::other(format!("{other:?}"))),
                }
            })
    }

    /// The line of the row that was read last, from 1.
    fn line(&self) -> u64 {
        let line = self.fields.position().map_or(0, csv::Position::line);
        self.skipped_lines + line
    }

    fn refuse(&self, problem: CsvProblem) -> ArchiveError {
        self.refuse_line(self.line(), problem)
    }

    fn refuse_line(&self, line: u64, problem: CsvProblem) -> ArchiveError {
        ArchiveError::Csv(Box::new(CsvError {
            path: self.path.clone(),
            line,
            problem,
        }))
    }
}

/// The number in a field; an empty one is NaN, as spreadsheets and pandas write it.
fn number(field: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(unquoted(field)).ok()?;
    if text.is_empty() {
        return Some(f64::NAN);
    }
    text.parse().ok()
}

fn unquoted(field: &[u8]) -> &[u8] {
    field
        .strip_prefix(b"\"")
        .and_then(|field| field.strip_suffix(b"\""))
        .unwrap_or(field)
}

/// The length of the file, and whether it ends without a line end.
fn look_at_end(file: &mut File) -> io::Result<(u64, bool)> {
    let bytes = file.seek(SeekFrom::End(0))?;
    let mut last = *b"\n";
    if bytes > 0 {
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
    }
    file.rewind()?;
    Ok((bytes, last != *b"\n"))
}
