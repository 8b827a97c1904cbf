//! The pipeline file as it is written.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
}

/// Unit of a measured effort.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema, clap::ValueEnum,
)]
pub enum EffortUnit {
    /// Torque \[N m\] (force \[N\] for a prismatic joint).
    #[default]
    #[value(name = "Nm")]
    Nm,
    /// Motor current \[A\].
    #[value(name = "A")]
    A,
}

impl EffortUnit {
    /// As it is written in files.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Nm => "Nm",
            Self::A => "A",
        }
    }
}

/// A rigid body attached to a link.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolEntry {
    /// The link it is attached to.
    pub link: String,
    /// Its mass \[kg\]. 0 where only a topic tells of a tool.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass_kg: f64,
    /// Its centre of mass in the link's frame \[m\].
    #[serde(default)]
    pub com_m: [f64; 3],
    /// Its inertia about its centre of mass, axes of the link: xx, xy, xz, yy, yz, zz \[kg m²\].
    #[serde(default)]
    pub inertia_kgm2: [f64; 6],
    /// The point of it that touches things, in the link's frame \[m\]. By default the link's origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_point_m: Option<[f64; 3]>,
}

/// How a host is reached by the others.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HostEntry {
    /// Zenoh endpoints that this host listens on, e.g. `tcp/10.0.0.1:7447`: one, or a list.
    pub listen: Endpoints,
    /// Zenoh endpoints that this host connects to: one, or a list.
    pub connect: Endpoints,
}

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
/// `detect`, `explain`, `record` and `outside`, which says what it is.
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
    /// The stage it listens to.
    #[serde(default)]
    pub input: Option<String>,
    /// The stages it listens to, for a stage that takes many streams.
    #[serde(default)]
    pub inputs: Option<Vec<String>>,
    /// What becomes of samples that it has no time for.
    #[serde(default)]
    pub keep: Option<KeepEntry>,
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

/// A stage that is not ours.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutsideEntry {
    /// The program and its arguments. A program with a `/` in it is relative to the file, another one
    /// is looked for as a shell would. It is run in the folder of the file and told its place in the
    /// pipeline as one line of JSON on standard input.
    #[schemars(length(min = 1))]
    pub command: Vec<String>,
    /// What it puts out; left out where it puts out nothing.
    #[serde(default)]
    pub output: Option<OutputEntry>,
    /// Any text that the program is to be told, with its place.
    #[serde(default)]
    pub settings: Option<serde_json::Value>,
}

/// A kind of sample that a stage puts out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutputEntry {
    /// What a robot says of itself.
    JointState,
    /// What a twin makes of it.
    TwinState,
    /// A detector's verdict.
    Detection,
}
