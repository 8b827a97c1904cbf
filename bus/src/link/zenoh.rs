//! Links between hosts: Zenoh.
//!
//! # What travels
//!
//! | key | what |
//! | --- | --- |
//! | `<stream>`, that is `<cell>/<stage>` or `<cell>/<stage>/health` | samples for those who keep all |
//! | `<stream>/@newest` | samples for those who keep the newest |
//! | `<stream>/@all/<id>.<depth>`, `<stream>/@newest/<id>.<depth>` | a liveliness token of each receiver, with how many samples it has room for |
//! | `<stream>/@from/<instance>` | a liveliness token of the sender |
//! | `<stream>/@taken/<id>.<depth>` | how far a receiver has come |
//!
//! (Chunks that begin with `@` are matched by no wildcard, so `<cell>/**` gives samples alone.)
//!
//! Samples are put with
//!
//! - encoding `zenoh/bytes;tauscope/JointState/2`, the type name of the sample after the semicolon;
//! - payload: one or more samples, one after the other, as they lie in memory, little-endian, without a frame: see
//!   [`wire`](super::wire) for the offsets;
//! - attachment: four little-endian `u64`: the sender's instance, another one after each restart, while
//!   the sequence number in the sample's header counts from 0 again; the number of the oldest sample that can still be
//!   had; how many numbers right before the first sample are lost for good; how many samples all earlier lives of the
//!   sender had;
//! - congestion control `drop`: nothing ever waits for a link that is full, so that a frozen or distant receiver holds
//!   up neither other streams nor the stage.
//!
//! A receiver says how far it has come with four little-endian `u64`: the instance that it hears, the number of the
//! sample that it waits for, how many before that were lost for good, and 0, or 1 where samples are missing, or 2 where
//! it leaves.
//!
//! # Nothing is lost
//!
//! The sender keeps every sample until all receivers that keep all have taken it, within a bound of memory (`log.rs`).
//! What did not arrive goes out again, also after the network was cut, and to a receiver that was started again. If the
//! memory is full, a source that reads a file waits; else the oldest sample gives way. Its number is then lost for
//! good: both ends count it.
//!
//! # Who is heard
//!
//! Samples and ends of a stream count only from its sender: the one that shows a token, and no other while that one
//! lives. The rest is refused, counted, and said once. This keeps out what strays; a network on which somebody may lie
//! needs mutual TLS and access rules at its router (`deploy/zenoh`).
//!
//! Nothing is discovered: sessions meet at the endpoints that they are given, and nowhere else.

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
/// What a sender may take that nobody has told it.
/// Resolution: memory.
const SPILL: SpillSettings = SpillSettings {
    bytes: 1 << 20,
    linger_ms: 0,
    waits: true,
};
/// Batches of 64 kB that may wait in a session for one peer.
/// Resolution: memory; the most that Zenoh takes.
const QUEUE: usize = 16;

/// Sessions that one that listens takes. Zenoh's own limit of 1000 turns the next away without a word.
/// Resolution: as many cells as a fleet host follows.
const MOST_SESSIONS: usize = 10_000;

/// Where Zenoh sessions of this host meet others, e.g. `tcp/10.0.0.1:7447`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ZenohEndpoints {
    /// Where it listens.
    #[serde(default)]
    pub listen: Vec<String>,
    /// Where it connects to; it tries until it succeeds, and again when a connection breaks.
    #[serde(default)]
    pub connect: Vec<String>,
}

impl ZenohEndpoints {
    /// A session of its own there, for other traffic than streams; what it connects to need not be there yet. Its mode is
    /// `router`: a router passes on what peers say, as sessions of ROS 2 are, to routers and clients, but not to other
    /// peers, and a client cannot begin before its router is there.
    ///
    /// # Errors
    /// As [`Zenoh::open`].
    pub fn session(&self) -> Result<zenoh::Session, LinkError> {
        open_session("router", self, PATIENCE)
    }

    /// The same for what routers and clients alone are to hear, such as a fleet host. Its mode is `peer`: routers tell one
    /// another who is linked to whom, each time that one comes or goes, and a thousand of them would do little else.
    ///
    /// # Errors
    /// As [`Zenoh::open`].
    pub fn session_for_routers(&self) -> Result<zenoh::Session, LinkError> {
        open_session("peer", self, PATIENCE)
    }

    /// Where another session on this host meets one that has these: where it listens, and what it connects to. For a
    /// listener on all interfaces that is the loopback.
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
    /// How many samples the earlier lives of a sender had.
    former: u64,
    /// Ends of this session so far, so that each has a number.
    ends: Arc<AtomicU64>,
}

impl Zenoh {
    /// Opens a session; what it connects to need not be there yet.
    ///
    /// # Errors
    /// [`LinkError::Open`] if an endpoint is none, or cannot be listened at.
    pub fn open(endpoints: &ZenohEndpoints, patience: Duration) -> Result<Self, LinkError> {
        Ok(Self {
            session: open_session("peer", endpoints, patience)?,
            patience,
            spill: SPILL,
            former: 0,
            ends: Arc::default(),
        })
    }

    /// The same with other bounds for what waits to be taken.
    #[must_use]
    pub fn with_spill(mut self, spill: SpillSettings) -> Self {
        self.spill = spill;
        self
    }

    /// The same for a sender whose earlier lives had so many samples: its receivers then know what died with those.
    #[must_use]
    pub fn with_former(mut self, samples: u64) -> Self {
        self.former = samples;
        self
    }

    /// A number for an end, unlike any other session's: their random ids differ.
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

/// Where the sessions of a host's processes meet those of other hosts. Only one process can listen
/// at an endpoint: the supervisor keeps this, and each stage's process connects to it.
#[derive(Debug)]
pub struct ZenohRouter {
    _session: zenoh::Session,
}

impl ZenohRouter {
    /// Listens and connects at `endpoints`, and passes on what comes until it is dropped.
    ///
    /// # Errors
    /// As [`Zenoh::open`].
    pub fn open(endpoints: &ZenohEndpoints) -> Result<Self, LinkError> {
        Ok(Self {
            _session: open_session("router", endpoints, PATIENCE)?,
        })
    }
}

/// What Zenoh says of an error, without the places in its source code.
pub fn zenoh_reason(error: &zenoh::Error) -> String {
    without_places(&error.to_string())
}

/// `a b` of `a at /src/c.rs:12. b`.
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

/// The settings of a session, and more, which go before those.
fn config(
    mode: &str,
    endpoints: &ZenohEndpoints,
    patience: Duration,
    more: &[(&str, String)],
) -> zenoh::Result<zenoh::Config> {
    // A receiver gives out before the link is closed over it.
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

/// Where the samples are put for receivers of that kind.
fn data_key(stream: &str, keep: Keep) -> String {
    match keep {
        Keep::All => stream.to_owned(),
        Keep::Newest => format!("{stream}/@newest"),
    }
}

fn last_chunk<'a>(key: &'a zenoh::key_expr::KeyExpr<'_>) -> &'a str {
    key.as_str().rsplit('/').next().unwrap_or_default()
}

/// The sender that a token is of.
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
