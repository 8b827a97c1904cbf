//! The leaf of a plan that reads recordings.

use std::sync::Arc;

use arrow::datatypes::SchemaRef;
use arrow::record_batch::RecordBatch;
use datafusion::common::internal_err;
use datafusion::error::{DataFusionError, Result};
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::physical_expr::EquivalenceProperties;
use datafusion::physical_plan::execution_plan::{Boundedness, EmissionType};
use datafusion::physical_plan::metrics::{
    BaselineMetrics, Count, ExecutionPlanMetricsSet, MetricBuilder, MetricsSet,
};
use datafusion::physical_plan::stream::RecordBatchReceiverStreamBuilder;
use datafusion::physical_plan::{
    DisplayAs, DisplayFormatType, ExecutionPlan, Partitioning, PlanProperties,
};
use serde::{Deserialize, Serialize};
use tauscope_archive::Recording;

use crate::asked::Asked;
use crate::table::{Kind, Listed};
use crate::{joints, recordings, replay};

/// Batches that wait for whoever asked.
/// Resolution: memory, against threads that wait for each other.
const WAITING: usize = 2;

/// What is read of which recordings: plain data, which a plan carries to another machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scan {
    /// What is read.
    pub kind: Kind,
    /// The recordings of each partition.
    pub partitions: Vec<Vec<Listed>>,
    /// Recordings of the table that the query does not ask for.
    pub skipped: usize,
    /// What the query asks for.
    pub asked: Asked,
    /// The columns, by their place; `None` for all.
    pub projection: Option<Vec<usize>>,
    /// Rows of a partition after which no more are wanted.
    pub limit: Option<usize>,
}

impl Scan {
    /// The columns of the rows.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn schema(&self) -> Result<SchemaRef> {
        let all = self.kind.schema();
        Ok(match &self.projection {
            Some(columns) => Arc::new(all.project(columns)?),
            None => all,
        })
    }
}

/// Reads recordings.
#[derive(Debug)]
pub struct ArchiveExec {
    scan: Scan,
    properties: Arc<PlanProperties>,
    metrics: ExecutionPlanMetricsSet,
}

/// What `EXPLAIN ANALYZE` counts.
pub(crate) struct Counts {
    /// Recordings that were opened.
    pub(crate) opened: Count,
    /// Chunks that were read and unpacked.
    pub(crate) chunks_read: Count,
    /// Chunks of the opened recordings that were not.
    pub(crate) chunks_skipped: Count,
}

impl ArchiveExec {
    /// The plan of a scan.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn new(scan: Scan) -> Result<Self> {
        let properties = PlanProperties::new(
            EquivalenceProperties::new(scan.schema()?),
            Partitioning::UnknownPartitioning(scan.partitions.len()),
            EmissionType::Incremental,
            Boundedness::Bounded,
        );
        Ok(Self {
            scan,
            properties: Arc::new(properties),
            metrics: ExecutionPlanMetricsSet::new(),
        })
    }

    /// What is read.
    pub fn scan(&self) -> &Scan {
        &self.scan
    }
}

impl DisplayAs for ArchiveExec {
    fn fmt_as(&self, _: DisplayFormatType, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Scan {
            kind,
            partitions,
            skipped,
            asked,
            ..
        } = &self.scan;
        let wanted: usize = partitions.iter().map(Vec::len).sum();
        let name = match kind {
            Kind::Recordings => "recordings".to_owned(),
            Kind::Joints => "joints".to_owned(),
            Kind::Replay { pipeline, .. } => format!("replay of {}", pipeline.display()),
        };
        write!(
            f,
            "ArchiveExec: {name}, recordings={wanted} of {}",
            wanted + skipped
        )?;
        if asked.log_ns != Asked::default().log_ns {
            write!(
                f,
                ", log_ns={}..={}",
                asked.log_ns.start(),
                asked.log_ns.end()
            )?;
        }
        if let Some(topics) = &asked.topics {
            write!(f, ", topics={topics:?}")?;
        }
        Ok(())
    }
}

impl ExecutionPlan for ArchiveExec {
    fn name(&self) -> &'static str {
        "ArchiveExec"
    }

    fn properties(&self) -> &Arc<PlanProperties> {
        &self.properties
    }

    fn children(&self) -> Vec<&Arc<dyn ExecutionPlan>> {
        Vec::new()
    }

    fn with_new_children(
        self: Arc<Self>,
        children: Vec<Arc<dyn ExecutionPlan>>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        if children.is_empty() {
            return Ok(self);
        }
        internal_err!("ArchiveExec reads files and has no child")
    }

    fn execute(&self, partition: usize, _: Arc<TaskContext>) -> Result<SendableRecordBatchStream> {
        let Some(listed) = self.scan.partitions.get(partition).cloned() else {
            return internal_err!("partition {partition} of {}", self.scan.partitions.len());
        };
        let mut scan = self.scan.clone();
        scan.partitions.clear();
        let counter = |name| MetricBuilder::new(&self.metrics).counter(name, partition);
        let counts = Counts {
            opened: counter("recordings_opened"),
            chunks_read: counter("chunks_read"),
            chunks_skipped: counter("chunks_skipped"),
        };
        let baseline = BaselineMetrics::new(&self.metrics, partition);
        let mut builder = RecordBatchReceiverStreamBuilder::new(scan.schema()?, WAITING);
        let sender = builder.tx();
        builder.spawn_blocking(move || {
            let timer = baseline.elapsed_compute().timer();
            let mut left = scan.limit.unwrap_or(usize::MAX);
            let mut give = |batch: RecordBatch| {
                let batch = batch.slice(0, batch.num_rows().min(left));
                left -= batch.num_rows();
                baseline.record_output(batch.num_rows());
                // Whoever asked may have enough, and be gone.
                sender.blocking_send(Ok(batch)).is_ok() && left > 0
            };
            let read = match &scan.kind {
                Kind::Recordings => recordings::read(&listed, &scan, &counts, &mut give),
                Kind::Joints => joints::read(&listed, &scan, &counts, &mut give),
                Kind::Replay { .. } => {
                    let gone = || sender.is_closed();
                    replay::read(&listed, &scan, &counts, &gone, &mut give)
                }
            };
            timer.done();
            read
        });
        Ok(builder.build())
    }

    fn metrics(&self) -> Option<MetricsSet> {
        Some(self.metrics.clone_inner())
    }
}

/// Opens a recording that is still what the plan names.
///
/// # Errors
/// If it cannot be opened, or has another size by now.
pub(crate) fn open(listed: &Listed, counts: &Counts) -> Result<Recording> {
    let recording = Recording::open(&listed.path).map_err(external)?;
    if listed.bytes != 0 && recording.bytes() != listed.bytes {
        let path = listed.path.display();
        return Err(external(format!(
            "{path}: it has {} bytes, and had {} when the query was planned: ask again",
            recording.bytes(),
            listed.bytes
        )));
    }
    counts.opened.add(1);
    Ok(recording)
}

/// An error that `DataFusion` hands on.
pub(crate) fn external(
    error: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> DataFusionError {
    DataFusionError::External(error.into())
}
