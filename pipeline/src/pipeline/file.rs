//! Format of the pipeline file.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::restart::RestartEntry;
use crate::cell::{EffortUnit, ToolEntry};
use crate::settings::OutsideEntry;
use crate::yaml::Place;

/// A pipeline: its stages, their inputs, and the host of each one.
///
/// Paths are relative to the file.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "tauscope pipeline")]
pub struct PipelineFile {
    /// Version of this format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// The robots' cells by name. The name is the prefix of the cell's streams, of its Zenoh keys and
    /// of its entities in Rerun.
    pub cells: BTreeMap<String, CellEntry>,
    /// The hosts by name; left out if everything runs on one host.
    #[serde(default)]
    pub hosts: BTreeMap<String, HostEntry>,
    /// The process of the sources, twins, detectors and watches of all cells, unless their cell or they themselves
    /// name another. If left out, each cell has its own process.
    #[serde(default)]
    pub process: Option<String>,
    /// The stages, in any order.
    #[schemars(length(min = 1))]
    pub stages: Vec<StageEntry>,
}

/// A robot and its properties.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CellEntry {
    /// The robot's URDF. May be left out if the expected effort comes from a topic; then `joints` names the joints.
    #[serde(default)]
    pub robot: Option<PathBuf>,
    /// The joints in order. Only without `robot`, whose URDF defines the joints.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Unit of the measured effort.
    #[serde(default)]
    pub effort_unit: EffortUnit,
    /// Torque constant by joint \[N m/A\], for efforts in A, if known: effort in A times the constant is the torque
    /// at the joint.
    #[serde(default)]
    pub torque_constants_nm_per_a: Option<BTreeMap<String, f64>>,
    /// The tool, if the URDF does not contain it.
    #[serde(default)]
    pub tool: Option<ToolEntry>,
    /// The impedance of a Cartesian controller at the tool, if there is one.
    #[serde(default)]
    pub impedance: Option<tauscope_detect::Impedance>,
    /// The process of the cell's source, twins, detectors and watches, unless they themselves name another.
    #[serde(default)]
    pub process: Option<String>,
}

/// Network endpoints of a host.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HostEntry {
    /// Zenoh endpoints that this host listens on, e.g. `tcp/10.0.0.1:7447`: one, or a list.
    pub listen: Endpoints,
    /// Zenoh endpoints that this host connects to: one, or a list.
    pub connect: Endpoints,
    /// Longest time that samples for other hosts wait to be sent together in one message \[ms\]. Alarms and commands
    /// never wait. A shorter time costs more CPU time on all hosts.
    #[schemars(range(min = 0, max = 100))]
    pub gather_ms: u64,
}

impl Default for HostEntry {
    fn default() -> Self {
        Self {
            listen: Endpoints::default(),
            connect: Endpoints::default(),
            gather_ms: GATHER_MS,
        }
    }
}

/// Default of [`HostEntry::gather_ms`] \[ms\].
/// Resolution: latency of a sample on another host, against the cost of a message.
const GATHER_MS: u64 = 10;

/// One endpoint or several.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "OneOrMany", into = "Vec<String>")]
pub struct Endpoints(pub Vec<String>);

/// Notations of [`Endpoints`] in the file.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged)]
enum OneOrMany {
    One(String),
    Many(Vec<String>),
}

impl From<OneOrMany> for Endpoints {
    fn from(endpoints: OneOrMany) -> Self {
        match endpoints {
            OneOrMany::One(endpoint) => Self(vec![endpoint]),
            OneOrMany::Many(endpoints) => Self(endpoints),
        }
    }
}

impl From<Endpoints> for Vec<String> {
    fn from(endpoints: Endpoints) -> Self {
        endpoints.0
    }
}

/// A stage: its name, its host and process, its inputs, and exactly one of `ingest`, `twin`, `detect`, `watch`,
/// `record`, `publish` and `outside`, which defines its kind.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageEntry {
    /// The stage's name: letters, digits, `_` and `-`. Others listen to it by this name.
    pub name: String,
    /// The cell of a stage without inputs; other stages belong to the cell of their inputs. May be left out if there
    /// is only one cell.
    #[serde(default)]
    pub cell: Option<String>,
    /// The host it runs on, if the file names several.
    #[serde(default)]
    pub host: Option<String>,
    /// The process it runs in. Stages on one host with the same process name share it. By default it is the process
    /// of the cell; `record` and `publish` have their own.
    #[serde(default)]
    pub process: Option<String>,
    /// The stage it listens to.
    #[serde(default)]
    pub input: Option<String>,
    /// The stages it listens to, for a stage with several inputs.
    #[serde(default)]
    pub inputs: Option<Vec<String>>,
    /// Overflow policy for samples that it does not process in time.
    #[serde(default)]
    pub keep: Option<KeepEntry>,
    /// Wake-up on a new sample from another process of its host. By default the sender wakes it; a recorder polls 100
    /// times a second, so that it does not slow down the stages before it.
    #[serde(default)]
    pub wake: Option<WakeEntry>,
    /// Restart policy after a crash; by default `on_failure`.
    #[serde(default)]
    pub restart: Option<RestartEntry>,
    /// A source of joint states.
    #[serde(default)]
    pub ingest: Option<tauscope_ingest::Config>,
    /// The twin, which computes the expected effort.
    #[serde(default)]
    pub twin: Option<tauscope_twin::Config>,
    /// A detector of contacts.
    #[serde(default)]
    pub detect: Option<tauscope_detect::Config>,
    /// A watch over a twin: reports when its residual changes, and which physical effect changed.
    #[serde(default)]
    pub watch: Option<tauscope_watch::Config>,
    /// Former name of `watch`. `check` and `run` print the edit.
    #[serde(default)]
    pub explain: Option<tauscope_watch::Config>,
    /// A recorder of archives and pictures.
    #[serde(default)]
    pub record: Option<tauscope_record::Config>,
    /// A publisher of contacts and status to the robot's cell, over Zenoh and Modbus. Not a safety function.
    #[serde(default)]
    pub publish: Option<tauscope_publish::Config>,
    /// An external program as a stage of the pipeline.
    #[serde(default)]
    pub outside: Option<OutsideEntry>,
}

/// Overflow policy for samples that a stage does not process in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum KeepEntry {
    /// The stages before it wait, so no sample is lost.
    All,
    /// The oldest samples are dropped and counted, so that it processes recent ones.
    Newest,
}

/// Wake-up of a stage on a new sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WakeEntry {
    /// The sender wakes it.
    Event,
    /// It polls continuously: the lowest latency, at the cost of one core.
    Spin,
}

/// Place of the stage `index` in the file.
pub(super) fn stage_place(index: usize) -> Place {
    Place::root().key("stages").index(index)
}
