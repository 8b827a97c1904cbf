//! Which column of a table is what.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ArchiveError;

/// Which column of a table is what. Columns are counted from 1, as `cut` and spreadsheets do.
///
/// ```yaml
/// time: {number: 1}
/// position: {first: 2}     # as many columns as there are joints, in their order
/// velocity: {first: 8}
/// effort: {names: [i1, i2, i3, i4, i5, i6]}
/// header: true
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CsvMapping {
    /// The time: since the epoch, or since any beginning.
    pub time: Column,
    /// Its unit \[ns\]: 1000000 for milliseconds; recognised if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000_000_000_i64))]
    pub time_unit_ns: Option<u64>,
    /// Positions \[rad, m\].
    pub position: Columns,
    /// Velocities \[rad/s, m/s\]; differentiated from the positions if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Columns>,
    /// Efforts in the cell's effort unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<Columns>,
    /// Joints in the order of the columns; the robot's own order if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints: Option<Vec<String>>,
    /// Whether the first line (after those skipped) names the columns.
    #[serde(default)]
    pub header: bool,
    /// Lines to skip before anything else.
    #[serde(default)]
    pub skip_lines: usize,
    /// Character between two columns (ASCII); recognised if absent: a comma, a semicolon, a tab or a space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delimiter: Option<char>,
}

/// One column, by its number or its name in the header.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Its number, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub number: Option<usize>,
    /// Its name in the header.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// The columns of one quantity, one for each joint: one of the three ways to say it.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Columns {
    /// Number of the first one, from 1; the others follow it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<usize>,
    /// The number of each, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub numbers: Option<Vec<usize>>,
    /// The name of each in the header.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub names: Option<Vec<String>>,
}

/// A mapping with every column found; from here on columns are counted from 0.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) time: usize,
    pub(super) position: Vec<usize>,
    pub(super) velocity: Vec<usize>,
    pub(super) effort: Vec<usize>,
}

impl CsvMapping {
    /// Finds the columns in a table of `width` columns with the names `header` (empty without one).
    pub(super) fn find(
        &self,
        path: &Path,
        header: &[String],
        width: usize,
        joints: usize,
    ) -> Result<Found, ArchiveError> {
        let finder = Finder {
            header: self.header.then_some(header),
            width,
            joints,
        };
        let refuse = |(what, reason): (&str, String)| ArchiveError::CsvMapping {
            path: path.to_owned(),
            what: what.to_owned(),
            reason,
        };
        let optional = |columns: &Option<Columns>, what| match columns {
            Some(columns) => finder.columns(columns).map_err(|reason| (what, reason)),
            None => Ok(Vec::new()),
        };
        Ok(Found {
            time: finder
                .column(&self.time)
                .map_err(|reason| refuse(("time", reason)))?,
            position: finder
                .columns(&self.position)
                .map_err(|reason| refuse(("position", reason)))?,
            velocity: optional(&self.velocity, "velocity").map_err(refuse)?,
            effort: optional(&self.effort, "effort").map_err(refuse)?,
        })
    }

    pub(super) fn delimiter_byte(&self, path: &Path) -> Result<Option<u8>, ArchiveError> {
        let Some(delimiter) = self.delimiter else {
            return Ok(None);
        };
        let byte = u8::try_from(delimiter).ok().filter(u8::is_ascii);
        byte.map(Some).ok_or_else(|| ArchiveError::CsvMapping {
            path: path.to_owned(),
            what: "delimiter".to_owned(),
            reason: format!("{delimiter:?} is not an ASCII character"),
        })
    }
}

struct Finder<'a> {
    header: Option<&'a [String]>,
    width: usize,
    joints: usize,
}

impl Finder<'_> {
    fn column(&self, column: &Column) -> Result<usize, String> {
        match (column.number, &column.name) {
            (Some(number), None) => self.number(number),
            (None, Some(name)) => self.name(name),
            _ => Err("give `number` or `name`, one of them".to_owned()),
        }
    }

    fn columns(&self, columns: &Columns) -> Result<Vec<usize>, String> {
        let found = match (columns.first, &columns.numbers, &columns.names) {
            (Some(first), None, None) => (0..self.joints)
                .map(|joint| self.number(first.saturating_add(joint)))
                .collect::<Result<Vec<_>, _>>()?,
            (None, Some(numbers), None) => {
                let found = numbers.iter().map(|&number| self.number(number));
                found.collect::<Result<_, _>>()?
            }
            (None, None, Some(names)) => {
                let found = names.iter().map(|name| self.name(name));
                found.collect::<Result<_, _>>()?
            }
            _ => return Err("give `first`, `numbers` or `names`, one of them".to_owned()),
        };
        if found.len() != self.joints {
            return Err(format!(
                "{} columns for {} joints",
                found.len(),
                self.joints
            ));
        }
        Ok(found)
    }

    fn number(&self, number: usize) -> Result<usize, String> {
        match number.checked_sub(1) {
            None => Err("columns are counted from 1".to_owned()),
            Some(index) if index >= self.width => Err(format!(
                "column {number}, but the table has {} columns",
                self.width
            )),
            Some(index) => Ok(index),
        }
    }

    fn name(&self, name: &str) -> Result<usize, String> {
        let Some(header) = self.header else {
            return Err(format!("column {name:?}, but `header` is not true"));
        };
        let mut found = (0..header.len()).filter(|&i| header[i] == name);
        match (found.next(), found.next()) {
            (Some(index), None) => Ok(index),
            (Some(_), Some(_)) => Err(format!("two columns are called {name:?}")),
            (None, _) => Err(format!(
                "no column {name:?}; there are {}",
                header.join(", ")
            )),
        }
    }
}
