//! `tauscope cluster scheduler`.

use std::net::SocketAddr;
use std::sync::Arc;

use anyhow::Context as _;
use ballista_core::config::TaskSchedulingPolicy;
use ballista_core::serde::protobuf::scheduler_grpc_server::SchedulerGrpcServer;
use ballista_scheduler::cluster::BallistaCluster;
use ballista_scheduler::config::SchedulerConfig;
use ballista_scheduler::scheduler_process::create_scheduler;
use datafusion_proto::protobuf::{LogicalPlanNode, PhysicalPlanNode};
use tonic::service::RoutesBuilder;

use crate::codec::{LogicalCodec, PhysicalCodec};
use crate::{HEARTBEAT_S, MAX_MESSAGE_BYTES, handshake};

/// Silence after which an executor is treated as lost and its work reassigned \[s\].
/// Resolution: several heartbeats, against how long a query waits.
const DEAD_AFTER_S: u64 = 5 * HEARTBEAT_S;

/// Plan queries and distribute them to executors.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Address and port to listen on. There is neither encryption nor a password: keep it inside a private network.
    #[arg(long, default_value = "127.0.0.1:50050")]
    listen: SocketAddr,
}

/// Runs until it is terminated.
///
/// # Errors
/// If the address is taken.
pub async fn run(args: &Args) -> anyhow::Result<()> {
    let config = Arc::new(SchedulerConfig {
        external_host: args.listen.ip().to_string(),
        bind_host: args.listen.ip().to_string(),
        bind_port: args.listen.port(),
        scheduling_policy: TaskSchedulingPolicy::PushStaged,
        executor_timeout_seconds: DEAD_AFTER_S,
        expire_dead_executor_interval_seconds: HEARTBEAT_S,
        grpc_server_max_decoding_message_size: MAX_MESSAGE_BYTES,
        grpc_server_max_encoding_message_size: MAX_MESSAGE_BYTES,
        override_logical_codec: Some(Arc::new(LogicalCodec::default())),
        override_physical_codec: Some(Arc::new(PhysicalCodec::default())),
        ..SchedulerConfig::default()
    });
    let build = handshake::build()?;
    let listener = tokio::net::TcpListener::bind(args.listen)
        .await
        .with_context(|| args.listen.to_string())?;
    let cluster = BallistaCluster::new_from_config(&config).await?;
    let scheduler = create_scheduler::<LogicalPlanNode, PhysicalPlanNode>(cluster, config).await?;
    let service = SchedulerGrpcServer::new(scheduler)
        .max_decoding_message_size(MAX_MESSAGE_BYTES as usize)
        .max_encoding_message_size(MAX_MESSAGE_BYTES as usize);
    let mut routes = RoutesBuilder::default();
    routes.add_service(service);
    let routes = routes.routes().into_axum_router();
    let routes = routes.route(
        handshake::PATH,
        axum::routing::get(move || async move { build }),
    );
    eprintln!("scheduler at {}", args.listen);
    let service = routes.into_make_service_with_connect_info::<SocketAddr>();
    axum::serve(listener, service)
        .await
        .context("the scheduler")
}
