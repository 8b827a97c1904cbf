//! SQL over archives and over the results of replays.
//!
//! [`session`] creates a `DataFusion` session with the tables, [`answer`] runs a query in it. Recordings are read by
//! one table provider, [`ArchiveTable`], and one leaf of the plan, [`ArchiveExec`]; both are plain data, so that a
//! cluster can send them.

mod asked;
mod exec;
mod function;
mod joints;
pub mod output;
pub mod problem;
mod recordings;
mod replay;
mod results;
mod scan;
mod sources;
mod table;

use std::path::PathBuf;
use std::sync::Arc;

use datafusion::catalog::TableFunctionImpl;
use datafusion::dataframe::DataFrame;
use datafusion::prelude::SessionContext;
use tauscope_pipeline::report::Report;

pub use asked::Asked;
pub use exec::ArchiveExec;
pub use function::ReplayFunction;
pub use scan::{Kind, Listed, Scan};
pub use sources::Sources;
pub use table::ArchiveTable;

/// Registers the tables over `paths` and the function `replay` in a session.
///
/// # Errors
/// If a path is neither a recording nor a result, or cannot be read.
pub async fn register(context: &SessionContext, paths: &[PathBuf]) -> Result<(), Report> {
    let sources = Sources::of(paths)?;
    table::register(context, &sources.recordings)?;
    results::register(context, &sources.results).await?;
    let function: Arc<dyn TableFunctionImpl> = Arc::new(ReplayFunction);
    context.register_udtf("replay", function);
    Ok(())
}

/// Plans a query over the registered tables.
///
/// # Errors
/// If the query is invalid; with the place of the error and a remedy.
pub async fn plan(context: &SessionContext, sql: &str) -> Result<DataFrame, Report> {
    let frame = context.sql(sql).await;
    frame.map_err(|error| problem::of_query(context, sql, &error))
}
