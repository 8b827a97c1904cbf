//! The nightly tables as rows.

use std::fs::File;
use std::path::{Path, PathBuf};

use arrow::array::{Array, Float64Array, RecordBatch, StringArray, UInt64Array};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use tauscope_condition::Estimate;

use super::PhysicsError;

/// Prefix of the file name of a table.
pub const TABLE: &str = "physics";
const NS_A_DAY: f64 = 86_400e9;
/// Maximum size of a table \[bytes\]. Resolution: a night has some forty rows.
const MOST_BYTES: u64 = 16 << 20;

/// A column: its name, and the accessor of its value in a row.
pub type Column<T> = (&'static str, fn(&Row) -> T);
/// A column of texts.
pub type TextColumn = (&'static str, fn(&Row) -> &String);

/// A number of one night.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// The cell.
    pub cell: String,
    /// The robot's name in its URDF.
    pub robot: String,
    /// The arm, which keeps its history when it moves to another cell.
    pub arm: String,
    /// The joint; empty for a number of the whole arm.
    pub joint: String,
    /// The number's name.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// SHA-256 of the twin that was used for the measurement; empty without one.
    pub twin_sha256: String,
    /// Stamp of the first recording \[ns since the epoch\].
    pub stamp_ns: u64,
    /// Number of recordings used.
    pub recordings: u64,
    /// The estimate.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low_95: f64,
    /// Upper end.
    pub high_95: f64,
    /// Temperature of the joint, NaN if it is unknown \[deg C\].
    pub temperature_c: f64,
    /// Time since the start of the robot, NaN if it is unknown \[h\].
    pub hours_since_start: f64,
}

impl Row {
    /// The columns of texts: name, and the row's value.
    pub const TEXTS: [TextColumn; 7] = [
        ("cell", |row| &row.cell),
        ("robot", |row| &row.robot),
        ("arm", |row| &row.arm),
        ("joint", |row| &row.joint),
        ("quantity", |row| &row.quantity),
        ("unit", |row| &row.unit),
        ("twin_sha256", |row| &row.twin_sha256),
    ];
    /// The columns of counts.
    pub const COUNTS: [Column<u64>; 2] = [
        ("stamp_ns", |row| row.stamp_ns),
        ("recordings", |row| row.recordings),
    ];
    /// The columns of numbers.
    pub const NUMBERS: [Column<f64>; 5] = [
        ("value", |row| row.value),
        ("low_95", |row| row.low_95),
        ("high_95", |row| row.high_95),
        ("temperature_c", |row| row.temperature_c),
        ("hours_since_start", |row| row.hours_since_start),
    ];

    /// Converts it to an estimate.
    pub fn estimate(&self) -> Estimate {
        let known = |value: f64| value.is_finite().then_some(value);
        Estimate {
            day: self.stamp_ns as f64 / NS_A_DAY,
            value: self.value,
            low: self.low_95,
            high: self.high_95,
            temperature_c: known(self.temperature_c),
            hours_since_start: known(self.hours_since_start),
        }
    }
}

/// The folder of a cell's night: `cell=CELL/date=DATE`.
pub fn folder_of(history: &Path, cell: &str, date: &str) -> PathBuf {
    history
        .join(format!("cell={cell}"))
        .join(format!("date={date}"))
}

/// Returns all rows since a day, and the errors of tables that cannot be read.
pub(super) fn rows(
    folder: &Path,
    since_day: f64,
) -> Result<(Vec<Row>, Vec<PhysicsError>), PhysicsError> {
    let (mut rows, mut unread) = (Vec::new(), Vec::new());
    for (_, cell) in parts(folder, "cell=")? {
        for (date, night) in parts(&cell, "date=")? {
            if day_of(&date).is_none_or(|day| day + 1.0 < since_day) {
                continue;
            }
            for path in tables(&night)? {
                match table(&path) {
                    Ok(mut found) => rows.append(&mut found),
                    Err(error) => unread.push(error),
                }
            }
        }
    }
    Ok((rows, unread))
}

fn day_of(date: &str) -> Option<f64> {
    let date: jiff::civil::Date = date.parse().ok()?;
    let days = date.since(jiff::civil::date(1970, 1, 1)).ok()?.get_days();
    Some(f64::from(days))
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, PhysicsError> {
    let failed = |source| PhysicsError::Read {
        path: folder.to_owned(),
        source,
    };
    let entries = std::fs::read_dir(folder).map_err(failed)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut paths: Vec<PathBuf> = paths.collect::<Result<_, _>>().map_err(failed)?;
    paths.sort();
    Ok(paths)
}

/// Returns the folders with this prefix, and the rest of their names.
fn parts(folder: &Path, prefix: &str) -> Result<Vec<(String, PathBuf)>, PhysicsError> {
    let named = entries(folder)?.into_iter().filter_map(|path| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        let value = name.strip_prefix(prefix)?.to_owned();
        path.is_dir().then_some((value, path))
    });
    Ok(named.collect())
}

fn tables(folder: &Path) -> Result<Vec<PathBuf>, PhysicsError> {
    let mut paths = entries(folder)?;
    paths.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(TABLE) && name.ends_with(".parquet")
    });
    Ok(paths)
}

fn table(path: &Path) -> Result<Vec<Row>, PhysicsError> {
    let wrong = |reason: String| PhysicsError::Table {
        path: path.to_owned(),
        reason,
    };
    let failed = |source| PhysicsError::Read {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(failed)?;
    if file.metadata().map_err(failed)?.len() > MOST_BYTES {
        return Err(wrong(format!("it is larger than {MOST_BYTES} bytes")));
    }
    let reader =
        ParquetRecordBatchReaderBuilder::try_new(file).map_err(|e| wrong(e.to_string()))?;
    let reader = reader.build().map_err(|e| wrong(e.to_string()))?;
    let mut rows = Vec::new();
    for batch in reader {
        let batch = batch.map_err(|error| wrong(error.to_string()))?;
        of_batch(&batch, &mut rows).ok_or_else(|| wrong("a column is missing".to_owned()))?;
    }
    Ok(rows)
}

/// Appends the rows of a batch. Returns `None` if a column is missing or has another type.
fn of_batch(batch: &RecordBatch, rows: &mut Vec<Row>) -> Option<()> {
    let column = |name: &str| batch.column_by_name(name);
    let texts: Vec<&StringArray> = Row::TEXTS
        .iter()
        .map(|(name, _)| column(name)?.as_any().downcast_ref())
        .collect::<Option<_>>()?;
    let counts: Vec<&UInt64Array> = Row::COUNTS
        .iter()
        .map(|(name, _)| column(name)?.as_any().downcast_ref())
        .collect::<Option<_>>()?;
    let numbers: Vec<&Float64Array> = Row::NUMBERS
        .iter()
        .map(|(name, _)| column(name)?.as_any().downcast_ref())
        .collect::<Option<_>>()?;
    for at in 0..batch.num_rows() {
        let text = |which: usize| texts[which].value(at).to_owned();
        rows.push(Row {
            cell: text(0),
            robot: text(1),
            arm: text(2),
            joint: text(3),
            quantity: text(4),
            unit: text(5),
            twin_sha256: text(6),
            stamp_ns: counts[0].value(at),
            recordings: counts[1].value(at),
            value: numbers[0].value(at),
            low_95: numbers[1].value(at),
            high_95: numbers[2].value(at),
            temperature_c: numbers[3].value(at),
            hours_since_start: numbers[4].value(at),
        });
    }
    Some(())
}
