//! The leaf of a plan that reads recordings.

use std::sync::Arc;

use arrow::datatypes::SchemaRef;
use arrow::record_batch::RecordBatch;
use datafusion::common::internal_err;
use datafusion::error::Result;
use datafusion::execution::{SendableRecordBatchStream, TaskContext};
use datafusion::physical_expr::EquivalenceProperties;
use datafusion::physical_plan::execution_plan::{Boundedness, EmissionType};
use datafusion::physical_plan::metrics::{
    BaselineMetrics, ExecutionPlanMetricsSet, MetricBuilder, MetricsSet,
};
use datafusion::physical_plan::stream::RecordBatchReceiverStreamBuilder;
use datafusion::physical_plan::{
    DisplayAs, DisplayFormatType, ExecutionPlan, Partitioning, PlanProperties,
};
use tauscope_pipeline::results;

use crate::asked::Asked;
use crate::scan::{Counts, Kind, Scan};
use crate::{joints, recordings, replay};

/// Batches buffered for the consumer.
/// Resolution: memory, against threads that wait for each other.
const WAITING: usize = 2;

impl Kind {
    /// Schema of the table.
    pub fn schema(&self) -> SchemaRef {
        match self {
            Self::Recordings => recordings::schema(),
            Self::Joints => joints::schema(),
            Self::Replay { .. } => results::schema(),
        }
    }
}

/// Plan node that reads recordings.
#[derive(Debug)]
pub struct ArchiveExec {
    scan: Scan,
    properties: Arc<PlanProperties>,
    metrics: ExecutionPlanMetricsSet,
}

impl ArchiveExec {
    /// Creates the plan node of a scan.
    ///
    /// # Errors
    /// If a projected column does not exist.
    pub fn new(scan: Scan) -> Result<Self> {
        let properties = PlanProperties::new(
            EquivalenceProperties::new(scan.projected(&scan.kind.schema())?),
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

    /// The scan of this node.
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
        let mut builder =
            RecordBatchReceiverStreamBuilder::new(scan.projected(&scan.kind.schema())?, WAITING);
        let sender = builder.tx();
        builder.spawn_blocking(move || {
            let timer = baseline.elapsed_compute().timer();
            let mut left = scan.limit.unwrap_or(usize::MAX);
            let mut give = |batch: RecordBatch| {
                let batch = batch.slice(0, batch.num_rows().min(left));
                left -= batch.num_rows();
                baseline.record_output(batch.num_rows());
                // The consumer may have enough rows and have dropped the channel.
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
