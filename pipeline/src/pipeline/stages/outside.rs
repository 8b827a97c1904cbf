//! An external program as a stage.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::SampleKind;
use tauscope_bus::shell::Node;

use crate::pipeline::stage::check::{Check, Spot};
use crate::pipeline::stage::role::{Placement, Takes};
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite};
use crate::pipeline::stage::{StageConfig, StageSettings};

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

impl StageConfig for OutsideEntry {
    type Settings = Self;

    const KEY: &'static str = "outside";
    const ABOUT: &'static str = "An external program as a stage of the pipeline.";
    const PLACEMENT: Placement = Placement::Program;
    const JUDGES_CONTACT: bool = true;

    fn takes(&self) -> Takes {
        match self.output {
            Some(_) => Takes::AnyOne,
            None => Takes::Many,
        }
    }

    fn gives(&self) -> Option<SampleKind> {
        self.output.map(|output| match output {
            OutputEntry::JointState => SampleKind::JointState,
            OutputEntry::TwinState => SampleKind::TwinState,
            OutputEntry::Detection => SampleKind::Detection,
        })
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<Self> {
        let place = spot.place.key("command");
        let mut outside = self.clone();
        let program = outside.command.first_mut()?;
        if program.contains('/') {
            let path = check.file.resolve(Path::new(program.as_str()));
            if check.is_here(spot.index) && !path.is_file() {
                let title = format!("there is no program {}", path.display());
                check.push(check.file.at(&place.index(0), title));
                return None;
            }
            // Absolute, because the program is started in the folder of the pipeline file.
            let path = std::path::absolute(&path).unwrap_or(path);
            *program = path.display().to_string();
        }
        Some(outside)
    }
}

impl StageSettings for OutsideEntry {
    fn live(&self, _site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        Err(NodeError::Program)
    }

    fn replayed<'n>(&self, _site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        Ok(None)
    }

    /// A program may learn.
    fn learns_when_told(&self) -> bool {
        true
    }
}
