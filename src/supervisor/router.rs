//! Router between the stages of this host and other hosts.

use std::net::{Ipv4Addr, TcpListener};

use anyhow::Context;
use tauscope_bus::{ZenohEndpoints, ZenohRouter};
use tauscope_pipeline::pipeline::Pipeline;

use crate::plan::{Link, Over};

/// The router of this host. It owns the host's endpoints, which only one process can, and forwards between them and
/// the stages, which connect to it over loopback.
#[derive(Debug)]
pub struct Router {
    /// Forwards until it is dropped.
    _router: ZenohRouter,
    local: String,
}

impl Router {
    /// Opens the endpoints of `host`, if any of its links goes to another host.
    pub fn open(
        pipeline: &Pipeline,
        links: &[Link],
        host: Option<&str>,
    ) -> anyhow::Result<Option<Self>> {
        let Some((name, entry)) = host.and_then(|host| pipeline.hosts.get_key_value(host)) else {
            return Ok(None);
        };
        let is_here = |at: usize| pipeline.stages[at].host.as_ref() == Some(name);
        let leaves =
            |link: &Link| link.over == Over::Zenoh && (is_here(link.from) || is_here(link.to));
        if !links.iter().any(leaves) {
            return Ok(None);
        }
        let local = free_local_endpoint().context("no free port on 127.0.0.1")?;
        let mut listen = entry.listen.0.clone();
        listen.push(local.clone());
        let endpoints = ZenohEndpoints {
            listen,
            connect: entry.connect.0.clone(),
        };
        let router = ZenohRouter::open(&endpoints)
            .with_context(|| format!("cannot open the endpoints of host `{name}`"))?;
        Ok(Some(Self {
            _router: router,
            local,
        }))
    }

    /// Returns the endpoint to which this host's stages connect.
    pub fn endpoint(&self) -> &str {
        &self.local
    }
}

/// Returns an endpoint that was free a moment ago.
fn free_local_endpoint() -> std::io::Result<String> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    Ok(format!("tcp/{}", listener.local_addr()?))
}
