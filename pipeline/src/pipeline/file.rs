//! The pipeline file as it is written.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::restart::RestartEntry;
use crate::cell::{EffortUnit, ToolEntry};
use crate::settings::OutsideEntry;
use crate::yaml::Place;

/// A pipeline: which stages there are, what they listen to, and on which host each one runs.
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
    /// The hosts by name; left out where everything runs on one.
    #[serde(default)]
    pub hosts: BTreeMap<String, HostEntry>,
    /// The process in which the sources, twins, detectors and watches of all cells run, where their cell or they
    /// themselves name no other. Left out, each cell has a process of its own.
    #[serde(default)]
    pub process: Option<String>,
    /// The stages, in any order.
    #[schemars(length(min = 1))]
    pub stages: Vec<StageEntry>,
}

/// A robot and what is known of it.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CellEntry {
    /// The robot's URDF. May be left out where the expected effort comes from a topic; then `joints`
    /// names the joints.
    #[serde(default)]
    pub robot: Option<PathBuf>,
    /// The joints, in the order wanted. Only without a `robot`, which has its own.
    #[serde(default)]
    pub joints: Option<Vec<String>>,
    /// Unit of the measured effort.
    #[serde(default)]
    pub effort_unit: EffortUnit,
    /// Torque constant by joint \[N m/A\], for efforts in A, if they are known: effort in A times the
    /// constant is the torque at the joint.
    #[serde(default)]
    pub torque_constants_nm_per_a: Option<BTreeMap<String, f64>>,
    /// The tool, where the URDF has it not.
    #[serde(default)]
    pub tool: Option<ToolEntry>,
    /// The impedance that a Cartesian controller holds the tool with, where there is one.
    #[serde(default)]
    pub impedance: Option<tauscope_detect::Impedance>,
    /// The process in which the cell's source, twins, detectors and watches run, where they themselves name no other.
    #[serde(default)]
    pub process: Option<String>,
}

/// How a host is reached by the others.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HostEntry {
    /// Zenoh endpoints that this host listens on, e.g. `tcp/10.0.0.1:7447`: one, or a list.
    pub listen: Endpoints,
    /// Zenoh endpoints that this host connects to: one, or a list.
    pub connect: Endpoints,
    /// Samples for other hosts wait at most so long for more, to go in one message \[ms\]. Alarms and commands never
    /// wait. A shorter time costs more of a core, on all hosts.
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

/// Resolution: how late a sample is on another host, against the cost of a message.
const GATHER_MS: u64 = 10;

/// One endpoint or several.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "OneOrMany", into = "Vec<String>")]
pub struct Endpoints(pub Vec<String>);

/// What [`Endpoints`] may be written as.
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

/// A stage: its name, where it runs, what it listens to, and exactly one of `ingest`, `twin`,
/// `detect`, `explain`, `record`, `publish` and `outside`, which says what it is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageEntry {
    /// The stage's name: letters, digits, `_` and `-`. Others listen to it by this name.
    pub name: String,
    /// The cell, for a stage that listens to nobody; the others are in the cell of what they listen
    /// to. May be left out where there is one cell.
    #[serde(default)]
    pub cell: Option<String>,
    /// The host it runs on, where the file names several.
    #[serde(default)]
    pub host: Option<String>,
    /// The process it runs in. Stages on one host that name the same one share it. Left out, it is that of the cell,
    /// and for `record` and `publish` one of its own.
    #[serde(default)]
    pub process: Option<String>,
    /// The stage it listens to.
    #[serde(default)]
    pub input: Option<String>,
    /// The stages it listens to, for a stage that takes many streams.
    #[serde(default)]
    pub inputs: Option<Vec<String>>,
    /// What becomes of samples that it has no time for.
    #[serde(default)]
    pub keep: Option<KeepEntry>,
    /// How it learns that a sample is there, if another process of its host sends it. Left out, the sender wakes it; a
    /// recorder looks a hundred times a second, so that it costs those before it nothing.
    #[serde(default)]
    pub wake: Option<WakeEntry>,
    /// When it is started again after it died. Left out: `on_failure`.
    #[serde(default)]
    pub restart: Option<RestartEntry>,
    /// A source: where joint states come from.
    #[serde(default)]
    pub ingest: Option<tauscope_ingest::Config>,
    /// The twin: what the effort should have been.
    #[serde(default)]
    pub twin: Option<tauscope_twin::Config>,
    /// A detector of contacts.
    #[serde(default)]
    pub detect: Option<tauscope_detect::Config>,
    /// A watch over a twin: says when its residual changes character, and which physics changed.
    #[serde(default)]
    pub explain: Option<tauscope_watch::Config>,
    /// A recorder: archive and picture.
    #[serde(default)]
    pub record: Option<tauscope_record::Config>,
    /// A publisher: what the robot's cell is told, over Zenoh and Modbus. Not a safety function.
    #[serde(default)]
    pub publish: Option<tauscope_publish::Config>,
    /// A stage that is not ours: a program that takes its place in the pipeline.
    #[serde(default)]
    pub outside: Option<OutsideEntry>,
}

/// What becomes of samples that a stage has no time for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum KeepEntry {
    /// Those before it wait: nothing is lost.
    All,
    /// The oldest give way and are counted, so that it works on what is new.
    Newest,
}

/// How a stage learns that a sample is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WakeEntry {
    /// The sender wakes it.
    Event,
    /// It looks all the time, which takes a core: the least latency.
    Spin,
}

/// Place of stage `index` in the file.
pub(super) fn stage_place(index: usize) -> Place {
    Place::root().key("stages").index(index)
}
