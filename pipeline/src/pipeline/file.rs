//! Format of the pipeline file.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::stage::entry::StageEntry;
use crate::cell::{EffortUnit, ToolEntry};

/// A pipeline: its stages, their inputs, and the host of each one.
///
/// Paths are relative to the file.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
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
