//! The table `joints`: a row for each joint of each joint state.

use std::collections::BTreeSet;
use std::sync::Arc;

use arrow::array::{
    ArrayRef, Float64Builder, Int64Builder, RecordBatch, RecordBatchOptions, StringBuilder,
};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::error::Result;
use tauscope_archive::Recording;
use tauscope_archive::ros::{JointState, JointStateDecoder};
use tauscope_pipeline::replay::stem;

use crate::scan::{Counts, Listed, Scan, external, open};

/// Rows of a batch.
/// Resolution: memory, against the cost of a batch.
const BATCH_ROWS: usize = 8192;

/// Indices of columns in [`schema`].
const RECORDING: usize = 0;
const LOG_NS: usize = 2;
const JOINT: usize = 4;
const POSITION: usize = 5;
const VELOCITY: usize = 6;

/// Schema of the table.
pub(crate) fn schema() -> SchemaRef {
    let text = |name| Field::new(name, DataType::Utf8, false);
    let stamp = |name| Field::new(name, DataType::Int64, false);
    let number = |name| Field::new(name, DataType::Float64, true);
    Arc::new(Schema::new(vec![
        text("recording"),
        text("topic"),
        stamp("log_ns"),
        stamp("t_ns"),
        text("joint"),
        number("position_rad"),
        number("velocity_rad_s"),
        number("effort"),
    ]))
}

/// Passes the joint states of recordings on, batch by batch, until `give` returns false.
pub(crate) fn read(
    listed: &[Listed],
    scan: &Scan,
    counts: &Counts,
    give: &mut dyn FnMut(RecordBatch) -> bool,
) -> Result<()> {
    let mut rows = Rows::new(scan)?;
    for one in listed {
        let recording = open(one, counts)?;
        rows.recording = stem(&one.path);
        if !read_one(&recording, scan, counts, &mut rows, give)? {
            return Ok(());
        }
    }
    if rows.count > 0 {
        give(rows.take()?);
    }
    Ok(())
}

/// Reads one recording; returns whether more rows are needed.
fn read_one(
    recording: &Recording,
    scan: &Scan,
    counts: &Counts,
    rows: &mut Rows,
    give: &mut dyn FnMut(RecordBatch) -> bool,
) -> Result<bool> {
    let wanted = |name: &str| {
        scan.asked
            .topics
            .as_ref()
            .is_none_or(|topics| topics.contains(name))
    };
    let topics: BTreeSet<&str> = (recording.topics().iter())
        .filter(|topic| topic.joint_state_type().is_some() && topic.message_encoding == "cdr")
        .map(|topic| topic.name.as_str())
        .filter(|name| wanted(name))
        .collect();
    if topics.is_empty() {
        counts.chunks_skipped.add(recording.chunks() as usize);
        return Ok(true);
    }
    let topics: Vec<&str> = topics.into_iter().collect();
    let mut messages = recording
        .messages_within(&topics, scan.asked.log_ns.clone())
        .map_err(external)?;
    let mut decoder = JointStateDecoder::default();
    let mut state = JointState::default();
    let mut on = true;
    while let Some(message) = messages.next_message() {
        let pushed = message.and_then(|message| {
            // Topics with the same name may have several types.
            if message.topic.joint_state_type().is_some() {
                message.joint_state_into(&mut decoder, &mut state)?;
                rows.push(message.log_time_ns, &message.topic.name, &state);
            }
            Ok(())
        });
        match pushed {
            Ok(()) => {}
            // The part after the damage can still be read.
            Err(error) if error.damage().is_some() => eprintln!("warning: {error}"),
            Err(error) => return Err(external(error)),
        }
        if rows.count >= BATCH_ROWS {
            on = give(rows.take()?);
            if !on {
                break;
            }
        }
    }
    let read = messages.chunks_read();
    counts.chunks_read.add(read as usize);
    counts
        .chunks_skipped
        .add(recording.chunks().saturating_sub(read) as usize);
    Ok(on)
}

/// A projected column.
enum Column {
    Text(StringBuilder),
    Stamp(Int64Builder),
    Number(Float64Builder),
}

/// Rows under construction, with the projected columns only.
struct Rows {
    recording: String,
    count: usize,
    schema: SchemaRef,
    /// Columns, each with its index in [`schema`].
    columns: Vec<(usize, Column)>,
}

impl Rows {
    fn new(scan: &Scan) -> Result<Self> {
        let all = schema();
        let places = scan
            .projection
            .clone()
            .unwrap_or_else(|| (0..all.fields().len()).collect());
        let column = |&place: &usize| match all.field(place).data_type() {
            DataType::Int64 => (place, Column::Stamp(Int64Builder::new())),
            DataType::Float64 => (place, Column::Number(Float64Builder::new())),
            _ => (place, Column::Text(StringBuilder::new())),
        };
        Ok(Self {
            recording: String::new(),
            count: 0,
            schema: scan.projected(&all)?,
            columns: places.iter().map(column).collect(),
        })
    }

    /// Appends a row for each joint.
    fn push(&mut self, log_ns: i64, topic: &str, state: &JointState) {
        let t_ns = state.header.stamp.ns();
        let joints = state.name.len();
        self.count += joints;
        for (place, column) in &mut self.columns {
            match column {
                Column::Text(column) if *place == JOINT => {
                    state
                        .name
                        .iter()
                        .for_each(|joint| column.append_value(joint));
                }
                Column::Text(column) => {
                    let text = if *place == RECORDING {
                        &self.recording
                    } else {
                        topic
                    };
                    (0..joints).for_each(|_| column.append_value(text));
                }
                Column::Stamp(column) => {
                    let stamp = if *place == LOG_NS { log_ns } else { t_ns };
                    (0..joints).for_each(|_| column.append_value(stamp));
                }
                Column::Number(column) => {
                    let values = match *place {
                        POSITION => &state.position,
                        VELOCITY => &state.velocity,
                        _ => &state.effort,
                    };
                    for joint in 0..joints {
                        column.append_option(
                            values.get(joint).copied().filter(|value| value.is_finite()),
                        );
                    }
                }
            }
        }
    }

    fn take(&mut self) -> Result<RecordBatch> {
        let columns = self.columns.iter_mut().map(|(_, column)| match column {
            Column::Text(column) => Arc::new(column.finish()) as ArrayRef,
            Column::Stamp(column) => Arc::new(column.finish()),
            Column::Number(column) => Arc::new(column.finish()),
        });
        // Without a column, as for count(*), the batch has only a number of rows.
        let options = RecordBatchOptions::new().with_row_count(Some(self.count));
        let batch = RecordBatch::try_new_with_options(
            Arc::clone(&self.schema),
            columns.collect(),
            &options,
        )?;
        self.count = 0;
        Ok(batch)
    }
}
