//! The tables of archives: what recordings there are, and the joint states in them.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{Float64Builder, Int64Array, Int64Builder, RecordBatch, StringArray, StringBuilder, UInt64Array};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use async_trait::async_trait;
use datafusion::catalog::{MemTable, Session, TableProvider};
use datafusion::common::ScalarValue;
use datafusion::error::{DataFusionError, Result};
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::logical_expr::{BinaryExpr, Expr, Operator, TableProviderFilterPushDown, TableType};
use datafusion::physical_plan::ExecutionPlan;
use datafusion::physical_plan::stream::RecordBatchReceiverStreamBuilder;
use datafusion::physical_plan::streaming::{PartitionStream, StreamingTableExec};
use datafusion::prelude::SessionContext;
use tauscope_archive::Recording;
use tauscope_archive::ros::{JointState, JointStateDecoder};
use tauscope_pipeline::replay::stem;

/// Rows of a batch.
/// Resolution: memory, against the cost of a batch.
const BATCH_ROWS: usize = 8192;

/// Registers `recordings` and `joints`.
///
/// # Errors
/// If a recording cannot be opened.
pub fn register(context: &SessionContext, paths: Vec<PathBuf>) -> anyhow::Result<()> {
    if paths.is_empty() {
        return Ok(());
    }
    let mut rows = Vec::new();
    for path in &paths {
        rows.push(Recording::open(path)?);
    }
    let texts = |text: fn(&Recording) -> String| Arc::new(rows.iter().map(|r| Some(text(r))).collect::<StringArray>());
    let counts = |count: fn(&Recording) -> u64| Arc::new(rows.iter().map(count).collect::<UInt64Array>());
    let stamps = |stamp: fn(&Recording) -> Option<i64>| Arc::new(rows.iter().map(stamp).collect::<Int64Array>());
    let batch = RecordBatch::try_from_iter([
        ("recording", texts(|r| stem(r.path())) as _),
        ("path", texts(|r| r.path().display().to_string()) as _),
        ("log_start_ns", stamps(Recording::start_ns) as _),
        ("log_end_ns", stamps(Recording::end_ns) as _),
        ("messages", counts(Recording::message_count) as _),
        ("bytes", counts(Recording::bytes) as _),
        ("damages", counts(|r| r.damage().len() as u64) as _),
    ])?;
    let recordings = MemTable::try_new(batch.schema(), vec![vec![batch]])?;
    context.register_table("recordings", Arc::new(recordings))?;
    context.register_table("joints", Arc::new(Joints { paths }))?;
    Ok(())
}

fn schema() -> SchemaRef {
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

/// A row for each joint of each joint state.
#[derive(Debug)]
struct Joints {
    paths: Vec<PathBuf>,
}

/// What a query asks of the joint states, as far as it saves reading.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Asked {
    log_ns: RangeInclusive<i64>,
    topic: Option<String>,
    recording: Option<String>,
}

impl Asked {
    /// From the terms of a WHERE, all of which hold.
    fn of(filters: &[Expr]) -> Self {
        let mut asked = Self {
            log_ns: i64::MIN..=i64::MAX,
            topic: None,
            recording: None,
        };
        for filter in filters {
            asked.add(filter);
        }
        asked
    }

    /// Takes a term in; false if it saves nothing.
    fn add(&mut self, filter: &Expr) -> bool {
        match filter {
            Expr::BinaryExpr(BinaryExpr { left, op, right }) => match (&**left, op, &**right) {
                (_, Operator::And, _) => {
                    let left = self.add(left);
                    self.add(right) || left
                }
                (Expr::Column(column), op, Expr::Literal(value, _)) => {
                    self.compare(&column.name, *op, value)
                }
                (Expr::Literal(value, _), op, Expr::Column(column)) => op
                    .swap()
                    .is_some_and(|op| self.compare(&column.name, op, value)),
                _ => false,
            },
            Expr::Between(between) if !between.negated => {
                match (&*between.expr, &*between.low, &*between.high) {
                    (Expr::Column(column), Expr::Literal(low, _), Expr::Literal(high, _)) => {
                        let from = self.compare(&column.name, Operator::GtEq, low);
                        self.compare(&column.name, Operator::LtEq, high) || from
                    }
                    _ => false,
                }
            }
            _ => false,
        }
    }

    fn compare(&mut self, column: &str, op: Operator, value: &ScalarValue) -> bool {
        match (column, op, value) {
            ("log_ns", op, ScalarValue::Int64(Some(ns))) => {
                let (start, end) = (*self.log_ns.start(), *self.log_ns.end());
                self.log_ns = match op {
                    Operator::Eq => start.max(*ns)..=end.min(*ns),
                    Operator::Gt | Operator::GtEq => start.max(*ns)..=end,
                    Operator::Lt | Operator::LtEq => start..=end.min(*ns),
                    _ => return false,
                };
                true
            }
            (
                "topic" | "recording",
                Operator::Eq,
                ScalarValue::Utf8(Some(text)) | ScalarValue::Utf8View(Some(text)),
            ) => {
                let slot = if column == "topic" {
                    &mut self.topic
                } else {
                    &mut self.recording
                };
                *slot = Some(text.clone());
                true
            }
            _ => false,
        }
    }
}

#[async_trait]
impl TableProvider for Joints {
    fn schema(&self) -> SchemaRef {
        schema()
    }

    fn table_type(&self) -> TableType {
        TableType::Base
    }

    /// What is not wanted is not read; what is read beside it, DataFusion filters.
    fn supports_filters_pushdown(
        &self,
        filters: &[&Expr],
    ) -> Result<Vec<TableProviderFilterPushDown>> {
        let of = |filter: &&Expr| {
            if Asked::of(&[]).add(filter) {
                TableProviderFilterPushDown::Inexact
            } else {
                TableProviderFilterPushDown::Unsupported
            }
        };
        Ok(filters.iter().map(of).collect())
    }

    async fn scan(
        &self,
        _: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let asked = Asked::of(filters);
        let wanted = |path: &&PathBuf| asked.recording.as_ref().is_none_or(|name| *name == stem(path));
        let partitions = self.paths.iter().filter(wanted).map(|path| {
            Arc::new(RecordingStream {
                schema: schema(),
                path: path.clone(),
                asked: asked.clone(),
            }) as Arc<dyn PartitionStream>
        });
        Ok(Arc::new(StreamingTableExec::try_new(
            schema(),
            partitions.collect(),
            projection,
            [],
            false,
            limit,
        )?))
    }
}

/// The joint states of one recording.
#[derive(Debug)]
struct RecordingStream {
    schema: SchemaRef,
    path: PathBuf,
    asked: Asked,
}

impl PartitionStream for RecordingStream {
    fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    fn execute(&self, _: Arc<TaskContext>) -> SendableRecordBatchStream {
        let mut builder = RecordBatchReceiverStreamBuilder::new(Arc::clone(&self.schema), 2);
        let sender = builder.tx();
        let (path, asked) = (self.path.clone(), self.asked.clone());
        builder.spawn_blocking(move || {
            read(&path, &asked, &mut |batch| {
                // Whoever asked may have enough.
                sender.blocking_send(Ok(batch)).is_ok()
            })
        });
        builder.build()
    }
}

/// Gives the joint states of a recording, batch by batch, until `give` says that it is enough.
fn read(
    path: &std::path::Path,
    asked: &Asked,
    give: &mut dyn FnMut(RecordBatch) -> bool,
) -> Result<()> {
    let failed = |error: tauscope_archive::ArchiveError| DataFusionError::External(Box::new(error));
    let recording = Recording::open(path).map_err(failed)?;
    let mut topics: Vec<&str> = (recording.topics().iter())
        .filter(|topic| topic.joint_state_type().is_some() && topic.message_encoding == "cdr")
        .map(|topic| topic.name.as_str())
        .filter(|name| asked.topic.as_ref().is_none_or(|topic| topic == name))
        .collect();
    topics.dedup();
    let mut messages = recording
        .messages_within(&topics, asked.log_ns.clone())
        .map_err(failed)?;
    let mut rows = Rows::new(stem(path));
    let mut decoder = JointStateDecoder::default();
    let mut state = JointState::default();
    while let Some(message) = messages.next_message() {
        let decoded = message.and_then(|message| {
            message.joint_state_into(&mut decoder, &mut state)?;
            Ok((message.log_time_ns, message.topic.name.clone()))
        });
        match decoded {
            Ok((log_ns, topic)) => rows.push(log_ns, &topic, &state),
            // What lies behind it can be read.
            Err(error) if error.damage().is_some() => {
                eprintln!("warning: {error}");
                continue;
            }
            Err(error) => return Err(failed(error)),
        }
        if rows.count >= BATCH_ROWS && !give(rows.take()?) {
            return Ok(());
        }
    }
    if rows.count > 0 {
        give(rows.take()?);
    }
    Ok(())
}

struct Rows {
    recording: String,
    count: usize,
    texts: [StringBuilder; 3],
    stamps: [Int64Builder; 2],
    numbers: [Float64Builder; 3],
}

impl Rows {
    fn new(recording: String) -> Self {
        Self {
            recording,
            count: 0,
            texts: Default::default(),
            stamps: Default::default(),
            numbers: Default::default(),
        }
    }

    fn push(&mut self, log_ns: i64, topic: &str, state: &JointState) {
        let t_ns = state.header.stamp.ns();
        for (j, joint) in state.name.iter().enumerate() {
            self.count += 1;
            for (column, text) in self.texts.iter_mut().zip([&self.recording, topic, joint]) {
                column.append_value(text);
            }
            for (column, stamp) in self.stamps.iter_mut().zip([log_ns, t_ns]) {
                column.append_value(stamp);
            }
            let values = [&state.position, &state.velocity, &state.effort];
            for (column, values) in self.numbers.iter_mut().zip(values) {
                column.append_option(values.get(j).copied().filter(|value| value.is_finite()));
            }
        }
    }

    fn take(&mut self) -> Result<RecordBatch> {
        self.count = 0;
        let [recording, topic, joint] = &mut self.texts;
        let [log, stamp] = &mut self.stamps;
        let [position, velocity, effort] = &mut self.numbers;
        Ok(RecordBatch::try_new(
            schema(),
            vec![
                Arc::new(recording.finish()),
                Arc::new(topic.finish()),
                Arc::new(log.finish()),
                Arc::new(stamp.finish()),
                Arc::new(joint.finish()),
                Arc::new(position.finish()),
                Arc::new(velocity.finish()),
                Arc::new(effort.finish()),
            ],
        )?)
    }
}

#[cfg(test)]
mod tests {
    use datafusion::prelude::{col, lit};

    use super::*;

    #[test]
    fn times_topic_and_recording_of_a_query_save_reading_and_nothing_else_does() {
        let asked = Asked::of(&[
            col("log_ns").gt_eq(lit(5_i64)).and(lit(9_i64).gt(col("log_ns"))),
            col("topic").eq(lit("/joint_states")),
            col("effort").gt(lit(1.0)),
        ]);
        assert_eq!(asked.log_ns, 5..=9);
        assert_eq!(asked.topic.as_deref(), Some("/joint_states"));
        // One of two conditions may fail.
        let either = col("log_ns").gt(lit(5_i64)).or(col("effort").gt(lit(1.0)));
        assert_eq!(Asked::of(&[either]), Asked::of(&[]));
    }
}
