//! `tauscope cluster executor`.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context as _;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};

use crate::codec::{LogicalCodec, PhysicalCodec};
use crate::{HEARTBEAT_S, MAX_MESSAGE_BYTES, handshake};

/// Read recordings and replay them for a scheduler.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scheduler, host and port.
    #[arg(long, default_value = "127.0.0.1:50050")]
    scheduler: String,
    /// Address to listen on; the scheduler and the other executors reach it there.
    #[arg(long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Port for results; the next one takes tasks.
    #[arg(long, default_value_t = 50051)]
    port: u16,
    /// Tasks at once; 0 for one on each core.
    #[arg(long, default_value_t = 0)]
    tasks: usize,
    /// Folder for results passed between tasks; a temporary one by default.
    #[arg(long)]
    work_dir: Option<PathBuf>,
}

/// Runs until it is terminated.
///
/// # Errors
/// If the scheduler does not answer, or is another build.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    handshake::check(&args.scheduler).await?;
    let (host, port) = args
        .scheduler
        .rsplit_once(':')
        .context("--scheduler is HOST:PORT")?;
    let temporary = tempfile::tempdir()?;
    let work_dir = args.work_dir.as_deref().unwrap_or(temporary.path());
    let config = ExecutorProcessConfig {
        bind_host: args.listen.to_string(),
        external_host: Some(args.listen.to_string()),
        port: args.port,
        grpc_port: args.port + 1,
        scheduler_host: host.to_owned(),
        scheduler_port: port.parse().context("the port of --scheduler")?,
        concurrent_tasks: args.tasks,
        task_scheduling_policy: TaskSchedulingPolicy::PushStaged,
        work_dir: Some(work_dir.display().to_string()),
        executor_heartbeat_interval_seconds: HEARTBEAT_S,
        grpc_max_decoding_message_size: MAX_MESSAGE_BYTES,
        grpc_max_encoding_message_size: MAX_MESSAGE_BYTES,
        override_logical_codec: Some(Arc::new(LogicalCodec::default())),
        override_physical_codec: Some(Arc::new(PhysicalCodec::default())),
        ..ExecutorProcessConfig::default()
    };
    eprintln!("executor at {}:{}", args.listen, args.port);
    start_executor_process(Arc::new(config))
        .await
        .context("the executor")
}
