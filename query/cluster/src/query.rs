//! `tauscope cluster query`: as `tauscope query`, on the executors of a scheduler.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context as _;
use ballista_core::extension::{SessionConfigExt as _, SessionStateExt as _};
use datafusion::execution::SessionStateBuilder;
use datafusion::prelude::{SessionConfig, SessionContext};
use tauscope_query::output::Answer;

use crate::codec::{LogicalCodec, PhysicalCodec};
use crate::{MAX_MESSAGE_BYTES, Rejected, handshake};

/// Run an SQL query on the executors. The recordings have the same paths on all machines.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The query.
    sql: String,
    /// Recordings, manifests and folders of results, or patterns of them in quotes.
    paths: Vec<PathBuf>,
    /// The scheduler, host and port.
    #[arg(long, default_value = "127.0.0.1:50050")]
    scheduler: String,
    /// Partitions of the recordings. A partition is executed again if its executor dies.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u16).range(1..))]
    partitions: u16,
    /// Time after which the query is aborted [s].
    #[arg(long, default_value_t = 3600, value_name = "S")]
    deadline_s: u64,
    #[command(flatten)]
    answer: Answer,
}

/// Runs the query and writes the answer.
///
/// # Errors
/// If the query is invalid, the scheduler is another build, or there is no answer in time.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    args.answer.check().map_err(Rejected)?;
    handshake::check(&args.scheduler).await?;
    let config = SessionConfig::new_with_ballista()
        .with_target_partitions(usize::from(args.partitions))
        .with_ballista_grpc_client_max_message_size(MAX_MESSAGE_BYTES as usize)
        .with_ballista_logical_extension_codec(Arc::new(LogicalCodec::default()))
        .with_ballista_physical_extension_codec(Arc::new(PhysicalCodec::default()));
    let state = SessionStateBuilder::new()
        .with_config(config)
        .with_default_features()
        .build();
    let state = state.upgrade_for_ballista(format!("http://{}", args.scheduler))?;
    let context = SessionContext::new_with_state(state);
    tauscope_query::register(&context, &args.paths)
        .await
        .map_err(Rejected)?;
    let frame = tauscope_query::plan(&context, &args.sql)
        .await
        .map_err(Rejected)?;
    let deadline = Duration::from_secs(args.deadline_s);
    let answered = tokio::time::timeout(deadline, args.answer.write(frame)).await;
    answered.with_context(|| format!("no answer within {} s: given up", args.deadline_s))?
}
