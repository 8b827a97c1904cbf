//! What a stage is told of its own.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::ZenohEndpoints;
use tauscope_twin::TwinFile;

/// What a stage is told of its own.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Settings {
    /// A source.
    Ingest(Box<tauscope_ingest::Config>),
    /// A twin.
    Twin {
        /// From the pipeline file.
        config: tauscope_twin::Config,
        /// The file that `model` names.
        model: Option<TwinFile>,
    },
    /// A detector.
    Detect {
        /// From the pipeline file.
        config: Box<tauscope_detect::Config>,
        /// The model of the twin it listens to, which holds what its threshold rests on.
        model: Option<TwinFile>,
    },
    /// A watch over a twin.
    Explain {
        /// From the pipeline file.
        config: tauscope_watch::Config,
        /// The model of the twin it listens to.
        model: Option<TwinFile>,
        /// That twin's low-pass on efforts \[Hz\].
        effort_cutoff_hz: f64,
    },
    /// A recorder.
    Record(tauscope_record::Config),
    /// A publisher.
    Publish {
        /// From the pipeline file.
        config: tauscope_publish::Config,
        /// Where the cell's source takes commands, if it does.
        commands: Option<ZenohEndpoints>,
        /// The twin and the archive of its cell, of which the fleet is told.
        beside: BesidePublisher,
    },
    /// A program that is not ours.
    Outside(OutsideEntry),
}

/// What stands beside a publisher in its cell.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct BesidePublisher {
    /// SHA-256 of the file of the twin.
    pub twin_sha256: Option<String>,
    /// By joint name, the residual's standard deviation when that twin was calibrated \[effort unit\].
    pub calibrated: BTreeMap<String, f64>,
    /// Where the recorder writes.
    pub archive: Option<String>,
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
