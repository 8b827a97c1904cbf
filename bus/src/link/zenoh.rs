//! Links between hosts, over Zenoh.
//!
//! # Protocol
//!
//! | key | content |
//! | --- | --- |
//! | `<stream>`, that is `<cell>/<stage>` or `<cell>/<stage>/health` | samples for keep-all receivers |
//! | `<stream>/@newest` | samples for keep-newest receivers |
//! | `<stream>/@all/<id>.<depth>`, `<stream>/@newest/<id>.<depth>` | liveliness token of each receiver, with its credit in samples |
//! | `<stream>/@from/<instance>` | liveliness token of the sender |
//! | `<stream>/@taken/<id>.<depth>` | acknowledgements of a receiver |
//!
//! (No wildcard matches chunks that begin with `@`, so `<cell>/**` matches samples only.)
//!
//! A message of samples has
//!
//! - encoding `zenoh/bytes;tauscope/JointState/2`, the type name of the sample after the semicolon;
//! - payload: one or more consecutive samples in their memory layout, little-endian, without framing: see
//!   [`wire`](super::wire) for the offsets;
//! - attachment: four little-endian `u64`: the sender's session epoch; the sequence number of the oldest sample still
//!   available; the number of samples lost for good right before the first one of this message; the number of samples
//!   in all earlier sessions of the sender. Each restart of the sender begins a new session, in which the sequence
//!   number in the sample's header counts from 0 again;
//! - congestion control `drop`: no sender waits for a full link, so that a hung or distant receiver blocks neither
//!   other streams nor the stage.
//!
//! An acknowledgement is four little-endian `u64`: the session epoch of the sender; the sequence number expected
//! next; the number of samples before it that are lost for good; and 0 for progress, 1 if samples are missing, or 2
//! if the receiver disconnects.
//!
//! # Retransmission
//!
//! The sender keeps every sample until all keep-all receivers have acknowledged it, within a memory bound (`log.rs`).
//! It retransmits missing samples, also after a network failure, and to a restarted receiver. While the memory is
//! full, a source that reads a file waits; otherwise the oldest sample is discarded. Its sequence number is then lost
//! for good, and both ends count it.
//!
//! # Sender check
//!
//! Receivers accept samples and ends of a stream only from its sender: the session that has a liveliness token, and
//! no other session while that one is alive. Other messages are refused, counted, and reported once. This keeps out
//! stray publishers; a network with hostile participants needs mutual TLS and access rules at its router
//! (`deploy/zenoh`).
//!
//! There is no discovery: sessions connect at the configured endpoints only.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use zenoh::Wait as _;
use zenoh::bytes::Encoding;

use super::{
    Audience, FanOut, Keep, LinkError, PATIENCE, Receiver, Sender, SpillSettings, Transport,
};
use crate::sample::{Sample, SampleKind};

mod endpoint;
mod log;
mod message;
mod receiver;
mod sender;
mod speaker;

pub use endpoint::{EndpointError, check_endpoint};

const TRANSPORT: &str = "zenoh";
/// Default limits of a sender's retransmission window.
/// Resolution: memory.
const SPILL: SpillSettings = SpillSettings {
    bytes: 1 << 20,
    linger_ms: 0,
    waits: true,
};
/// Batches of 64 kB that a session queues for one peer.
/// Resolution: memory; the largest value that Zenoh accepts.
const QUEUE: usize = 16;

/// Sessions that a listener accepts. Beyond its default limit of 1000, Zenoh rejects sessions without a message.
/// Resolution: the number of cells that a fleet host follows.
const MOST_SESSIONS: usize = 10_000;

/// Endpoints of the Zenoh sessions of this host, e.g. `tcp/10.0.0.1:7447`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ZenohEndpoints {
    /// Endpoints to listen on.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Endpoints to connect to; retried until the connection succeeds, and again after it breaks.
    #[serde(default)]
    pub connect: Vec<String>,
}

impl ZenohEndpoints {
    /// Opens a separate session at these endpoints, for traffic other than streams; its peers may start later. Its
    /// mode is `router`: a router forwards the data of peers, such as ROS 2 sessions, to routers and clients but not
    /// to other peers, and a client cannot start before its router.
    ///
    /// # Errors
    /// See [`Zenoh::open`].
    pub fn session(&self) -> Result<zenoh::Session, LinkError> {
        open_session("router", self, PATIENCE)
    }

    /// Opens a separate session whose data only routers and clients receive, such as a fleet host. Its mode is
    /// `peer`: routers announce each change of their links to all other routers, which would overload a network of
    /// a thousand.
    ///
    /// # Errors
    /// See [`Zenoh::open`].
    pub fn session_for_routers(&self) -> Result<zenoh::Session, LinkError> {
        open_session("peer", self, PATIENCE)
    }

    /// Endpoints at which another session on this host reaches a session with these endpoints: its listeners, and the
    /// endpoints that it connects to. A listener on all interfaces is reached at the loopback address.
    pub fn reached_at(&self) -> impl Iterator<Item = String> + '_ {
        let listens = self.listen.iter().map(|endpoint| {
            endpoint
                .replace("/0.0.0.0:", "/127.0.0.1:")
                .replace("/[::]:", "/[::1]:")
        });
        listens.chain(self.connect.iter().cloned())
    }
}

/// Streams between hosts. Clones share one session.
#[derive(Debug, Clone)]
pub struct Zenoh {
    session: zenoh::Session,
    patience: Duration,
    spill: SpillSettings,
    /// Number of samples in all earlier sessions of a sender.
    former: u64,
    /// Number of link ends opened so far, from which each end gets its id.
    ends: Arc<AtomicU64>,
}

impl Zenoh {
    /// Opens a session; its peers may start later.
    ///
    /// # Errors
    /// [`LinkError::Session`] if an endpoint is invalid, or cannot be listened on.
    pub fn open(endpoints: &ZenohEndpoints, patience: Duration) -> Result<Self, LinkError> {
        Ok(Self {
            session: open_session("peer", endpoints, patience)?,
            patience,
            spill: SPILL,
            former: 0,
            ends: Arc::default(),
        })
    }

    /// Sets the limits of a sender's retransmission window.
    #[must_use]
    pub fn with_spill(mut self, spill: SpillSettings) -> Self {
        self.spill = spill;
        self
    }

    /// Sets the number of samples in all earlier sessions of a sender, from which its receivers derive the samples
    /// lost in a crash.
    #[must_use]
    pub fn with_former(mut self, samples: u64) -> Self {
        self.former = samples;
        self
    }

    /// Returns an id for a link end. It differs between sessions, because their ids are random.
    fn unique(&self) -> u64 {
        let id = self.session.zid().to_le_bytes();
        let mut low = [0; 8];
        low.copy_from_slice(&id[..8]);
        u64::from_le_bytes(low).wrapping_add(self.ends.fetch_add(1, Ordering::Relaxed))
    }
}

impl Transport for Zenoh {
    fn sender<T: Sample>(
        &self,
        stream: &str,
        audience: Audience,
    ) -> Result<Box<dyn Sender<T>>, LinkError> {
        let mut links: Vec<Box<dyn Sender<T>>> = Vec::new();
        for keep in [Keep::Newest, Keep::All] {
            if audience.count(keep) > 0 {
                let sender = sender::ZenohSender::<T>::open(self, stream, keep, audience)?;
                links.push(Box::new(sender));
            }
        }
        match links.len() {
            1 => Ok(links.remove(0)),
            _ => Ok(Box::new(FanOut::new(links))),
        }
    }

    fn receiver<T: Sample>(
        &self,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Box<dyn Receiver<T>>, LinkError> {
        Ok(Box::new(receiver::ZenohReceiver::<T>::open(
            self, stream, keep, depth,
        )?))
    }
}

/// The session through which the processes of a host reach other hosts. Only one process can listen on an endpoint:
/// the supervisor keeps this session, and the process of each stage connects to it.
#[derive(Debug)]
pub struct ZenohRouter {
    _session: zenoh::Session,
}

impl ZenohRouter {
    /// Listens on and connects to `endpoints`, and forwards data until it is dropped.
    ///
    /// # Errors
    /// See [`Zenoh::open`].
    pub fn open(endpoints: &ZenohEndpoints) -> Result<Self, LinkError> {
        Ok(Self {
            _session: open_session("router", endpoints, PATIENCE)?,
        })
    }
}

/// Message of a Zenoh error, without its source code locations.
pub fn zenoh_reason(error: &zenoh::Error) -> String {
    without_places(&error.to_string())
}

/// Removes source code locations: `a at /src/c.rs:12. b` becomes `a b`.
fn without_places(text: &str) -> String {
    let mut kept: Vec<&str> = Vec::new();
    for word in text.split(' ') {
        let is_place = word.contains(".rs:");
        if is_place && kept.last() == Some(&"at") {
            kept.pop();
        } else {
            kept.push(word);
        }
    }
    kept.join(" ")
}

fn open_session(
    mode: &str,
    endpoints: &ZenohEndpoints,
    patience: Duration,
) -> Result<zenoh::Session, LinkError> {
    let session = config(mode, endpoints, patience, &[])
        .and_then(|config| zenoh::open(config).wait())
        .map_err(|error| session_error(endpoints, &zenoh_reason(&error)))?;
    endpoint::watch(&session, &endpoints.connect);
    Ok(session)
}

/// Settings of a session; `more` overrides them.
fn config(
    mode: &str,
    endpoints: &ZenohEndpoints,
    patience: Duration,
    more: &[(&str, String)],
) -> zenoh::Result<zenoh::Config> {
    // Longer than the stall timeout: a stalled receiver is given up before Zenoh closes the link because of it.
    let close_after_us = (patience * 2).as_micros().to_string();
    let quoted = |text: &str| format!("{text:?}");
    let settings = [
        ("mode", quoted(mode)),
        ("listen/endpoints", format!("{:?}", endpoints.listen)),
        ("connect/endpoints", format!("{:?}", endpoints.connect)),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        (
            "connect/retry",
            "{period_init_ms: 100, period_max_ms: 500, period_increase_factor: 1.5}".to_owned(),
        ),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
        ("open/return_conditions/connect_scouted", "false".to_owned()),
        ("transport/shared_memory/enabled", "false".to_owned()),
        ("transport/unicast/max_sessions", MOST_SESSIONS.to_string()),
        ("transport/link/tx/queue/size/data", QUEUE.to_string()),
        (
            "transport/link/tx/queue/congestion_control/block/wait_before_close",
            close_after_us,
        ),
    ];
    let mut config = zenoh::Config::default();
    for (key, value) in settings.iter().chain(more) {
        config.insert_json5(key, value)?;
    }
    Ok(config)
}

fn open_error(stream: &str, error: &zenoh::Error) -> LinkError {
    LinkError::Open {
        stream: stream.to_owned(),
        transport: TRANSPORT,
        reason: zenoh_reason(error),
    }
}

fn session_error(endpoints: &ZenohEndpoints, reason: &str) -> LinkError {
    let all = endpoints.listen.iter().chain(&endpoints.connect);
    let all: Vec<&str> = all.map(String::as_str).collect();
    let taken = reason.contains("Address already in use");
    LinkError::Session {
        at: all.join(", "),
        reason: if taken {
            "another program listens there already; end it, or give another port".to_owned()
        } else {
            reason.to_owned()
        },
    }
}

fn encoding(kind: SampleKind) -> Encoding {
    Encoding::ZENOH_BYTES.with_schema(kind.type_name())
}

/// Key on which the samples for receivers with this policy are published.
fn data_key(stream: &str, keep: Keep) -> String {
    match keep {
        Keep::All => stream.to_owned(),
        Keep::Newest => format!("{stream}/@newest"),
    }
}

fn last_chunk<'a>(key: &'a zenoh::key_expr::KeyExpr<'_>) -> &'a str {
    key.as_str().rsplit('/').next().unwrap_or_default()
}

/// Session epoch in the key of a sender's token.
fn instance_of(key: &zenoh::key_expr::KeyExpr<'_>) -> Option<u64> {
    u64::from_str_radix(last_chunk(key), 16).ok()
}

fn policy(keep: Keep) -> &'static str {
    match keep {
        Keep::All => "@all",
        Keep::Newest => "@newest",
    }
}

#[cfg(test)]
mod tests {
    use super::{ZenohEndpoints, session_error, without_places};

    #[test]
    fn an_error_of_zenoh_says_nothing_of_its_source_code() {
        let text = "Unable to open at /home/x/.cargo/registry/src/a/b.rs:114. - Caused by refused at c.rs:2.";
        assert_eq!(without_places(text), "Unable to open - Caused by refused");
        assert_eq!(without_places("no port at 7447"), "no port at 7447");
    }

    #[test]
    fn a_port_that_is_taken_is_said_once_with_the_remedy() {
        let endpoints = ZenohEndpoints {
            listen: vec!["tcp/127.0.0.1:7448".to_owned()],
            connect: Vec::new(),
        };
        let reason =
            "Can not create a listener on 127.0.0.1:7448: [Address already in use (os error 98)";
        let said = session_error(&endpoints, reason).to_string();
        assert_eq!(
            said,
            "cannot open a Zenoh session at tcp/127.0.0.1:7448: another program listens there already; end it, or \
             give another port"
        );
    }
}
