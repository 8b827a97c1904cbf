//! Settings of a stage.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::ZenohEndpoints;
use tauscope_twin::TwinFile;

/// Settings of a stage.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Settings {
    /// A source.
    Ingest(Box<tauscope_ingest::Config>),
    /// A twin.
    Twin {
        /// Settings from the pipeline file.
        config: tauscope_twin::Config,
        /// Content of the file that `model` names.
        model: Option<TwinFile>,
    },
    /// A detector.
    Detect {
        /// Settings from the pipeline file.
        config: Box<tauscope_detect::Config>,
        /// The model of the twin it listens to, with the score statistics for its threshold.
        model: Option<TwinFile>,
    },
    /// A watch over a twin.
    Watch {
        /// Settings from the pipeline file.
        config: tauscope_watch::Config,
        /// The model of the twin it listens to.
        model: Option<TwinFile>,
        /// Cutoff of that twin's low-pass on efforts \[Hz\].
        effort_cutoff_hz: f64,
    },
    /// A recorder.
    Record(tauscope_record::Config),
    /// A publisher.
    Publish {
        /// Settings from the pipeline file.
        config: tauscope_publish::Config,
        /// Command endpoints of the cell's source, if any.
        commands: Option<ZenohEndpoints>,
        /// Twin and archive of its cell, reported to the fleet.
        beside: BesidePublisher,
    },
    /// An external program.
    Outside(OutsideEntry),
}

/// Twin and archive in the cell of a publisher.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct BesidePublisher {
    /// SHA-256 of the file of the twin.
    pub twin_sha256: Option<String>,
    /// Standard deviation of the residual at the calibration of that twin, by joint name \[effort unit\].
    pub calibrated: BTreeMap<String, f64>,
    /// Path pattern of the recorder's files.
    pub archive: Option<String>,
}

/// A stage that is an external program.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutsideEntry {
    /// The program and its arguments. A program with a `/` in it is relative to the file; otherwise it is searched in
    /// `PATH`. It runs in the folder of the file and receives its place in the pipeline as one line of JSON on
    /// standard input.
    #[schemars(length(min = 1))]
    pub command: Vec<String>,
    /// Output sample type; left out for a program without output.
    #[serde(default)]
    pub output: Option<OutputEntry>,
    /// Any settings for the program, sent together with its place in the pipeline.
    #[serde(default)]
    pub settings: Option<serde_json::Value>,
}

/// Output sample type of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutputEntry {
    /// Measured joint state of a robot.
    JointState,
    /// Joint state with the twin's expected effort.
    TwinState,
    /// Result of a detector.
    Detection,
}
