//! A seat: all that a stage's process must know to take its place in a pipeline.
//!
//! The program works it out from the pipeline file and hands it to the process as JSON; see
//! [`shell::child`](crate::shell::child) for how.

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::effort_unit::EffortUnit;
use crate::link::{
    Audience, Domain, Keep, MAX_RECEIVERS, PATIENCE, Position, SpillSettings, Wake, ZenohEndpoints,
};
use crate::sample::SampleKind;

mod links;

pub use links::{AnyReceiver, Links, Transports};

/// The place of one stage in a pipeline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Seat {
    /// The stage's name, unique in the pipeline.
    pub stage: String,
    /// How often this stage has been started again.
    #[serde(default)]
    pub restarts: u64,
    /// The shared memory of this run on this host.
    pub domain: Domain,
    /// At most so many receivers hear one stream with one policy here, those included that died and have not been
    /// cleaned up after; equal for all seats of a domain.
    #[serde(default = "Seat::default_receivers")]
    pub receivers: usize,
    /// Where this process meets the other hosts, if any of its links goes there.
    #[serde(default)]
    pub zenoh: Option<ZenohEndpoints>,
    /// The cells whose streams it hears; one, unless the stage is a sink.
    #[serde(default)]
    pub cells: Vec<Cell>,
    /// The streams it hears: none for a source, one for a stage, any number for a sink.
    #[serde(default)]
    pub inputs: Vec<Input>,
    /// The stream it makes; none for a sink.
    #[serde(default)]
    pub output: Option<Output>,
    /// Where its health reports go.
    #[serde(default)]
    pub health: Option<Output>,
    /// How long it waits for its receivers before it begins without them \[ms\].
    #[serde(default = "Seat::default_start_within_ms")]
    pub start_within_ms: u64,
    /// How long a sender waits for a keep-all receiver that takes nothing \[ms\].
    #[serde(default = "Seat::default_patience_ms")]
    pub patience_ms: u64,
    /// A file in which it keeps its counts ([`Ledger`](crate::shell::Ledger)), if its supervisor wants to know them
    /// after its death.
    #[serde(default)]
    pub ledger: Option<PathBuf>,
    /// What else the stage needs, in the stage's own words.
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

    /// A stage without links yet, with the usual waits.
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

    /// How long it waits for its receivers before it begins without them.
    pub fn start_within(&self) -> Duration {
        Duration::from_millis(self.start_within_ms)
    }

    /// How long a sender waits for a keep-all receiver that takes nothing.
    pub fn patience(&self) -> Duration {
        Duration::from_millis(self.patience_ms)
    }
}

/// What every stage may know of a robot cell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Its name, the first part of its streams' names.
    pub name: String,
    /// The joints, in the order of every [`JointArray`](crate::JointArray).
    pub joints: Vec<String>,
    /// What an effort means here.
    pub effort_unit: EffortUnit,
}

/// How a stream gets from one stage to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransportKind {
    /// Both stages are in one [`Tree`](crate::shell::Tree): each sample is handed over where it lies.
    InProcess,
    /// Shared memory, within a host.
    Iceoryx2,
    /// Across hosts.
    Zenoh,
}

/// A stream that a stage hears.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// The stage that makes it.
    pub from: String,
    /// Its name: `<cell>/<stage>`, or `<cell>/<stage>/health`.
    pub stream: String,
    /// What it carries.
    pub kind: SampleKind,
    /// How it comes here.
    pub transport: TransportKind,
    /// What becomes of samples this stage has no room for.
    #[serde(default)]
    pub keep: Keep,
    /// How many samples it may leave unread.
    pub depth: usize,
    /// How it learns that a sample is there, if that comes through shared memory.
    #[serde(default)]
    pub wake: Wake,
    /// How far an earlier life of this stage has come, so that what was lost with it is counted.
    #[serde(default)]
    pub resume: Option<Position>,
}

impl Input {
    /// How often it is looked whether samples are there, where nothing wakes the one who hears it.
    pub(crate) fn looks(&self) -> Option<Duration> {
        let is_woken = match self.wake {
            Wake::EveryMs(_) => false,
            Wake::EveryMsOrUrgent(_) => self.kind.may_alarm(),
            Wake::Event | Wake::Spin => true,
        };
        let looks = self.transport == TransportKind::Iceoryx2 && !is_woken;
        self.wake.pause().filter(|_| looks)
    }
}

/// A stream that a stage makes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Its name: `<cell>/<stage>`, or `<cell>/<stage>/health`.
    pub stream: String,
    /// What it carries.
    pub kind: SampleKind,
    /// How many samples earlier lives of the stage have put out.
    #[serde(default)]
    pub former: u64,
    /// The ways it leaves its tree; none if nobody listens elsewhere.
    #[serde(default)]
    pub links: Vec<OutputLink>,
}

/// One way that a stream leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputLink {
    /// How.
    pub transport: TransportKind,
    /// Who listens there.
    pub audience: Audience,
    /// The queue before it, if the stage is not to wait for those who listen.
    #[serde(default)]
    pub spill: Option<SpillSettings>,
}
