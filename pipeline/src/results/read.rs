//! Reading of results: recordings and their events.

use std::fs::File;
use std::path::{Path, PathBuf};

use arrow::array::{Array as _, AsArray as _, RecordBatch};
use arrow::datatypes::{Float64Type, Int64Type};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::statistics::Statistics;

/// The columns that are read.
const READ: [&str; 16] = [
    "row",
    "recording",
    "recording_sha256",
    "cell",
    "detector",
    "kind",
    "link",
    "joints",
    "t_ns",
    "end_ns",
    "contact_ns",
    "score",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "stage",
];

/// Error while reading results.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// An unreadable file or folder.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file that is not Parquet.
    #[error("{}: {source}", path.display())]
    Parquet {
        /// Which.
        path: PathBuf,
        /// Why.
        source: parquet::errors::ParquetError,
    },
    /// A file with another table.
    #[error("{}: it is no result of `tauscope replay --manifest`: it has no column `{column}`", path.display())]
    NoColumn {
        /// Which.
        path: PathBuf,
        /// The missing column.
        column: &'static str,
    },
}

/// A recording that was replayed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingRow {
    /// Its name.
    pub recording: String,
    /// SHA-256 of its content.
    pub sha256: String,
    /// The cell.
    pub cell: String,
    /// Stamp of its first sample \[ns since the epoch\].
    pub t_ns: i64,
}

/// An event, or a change of the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct EventRow {
    /// SHA-256 of the recording.
    pub sha256: String,
    /// The stage that reported it.
    pub stage: String,
    /// Its detector.
    pub detector: String,
    /// `contact`, `collision`, …, or the effect of a change.
    pub kind: String,
    /// The touched or changed link, if estimated.
    pub link: Option<String>,
    /// The joints that detected.
    pub joints: Vec<String>,
    /// Stamp of the sample that raised the alarm \[ns since the epoch\].
    pub t_ns: i64,
    /// Stamp of the sample that ended it \[ns since the epoch\].
    pub end_ns: i64,
    /// Estimated beginning \[ns since the epoch\].
    pub contact_ns: i64,
    /// The largest score.
    pub peak_score: Option<f64>,
    /// Force on the robot in the world frame, if estimated \[N\].
    pub force_n: Option<[f64; 3]>,
}

/// Content of result files.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Results {
    /// Recordings, one per file.
    pub recordings: Vec<RecordingRow>,
    /// All events.
    pub events: Vec<EventRow>,
}

/// Lists the Parquet files below a folder, sorted by name; for a file, the file itself.
///
/// # Errors
/// If the folder cannot be read.
pub fn parquet_files(path: &Path) -> Result<Vec<PathBuf>, ReadError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        let failed = |source| ReadError::Io {
            path: folder.clone(),
            source,
        };
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "parquet") {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Reads the recordings and events of these files; rows of single samples are skipped.
///
/// # Errors
/// If a file cannot be read or is not a result.
pub fn read_results(files: &[PathBuf]) -> Result<Results, ReadError> {
    let mut results = Results::default();
    for path in files {
        read_file(path, &mut results)?;
    }
    Ok(results)
}

fn read_file(path: &Path, results: &mut Results) -> Result<(), ReadError> {
    let file = File::open(path).map_err(|source| ReadError::Io {
        path: path.to_owned(),
        source,
    })?;
    let failed = |source| ReadError::Parquet {
        path: path.to_owned(),
        source,
    };
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(failed)?;
    let columns = builder.schema();
    if let Some(&column) = READ.iter().find(|name| columns.index_of(name).is_err()) {
        return Err(ReadError::NoColumn {
            path: path.to_owned(),
            column,
        });
    }
    let groups = builder.metadata().row_groups().iter().enumerate();
    let groups = groups.filter(|(_, group)| !is_samples(group.column(0).statistics()));
    let groups = groups.map(|(index, _)| index).collect();
    let mask = ProjectionMask::columns(builder.parquet_schema(), READ);
    let reader = builder
        .with_projection(mask)
        .with_row_groups(groups)
        .build();
    for batch in reader.map_err(failed)? {
        let batch = batch.map_err(|error| failed(error.into()))?;
        add(&batch, results);
    }
    Ok(())
}

/// Whether a row group holds rows of samples only, by the statistics of its column `row`.
fn is_samples(statistics: Option<&Statistics>) -> bool {
    let bounds = statistics.map(|s| (s.min_bytes_opt(), s.max_bytes_opt()));
    bounds.is_some_and(|(min, max)| min == Some(b"detection") && max == Some(b"detection"))
}

fn add(batch: &RecordBatch, results: &mut Results) {
    let text = |name: &str, row: usize| {
        let column = batch.column_by_name(name)?.as_string_opt::<i32>()?;
        (!column.is_null(row)).then(|| column.value(row).to_owned())
    };
    let stamp = |name: &str, row: usize| {
        let column = batch.column_by_name(name)?;
        let column = column.as_primitive_opt::<Int64Type>()?;
        (!column.is_null(row)).then(|| column.value(row))
    };
    let number = |name: &str, row: usize| {
        let column = batch.column_by_name(name)?;
        let column = column.as_primitive_opt::<Float64Type>()?;
        (!column.is_null(row)).then(|| column.value(row))
    };
    let texts = |name: &str, row: usize| -> Vec<String> {
        let list = batch
            .column_by_name(name)
            .and_then(|c| c.as_list_opt::<i32>());
        let values = list.filter(|list| !list.is_null(row)).map(|l| l.value(row));
        let values = values.as_ref().and_then(|v| v.as_string_opt::<i32>());
        values.map_or_else(Vec::new, |values| {
            values.iter().flatten().map(str::to_owned).collect()
        })
    };
    for row in 0..batch.num_rows() {
        let sha256 = text("recording_sha256", row).unwrap_or_default();
        let t_ns = stamp("t_ns", row).unwrap_or_default();
        match text("row", row).as_deref() {
            Some("recording") => results.recordings.push(RecordingRow {
                recording: text("recording", row).unwrap_or_default(),
                sha256,
                cell: text("cell", row).unwrap_or_default(),
                t_ns,
            }),
            Some("event" | "physics") => results.events.push(EventRow {
                sha256,
                stage: text("stage", row).unwrap_or_default(),
                detector: text("detector", row).unwrap_or_default(),
                kind: text("kind", row).unwrap_or_default(),
                link: text("link", row),
                joints: texts("joints", row),
                t_ns,
                end_ns: stamp("end_ns", row).unwrap_or(t_ns),
                contact_ns: stamp("contact_ns", row).unwrap_or(t_ns),
                peak_score: number("score", row),
                force_n: match ["force_x_n", "force_y_n", "force_z_n"].map(|n| number(n, row)) {
                    [Some(x), Some(y), Some(z)] => Some([x, y, z]),
                    _ => None,
                },
            }),
            _ => {}
        }
    }
}
