//! `replay('pipeline.yaml', 'archive/*.mcap')`: events of recordings that are replayed as the query asks.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use async_trait::async_trait;
use datafusion::catalog::{Session, TableFunctionArgs, TableFunctionImpl, TableProvider};
use datafusion::common::ScalarValue;
use datafusion::error::{DataFusionError, Result};
use datafusion::logical_expr::{Expr, TableType, col, lit};
use datafusion::physical_plan::ExecutionPlan;
use datafusion::prelude::{ParquetReadOptions, SessionContext};
use tauscope_pipeline::parallel;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::replay::{Replay, TwinChoice};
use tauscope_pipeline::results::{Folder, Identity, Unit, Wanted, parquet_files, schema};

/// The table function.
#[derive(Debug)]
pub struct ReplayFunction;

impl TableFunctionImpl for ReplayFunction {
    fn call_with_args(&self, args: TableFunctionArgs) -> Result<Arc<dyn TableProvider>> {
        let texts: Option<Vec<String>> = args.exprs().iter().map(text).collect();
        let Some([pipeline, pattern]) = texts.as_deref() else {
            return Err(DataFusionError::Plan(
                "replay takes a pipeline file and recordings: replay('pipeline.yaml', 'archive/*.mcap')"
                    .to_owned(),
            ));
        };
        Ok(Arc::new(Replayed {
            pipeline: pipeline.into(),
            recordings: crate::expand(&[PathBuf::from(pattern)]).map_err(failed)?,
        }))
    }
}

fn text(expr: &Expr) -> Option<String> {
    match expr {
        Expr::Literal(ScalarValue::Utf8(text) | ScalarValue::Utf8View(text), _) => text.clone(),
        _ => None,
    }
}

fn failed(error: impl std::fmt::Display) -> DataFusionError {
    DataFusionError::External(error.to_string().into())
}

/// The rows of the results: those of events and changes of the arm.
#[derive(Debug)]
struct Replayed {
    pipeline: PathBuf,
    recordings: Vec<PathBuf>,
}

#[async_trait]
impl TableProvider for Replayed {
    fn schema(&self) -> arrow::datatypes::SchemaRef {
        schema()
    }

    fn table_type(&self) -> TableType {
        TableType::Temporary
    }

    /// Replays into a folder that is gone with the plan, and scans that.
    async fn scan(
        &self,
        state: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let (pipeline, recordings) = (self.pipeline.clone(), self.recordings.clone());
        let folder = std::env::temp_dir().join(format!("tauscope-query-{}", std::process::id()));
        let out = folder.clone();
        let replayed = tokio::task::spawn_blocking(move || replay_all(&pipeline, &recordings, &out));
        let files = replayed.await.map_err(failed)??;
        let context = SessionContext::new();
        let schema = schema();
        let options = ParquetReadOptions::default().schema(&schema);
        let frame = context.read_parquet(files, options).await?;
        let events = col("row").eq(lit("event")).or(col("row").eq(lit("physics")));
        let batches = frame.filter(events)?.collect().await;
        // The events are in memory by now, and nothing else is needed.
        let _ = std::fs::remove_dir_all(&folder);
        let table = datafusion::catalog::MemTable::try_new(schema, vec![batches?])?;
        table.scan(state, projection, filters, limit).await
    }
}

/// The files of the results.
fn replay_all(pipeline: &Path, recordings: &[PathBuf], out: &Path) -> Result<Vec<String>> {
    let pipeline = Pipeline::load(pipeline, None).map_err(failed)?;
    let replay = Replay::new(&pipeline, None, TwinChoice::Recompute).map_err(failed)?;
    let identity = Identity::of(&pipeline, TwinChoice::Recompute, false).map_err(failed)?;
    let shelf = Folder::open(out).map_err(failed)?;
    let unit = Unit {
        replay: &replay,
        identity: &identity,
        shelf: &shelf,
        with_scores: false,
    };
    let jobs = std::thread::available_parallelism().map_or(1, usize::from);
    let done = parallel::map(jobs, recordings.iter().collect(), |recording: &PathBuf| {
        let wanted = Wanted::of(recording, None)?;
        unit.run(&wanted, &mut |_| true)
            .map_err(|error| error.to_string())
    });
    for (recording, done) in recordings.iter().zip(done) {
        done.map_err(|error| failed(format!("{}: {error}", recording.display())))?;
    }
    let files = parquet_files(out).map_err(failed)?;
    Ok(files.iter().map(|path| path.display().to_string()).collect())
}
