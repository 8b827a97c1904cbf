//! `summary.parquet` and `events.parquet`: the results over all replayed recordings, as flat tables that any SQL tool
//! reads.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow::error::ArrowError;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use tauscope_archive::whole_file::{self, Existing};

use crate::replay::Outcome;

/// Error while writing a table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// A failed write.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Inconsistent columns.
    #[error(transparent)]
    Arrow(#[from] ArrowError),
    /// A table that cannot be encoded.
    #[error(transparent)]
    Parquet(#[from] ParquetError),
}

/// Writes `summary.parquet`: a row per recording, twin stage and joint.
///
/// # Errors
/// If the table cannot be written.
pub fn write_summary(dir: &Path, outcomes: &[Outcome]) -> Result<(), TableError> {
    let mut text: [Vec<String>; 5] = Default::default();
    let mut counts: [Vec<u64>; 4] = Default::default();
    let mut numbers: [Vec<f64>; 4] = Default::default();
    for outcome in outcomes {
        for twin in &outcome.twins {
            for (joint, rms) in outcome.joint_names.iter().zip(twin.rms()) {
                text[0].push(outcome.recording.clone());
                text[1].push(outcome.cell.clone());
                text[2].push(twin.stage.clone());
                text[3].push(joint.clone());
                text[4].push(outcome.effort_unit.clone());
                counts[0].push(twin.samples);
                counts[1].push(twin.moving_samples);
                counts[2].push(outcome.lost);
                counts[3].push(
                    outcome
                        .detectors
                        .iter()
                        .map(|d| d.events.len() as u64)
                        .sum(),
                );
                numbers[0].push(outcome.duration_s);
                numbers[1].push(rms.residual_rms);
                numbers[2].push(rms.residual_rms_moving);
                numbers[3].push(rms.filtered_residual_rms);
            }
        }
    }
    let text_names = ["recording", "cell", "twin", "joint", "effort_unit"];
    let count_names = ["samples", "moving_samples", "lost", "events"];
    let number_names = [
        "duration_s",
        "residual_rms",
        "residual_rms_moving",
        "filtered_residual_rms",
    ];
    let columns = (text_names
        .into_iter()
        .zip(text)
        .map(|(n, c)| (n, strings(c))))
    .chain(
        count_names
            .into_iter()
            .zip(counts)
            .map(|(n, c)| (n, integers(c))),
    )
    .chain(
        number_names
            .into_iter()
            .zip(numbers)
            .map(|(n, c)| (n, floats(c))),
    );
    write_table(&dir.join("summary.parquet"), columns)
}

/// Writes `events.parquet`: a row per event.
///
/// # Errors
/// If the table cannot be written.
pub fn write_events(dir: &Path, outcomes: &[Outcome]) -> Result<(), TableError> {
    let mut text: [Vec<String>; 7] = Default::default();
    let mut numbers: [Vec<f64>; 8] = Default::default();
    for outcome in outcomes {
        for detector in &outcome.detectors {
            for event in &detector.events {
                text[0].push(outcome.recording.clone());
                text[1].push(outcome.cell.clone());
                text[2].push(detector.stage.clone());
                text[3].push(detector.detector.clone());
                text[4].push(event.kind.clone());
                text[5].push(event.link.clone().unwrap_or_default());
                text[6].push(event.joints.join(" "));
                let size = [event.size.unwrap_or(f64::NAN)];
                let force = event.force.unwrap_or([f64::NAN; 3]);
                let row = [event.t, event.t_off, event.t_contact, event.peak_score];
                for (column, value) in numbers
                    .iter_mut()
                    .zip(row.into_iter().chain(force).chain(size))
                {
                    column.push(value);
                }
            }
        }
    }
    let text_names = [
        "recording",
        "cell",
        "stage",
        "detector",
        "kind",
        "link",
        "joints",
    ];
    let number_names = [
        "t_s",
        "t_off_s",
        "t_contact_s",
        "peak_score",
        "force_x_n",
        "force_y_n",
        "force_z_n",
        "size",
    ];
    let columns = (text_names
        .into_iter()
        .zip(text)
        .map(|(n, c)| (n, strings(c))))
    .chain(
        number_names
            .into_iter()
            .zip(numbers)
            .map(|(n, c)| (n, floats(c))),
    );
    write_table(&dir.join("events.parquet"), columns)
}

/// A column of strings.
pub fn strings(column: Vec<String>) -> ArrayRef {
    Arc::new(StringArray::from(column))
}

/// A column of unsigned integers.
pub fn integers(column: Vec<u64>) -> ArrayRef {
    Arc::new(UInt64Array::from(column))
}

/// A column of floats.
pub fn floats(column: Vec<f64>) -> ArrayRef {
    Arc::new(Float64Array::from(column))
}

/// Writes the columns to a temporary file next to `path` and renames it when complete.
///
/// # Errors
/// If the table cannot be written.
pub fn write_table(
    path: &Path,
    columns: impl Iterator<Item = (&'static str, ArrayRef)>,
) -> Result<(), TableError> {
    let failed = |source| TableError::Write {
        path: path.to_owned(),
        source,
    };
    let batch = RecordBatch::try_from_iter(columns)?;
    let part = whole_file::part_of(path);
    let anew = OpenOptions::new()
        .write(true)
        .create(true)
        .truncate(true)
        .clone();
    let file = whole_file::create(&part, &anew).map_err(failed)?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by("tauscope".to_owned())
        .build();
    let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    whole_file::put_in_place(&part, path, Existing::Replace).map_err(failed)
}
