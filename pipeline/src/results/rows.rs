//! Rows of a result, and their file.
//!
//! One table holds all kinds of rows; the column `row` names the kind. Columns that a kind does not have are null and
//! take no space. `docs/results.md` describes the table.

use std::collections::BTreeMap;
use std::fs::File;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, BooleanBuilder, Float64Builder, Int64Builder, ListBuilder, RecordBatch,
    StringBuilder, UInt64Builder,
};
use arrow::datatypes::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use tauscope_bus::{Detection, SampleRef, Sink, StageError, flags};

/// Number of rows that are buffered and written as a row group.
/// Resolution: 40 MB of memory at most, against groups too small to compress well.
const GROUP_ROWS: usize = 65_536;

/// Data type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Text,
    Texts,
    Stamp,
    Count,
    Number,
    Flag,
}

/// Name and data type of the columns, in order.
const KINDS: [(&str, Kind); 31] = [
    ("row", Kind::Text),
    ("recording", Kind::Text),
    ("recording_sha256", Kind::Text),
    ("cell", Kind::Text),
    ("stage", Kind::Text),
    ("detector", Kind::Text),
    ("kind", Kind::Text),
    ("link", Kind::Text),
    ("joint", Kind::Text),
    ("joints", Kind::Texts),
    ("effort_unit", Kind::Text),
    ("size_unit", Kind::Text),
    ("t_ns", Kind::Stamp),
    ("end_ns", Kind::Stamp),
    ("contact_ns", Kind::Stamp),
    ("samples", Kind::Count),
    ("moving_samples", Kind::Count),
    ("lost_samples", Kind::Count),
    ("events", Kind::Count),
    ("duration_s", Kind::Number),
    ("score", Kind::Number),
    ("threshold", Kind::Number),
    ("force_x_n", Kind::Number),
    ("force_y_n", Kind::Number),
    ("force_z_n", Kind::Number),
    ("size", Kind::Number),
    ("residual_rms", Kind::Number),
    ("residual_rms_moving", Kind::Number),
    ("filtered_residual_rms", Kind::Number),
    ("alarm", Kind::Flag),
    ("ready", Kind::Flag),
];

/// Names of the columns, in order.
pub const COLUMNS: [&str; KINDS.len()] = {
    let mut names = [""; KINDS.len()];
    let mut n = 0;
    while n < names.len() {
        names[n] = KINDS[n].0;
        n += 1;
    }
    names
};

/// Arrow schema of every result.
pub fn schema() -> Arc<Schema> {
    let fields = KINDS.map(|(name, kind)| {
        let data = match kind {
            Kind::Text => DataType::Utf8,
            Kind::Texts => DataType::new_list(DataType::Utf8, true),
            Kind::Stamp => DataType::Int64,
            Kind::Count => DataType::UInt64,
            Kind::Number => DataType::Float64,
            Kind::Flag => DataType::Boolean,
        };
        Field::new(name, data, name != "row")
    });
    Arc::new(Schema::new(fields.to_vec()))
}

/// A row; unset fields are null. The fields are the columns of `docs/results.md`.
#[derive(Debug, Clone, Copy, Default)]
#[allow(missing_docs, reason = "docs/results.md has a line for each")]
pub struct Row<'a> {
    pub row: &'a str,
    pub stage: Option<&'a str>,
    pub detector: Option<&'a str>,
    pub kind: Option<&'a str>,
    pub link: Option<&'a str>,
    pub joint: Option<&'a str>,
    pub joints: Option<&'a [String]>,
    pub effort_unit: Option<&'a str>,
    pub size_unit: Option<&'a str>,
    pub t_ns: Option<i64>,
    pub end_ns: Option<i64>,
    pub contact_ns: Option<i64>,
    pub samples: Option<u64>,
    pub moving_samples: Option<u64>,
    pub lost_samples: Option<u64>,
    pub events: Option<u64>,
    pub duration_s: Option<f64>,
    pub score: Option<f64>,
    pub threshold: Option<f64>,
    pub force_n: Option<[f64; 3]>,
    pub size: Option<f64>,
    pub residual_rms: Option<f64>,
    pub residual_rms_moving: Option<f64>,
    pub filtered_residual_rms: Option<f64>,
    pub alarm: Option<bool>,
    pub ready: Option<bool>,
}

/// Builder of a column.
enum Column {
    Text(StringBuilder),
    Texts(ListBuilder<StringBuilder>),
    Stamp(Int64Builder),
    Count(UInt64Builder),
    Number(Float64Builder),
    Flag(BooleanBuilder),
}

/// A value of a row.
enum Value<'a> {
    Text(Option<&'a str>),
    Texts(Option<&'a [String]>),
    Stamp(Option<i64>),
    Count(Option<u64>),
    Number(Option<f64>),
    Flag(Option<bool>),
}

impl Column {
    fn of(kind: Kind) -> Self {
        match kind {
            Kind::Text => Self::Text(StringBuilder::new()),
            Kind::Texts => Self::Texts(ListBuilder::new(StringBuilder::new())),
            Kind::Stamp => Self::Stamp(Int64Builder::new()),
            Kind::Count => Self::Count(UInt64Builder::new()),
            Kind::Number => Self::Number(Float64Builder::new()),
            Kind::Flag => Self::Flag(BooleanBuilder::new()),
        }
    }

    /// Appends a value of this column's type.
    fn push(&mut self, value: &Value<'_>) {
        match (self, value) {
            (Self::Text(column), Value::Text(value)) => column.append_option(*value),
            (Self::Texts(column), Value::Texts(value)) => {
                for text in value.unwrap_or_default() {
                    column.values().append_value(text);
                }
                column.append(value.is_some());
            }
            (Self::Stamp(column), Value::Stamp(value)) => column.append_option(*value),
            (Self::Count(column), Value::Count(value)) => column.append_option(*value),
            // All readers treat null as missing, but only some treat NaN so.
            (Self::Number(column), Value::Number(value)) => {
                column.append_option(value.filter(|value| value.is_finite()));
            }
            (Self::Flag(column), Value::Flag(value)) => column.append_option(*value),
            _ => debug_assert!(false, "the values of a row are in the order of KINDS"),
        }
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Self::Text(column) => Arc::new(column.finish()),
            Self::Texts(column) => Arc::new(column.finish()),
            Self::Stamp(column) => Arc::new(column.finish()),
            Self::Count(column) => Arc::new(column.finish()),
            Self::Number(column) => Arc::new(column.finish()),
            Self::Flag(column) => Arc::new(column.finish()),
        }
    }
}

/// Writes the rows of one recording. Memory does not grow with the recording.
pub struct RowWriter {
    recording: String,
    sha256: String,
    cell: String,
    columns: Vec<Column>,
    rows: usize,
    writer: ArrowWriter<File>,
}

impl RowWriter {
    /// Creates a writer into `file` for a recording with this name and hash, made in `cell`. `facts` are the inputs
    /// of the result, which are stored in the file's metadata.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(
        file: File,
        (recording, sha256, cell): (&str, &str, &str),
        facts: &BTreeMap<String, String>,
    ) -> Result<Self, ParquetError> {
        let metadata =
            (facts.iter()).map(|(name, value)| KeyValue::new(name.clone(), value.clone()));
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_created_by("tauscope".to_owned())
            .set_key_value_metadata(Some(metadata.collect()))
            .build();
        Ok(Self {
            recording: recording.to_owned(),
            sha256: sha256.to_owned(),
            cell: cell.to_owned(),
            columns: KINDS.iter().map(|&(_, kind)| Column::of(kind)).collect(),
            rows: 0,
            writer: ArrowWriter::try_new(file, schema(), Some(properties))?,
        })
    }

    /// Appends a row.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn push(&mut self, row: &Row<'_>) -> Result<(), ParquetError> {
        let [x, y, z] = row.force_n.map_or([None; 3], |force_n| force_n.map(Some));
        let values: [Value<'_>; KINDS.len()] = [
            Value::Text(Some(row.row)),
            Value::Text(Some(&self.recording)),
            Value::Text(Some(&self.sha256)),
            Value::Text(Some(&self.cell)),
            Value::Text(row.stage),
            Value::Text(row.detector),
            Value::Text(row.kind),
            Value::Text(row.link),
            Value::Text(row.joint),
            Value::Texts(row.joints),
            Value::Text(row.effort_unit),
            Value::Text(row.size_unit),
            Value::Stamp(row.t_ns),
            Value::Stamp(row.end_ns),
            Value::Stamp(row.contact_ns),
            Value::Count(row.samples),
            Value::Count(row.moving_samples),
            Value::Count(row.lost_samples),
            Value::Count(row.events),
            Value::Number(row.duration_s),
            Value::Number(row.score),
            Value::Number(row.threshold),
            Value::Number(x),
            Value::Number(y),
            Value::Number(z),
            Value::Number(row.size),
            Value::Number(row.residual_rms),
            Value::Number(row.residual_rms_moving),
            Value::Number(row.filtered_residual_rms),
            Value::Flag(row.alarm),
            Value::Flag(row.ready),
        ];
        for (column, value) in self.columns.iter_mut().zip(&values) {
            column.push(value);
        }
        self.rows += 1;
        if self.rows == GROUP_ROWS {
            self.end_group()?;
        }
        Ok(())
    }

    /// Writes the buffered rows as a separate row group, so that readers of other rows can skip it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn end_group(&mut self) -> Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        let columns = self.columns.iter_mut().map(Column::finish).collect();
        self.rows = 0;
        self.writer
            .write(&RecordBatch::try_new(schema(), columns)?)?;
        self.writer.flush()
    }

    /// Writes the buffered rows and syncs the file to disk.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<(), ParquetError> {
        self.end_group()?;
        let file = self.writer.into_inner()?;
        file.sync_all()
            .map_err(|error| ParquetError::External(Box::new(error)))
    }
}

/// Writes a row for each sample of a detector.
impl Sink for &mut RowWriter {
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        let SampleRef::Detection(sample) = sample else {
            return Ok(());
        };
        let row = of_detection(from, sample);
        self.push(&row)
            .map_err(|error| StageError::failed(error.to_string()))
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.end_group()
            .map_err(|error| StageError::failed(error.to_string()))
    }
}

fn of_detection<'a>(stage: &'a str, sample: &'a Detection) -> Row<'a> {
    let ready = sample.header.has(flags::READY);
    let link = sample.link.as_str();
    Row {
        row: "detection",
        stage: Some(stage),
        detector: Some(sample.detector.as_str()),
        kind: Some(sample.state.as_str()),
        link: (!link.is_empty()).then_some(link),
        t_ns: Some(sample.header.stamp_ns),
        score: ready.then_some(sample.score),
        threshold: ready.then_some(sample.threshold),
        force_n: sample.header.has(flags::FORCE).then_some(sample.force_n),
        alarm: Some(sample.alarm()),
        ready: Some(ready),
        ..Row::default()
    }
}
