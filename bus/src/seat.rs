//! Seats: the stage assignments of processes. A seat has all that the process of a stage needs to take its place in a
//! pipeline.
//!
//! The program derives it from the pipeline file and passes it to the process as JSON; see
//! [`shell::child`](crate::shell::child) for the protocol.

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::effort_unit::EffortUnit;
use crate::link::{
    Audience, Domain, Keep, MAX_RECEIVERS, PATIENCE, Position, SpillSettings, Wake, ZenohEndpoints,
};
use crate::sample::SampleKind;

mod links;

pub use links::{AnyReceiver, AnySender, Links, Transports};

/// The assignment of one stage of a pipeline to a process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seat {
    /// Name of the stage, unique in the pipeline.
    pub stage: String,
    /// Number of restarts of the stage.
    #[serde(default)]
    pub restarts: u64,
    /// Shared memory domain of this run on this host.
    pub domain: Domain,
    /// Largest number of receivers of one stream with one policy on this host, including crashed receivers that are
    /// not cleaned up yet; equal for all seats of a domain.
    #[serde(default = "Seat::default_receivers")]
    pub receivers: usize,
    /// Endpoints to reach the other hosts, if the process has links to them.
    #[serde(default)]
    pub zenoh: Option<ZenohEndpoints>,
    /// Cells whose streams the stage receives; one, unless the stage is a sink.
    #[serde(default)]
    pub cells: Vec<Cell>,
    /// Streams that the stage receives: none for a source, one for a stage, any number for a sink.
    #[serde(default)]
    pub inputs: Vec<Input>,
    /// Stream that the stage emits; none for a sink.
    #[serde(default)]
    pub output: Option<Output>,
    /// Stream of the stage's health reports.
    #[serde(default)]
    pub health: Option<Output>,
    /// Longest wait for the receivers, after which the stage starts without them \[ms\].
    #[serde(default = "Seat::default_start_within_ms")]
    pub start_within_ms: u64,
    /// Stall timeout: longest wait of a sender for a keep-all receiver that takes nothing \[ms\].
    #[serde(default = "Seat::default_patience_ms")]
    pub patience_ms: u64,
    /// File for the stage's counters ([`Ledger`](crate::shell::Ledger)), which the supervisor reads after a crash.
    #[serde(default)]
    pub ledger: Option<PathBuf>,
    /// Settings of the stage, in its own format.
    #[serde(default)]
    pub config: serde_json::Value,
}

impl Seat {
    fn default_start_within_ms() -> u64 {
        10_000
    }

    fn default_receivers() -> usize {
        MAX_RECEIVERS
    }

    fn default_patience_ms() -> u64 {
        PATIENCE.as_millis() as u64
    }

    /// A stage without links, with the default timeouts.
    pub fn new(stage: &str, domain: Domain) -> Self {
        Self {
            stage: stage.to_owned(),
            restarts: 0,
            domain,
            receivers: Self::default_receivers(),
            zenoh: None,
            cells: Vec::new(),
            inputs: Vec::new(),
            output: None,
            health: None,
            start_within_ms: Self::default_start_within_ms(),
            patience_ms: Self::default_patience_ms(),
            ledger: None,
            config: serde_json::Value::Null,
        }
    }

    /// Longest wait for the receivers, after which the stage starts without them.
    pub fn start_within(&self) -> Duration {
        Duration::from_millis(self.start_within_ms)
    }

    /// Whether the stage waits while a receiver that must lose nothing is slow. Health reports are so rare that their
    /// link always has room.
    pub(crate) fn may_wait(&self) -> bool {
        let mut links = self.output.iter().flat_map(|output| &output.links);
        links.any(|link| link.audience.keep_all > 0 && link.spill.is_none_or(|spill| spill.waits))
    }

    /// Stall timeout.
    pub fn patience(&self) -> Duration {
        Duration::from_millis(self.patience_ms)
    }
}

/// Properties of a robot cell that every stage may know.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Name of the cell, the first part of its streams' names.
    pub name: String,
    /// Names of the joints, in the order of every [`JointArray`](crate::JointArray).
    pub joints: Vec<String>,
    /// Unit of the efforts.
    pub effort_unit: EffortUnit,
}

/// Transport of a stream from one stage to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransportKind {
    /// Calls within one stage group ([`Group`](crate::shell::Group)), which pass each sample in place.
    InProcess,
    /// Shared memory, within a host.
    Iceoryx2,
    /// Network, across hosts.
    Zenoh,
}

/// A stream that a stage receives.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Name of the stage that emits the stream.
    pub from: String,
    /// Name of the stream: `<cell>/<stage>`, or `<cell>/<stage>/health`.
    pub stream: String,
    /// Sample type.
    pub kind: SampleKind,
    /// Transport.
    pub transport: TransportKind,
    /// Overflow policy.
    #[serde(default)]
    pub keep: Keep,
    /// Largest number of unread samples.
    pub depth: usize,
    /// Wake-up mode of the receiver, for shared memory.
    #[serde(default)]
    pub wake: Wake,
    /// Position of an earlier incarnation of this stage, so that samples lost in its crash are counted.
    #[serde(default)]
    pub resume: Option<Position>,
}

/// A stream that a stage emits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Name of the stream: `<cell>/<stage>`, or `<cell>/<stage>/health`.
    pub stream: String,
    /// Sample type.
    pub kind: SampleKind,
    /// Number of samples that earlier incarnations of the stage have emitted.
    #[serde(default)]
    pub former: u64,
    /// Links to receivers outside the stage group; none if there are no such receivers.
    #[serde(default)]
    pub links: Vec<OutputLink>,
}

/// One link of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputLink {
    /// Transport.
    pub transport: TransportKind,
    /// Expected receivers.
    pub audience: Audience,
    /// Limits of the queue in front of the link, if the stage must not wait for its receivers.
    #[serde(default)]
    pub spill: Option<SpillSettings>,
}
