//! Tables that are read from recordings.

use std::sync::Arc;

use arrow::datatypes::SchemaRef;
use async_trait::async_trait;
use datafusion::catalog::{Session, TableProvider};
use datafusion::error::Result;
use datafusion::logical_expr::{Expr, TableProviderFilterPushDown, TableType};
use datafusion::physical_plan::ExecutionPlan;
use datafusion::physical_plan::empty::EmptyExec;
use datafusion::prelude::SessionContext;
use serde::{Deserialize, Serialize};
use tauscope_pipeline::replay::stem;
use tauscope_pipeline::report::{Problem, Report};

use crate::asked::Asked;
use crate::exec::ArchiveExec;
use crate::scan::{Kind, Listed, Scan};

/// A table over recordings. It holds only their names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArchiveTable {
    /// Kind of the rows.
    pub kind: Kind,
    /// The recordings.
    pub recordings: Vec<Listed>,
}

/// Registers `recordings` and `joints`.
///
/// # Errors
/// If the session already has such tables.
pub fn register(context: &SessionContext, recordings: &[Listed]) -> Result<(), Report> {
    if recordings.is_empty() {
        return Ok(());
    }
    for (name, kind) in [("recordings", Kind::Recordings), ("joints", Kind::Joints)] {
        let recordings = recordings.to_vec();
        let table = Arc::new(ArchiveTable { kind, recordings });
        context
            .register_table(name, table)
            .map_err(|error| Problem::new(error.to_string()))?;
    }
    Ok(())
}

#[async_trait]
impl TableProvider for ArchiveTable {
    fn schema(&self) -> SchemaRef {
        self.kind.schema()
    }

    fn table_type(&self) -> TableType {
        TableType::Base
    }

    /// Filters reduce the data that is read; `DataFusion` applies them again to the rows.
    fn supports_filters_pushdown(
        &self,
        filters: &[&Expr],
    ) -> Result<Vec<TableProviderFilterPushDown>> {
        let of = |filter: &&Expr| match Asked::takes(filter) {
            true => TableProviderFilterPushDown::Inexact,
            false => TableProviderFilterPushDown::Unsupported,
        };
        Ok(filters.iter().map(of).collect())
    }

    /// Assigns a fixed list of recordings to each partition, so that repeating a partition reads the same files.
    async fn scan(
        &self,
        state: &dyn Session,
        projection: Option<&Vec<usize>>,
        filters: &[Expr],
        limit: Option<usize>,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let asked = Asked::of(filters);
        let wanted = |one: &&Listed| asked.wants(&stem(&one.path));
        let wanted: Vec<&Listed> = self.recordings.iter().filter(wanted).collect();
        let count = wanted.len().min(state.config().target_partitions().max(1));
        let mut partitions = vec![Vec::new(); count];
        for (index, one) in wanted.iter().enumerate() {
            // Neighbours are distributed over the partitions, because recordings of one day are similar.
            partitions[index % count].push((*one).clone());
        }
        let scan = Scan {
            kind: self.kind.clone(),
            partitions,
            skipped: self.recordings.len() - wanted.len(),
            asked,
            projection: projection.cloned(),
            limit,
        };
        if count == 0 {
            return Ok(Arc::new(EmptyExec::new(
                scan.projected(&scan.kind.schema())?,
            )));
        }
        Ok(Arc::new(ArchiveExec::new(scan)?))
    }
}
