//! Entry of a stage in the pipeline file.

use std::any::Any;
use std::ops::Deref;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AnyConfig, StageConfig};
use crate::pipeline::restart::RestartEntry;
use crate::yaml::Place;

/// A stage in the pipeline file.
#[derive(Debug, Clone)]
pub struct StageEntry {
    /// The keys that all stages have.
    pub common: Common,
    /// The keys that define the kind of a stage, with their values. A valid entry has exactly one.
    pub parts: Vec<Part>,
}

/// A key that defines the kind of a stage, with its value.
#[derive(Debug, Clone)]
pub struct Part {
    /// The key as it is in the file: the one of the kind, or its former one.
    pub key: &'static str,
    /// The value.
    pub config: Box<dyn AnyConfig>,
}

impl StageEntry {
    /// The part of the kind `C`, if there is one.
    pub fn config<C: StageConfig>(&self) -> Option<&C> {
        let mut parts = self.parts.iter();
        parts.find_map(|part| (&*part.config as &dyn Any).downcast_ref())
    }
}

impl Deref for StageEntry {
    type Target = Common;

    fn deref(&self) -> &Common {
        &self.common
    }
}

/// The keys that all stages have.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "StageEntry")]
pub struct Common {
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
pub fn stage_place(index: usize) -> Place {
    Place::root().key("stages").index(index)
}
