//! A detector: checked behind its twin, with its learnt state.

use serde::{Deserialize, Serialize};
use std::path::Path;
use tauscope_bus::SampleKind;
use tauscope_bus::shell::Node;
use tauscope_detect::Config;
use tauscope_twin::TwinFile;

use super::twin::model_above;
use crate::announce::Announced;
use crate::build;
use crate::learnt_state::{self, Kept};
use crate::pipeline::stage::check::{Check, Spot};
use crate::pipeline::stage::role::Takes;
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite};
use crate::pipeline::stage::{StageConfig, StageSettings};

/// Settings of a detector.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct DetectSettings {
    /// Settings from the pipeline file.
    pub config: Box<Config>,
    /// The model of the twin it listens to, with the score statistics for its threshold.
    pub model: Option<TwinFile>,
}

impl StageConfig for Config {
    type Settings = DetectSettings;

    const KEY: &'static str = "detect";
    const ABOUT: &'static str = "A detector of contacts.";
    const JUDGES_CONTACT: bool = true;

    fn takes(&self) -> Takes {
        Takes::One(SampleKind::TwinState)
    }

    fn gives(&self) -> Option<SampleKind> {
        Some(SampleKind::Detection)
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<DetectSettings> {
        let (index, place) = (spot.index, &spot.place);
        let model = model_above(check, index)?;
        let mut config = self.clone();
        let resolve = |path: &Path| check.file.resolve(path);
        if let Err(problems) = learnt_state::read_learnt(&mut config, &resolve) {
            check.report.append(problems);
            return None;
        }
        if let Some(path) = config.state_mut() {
            *path = check.file.resolve(path);
        }
        for (name, path) in config.trained_files_mut() {
            *path = check.file.resolve(path);
            if !path.exists() {
                let place = place.key(name).key("model");
                let title = format!("there is no trained detector {}", path.display());
                let problem = check.file.at(&place, title);
                let help = "`tauscope evaluate` trains one";
                check.push(problem.help(help));
                return None;
            }
        }
        let mut resumed = config.clone();
        if check.is_here(index)
            && let Err(problems) = learnt_state::resume(&mut resumed)
        {
            check.report.append(problems);
            return None;
        }
        if let Some(cell) = check.cell(index)
            && let Err(error) = build::detect(&resumed, model.as_ref(), cell, None)
        {
            check.push(check.file.at_key(place, error.to_string()));
            return None;
        }
        Some(DetectSettings {
            config: Box::new(config),
            model,
        })
    }
}

impl StageSettings for DetectSettings {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        let mut config = self.config.clone();
        let path = learnt_state::resume(&mut config).map_err(NodeError::LearntState)?;
        if config.learns_when_told() {
            learnt_state::tell_what_is_lost(site.stage, site.restarts, path.as_deref());
        }
        let (cell, shared) = (site.cell()?, Some(site.shared.clone()));
        let detect = build::detect(&config, self.model.as_ref(), cell, shared)?;
        let detect = Announced::new(site.stage, Kept::new(detect, path), &cell.facts);
        Ok(Node::stage(Box::new(detect)))
    }

    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        let shared = Some(site.shared.clone());
        let detect = build::detect(&self.config, self.model.as_ref(), site.cell, shared)?;
        Ok(Some(Node::stage(Box::new(detect))))
    }

    fn detector(&self) -> Option<&str> {
        self.config.name()
    }

    fn learns_when_told(&self) -> bool {
        self.config.learns_when_told()
    }
}
