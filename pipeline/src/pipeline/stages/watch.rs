//! A watch over a twin.

use serde::{Deserialize, Serialize};
use tauscope_bus::SampleKind;
use tauscope_bus::shell::Node;
use tauscope_twin::TwinFile;
use tauscope_watch::{self as watch, Config};

use super::twin::TwinSettings;
use crate::announce::Announced;
use crate::build;
use crate::learnt_state::{self, Kept};
use crate::pipeline::stage::check::{Check, Spot};
use crate::pipeline::stage::role::Takes;
use crate::pipeline::stage::site::{LiveSite, NodeError, ReplaySite};
use crate::pipeline::stage::{StageConfig, StageSettings};

/// Settings of a watch.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct WatchSettings {
    /// Settings from the pipeline file.
    pub config: Config,
    /// The model of the twin it listens to.
    pub model: Option<TwinFile>,
    /// Cutoff of that twin's low-pass on efforts \[Hz\].
    pub effort_cutoff_hz: f64,
}

impl StageConfig for Config {
    type Settings = WatchSettings;

    const KEY: &'static str = "watch";
    const FORMER_KEY: Option<&'static str> = Some("explain");
    const ABOUT: &'static str = "A watch over a twin: reports when its residual changes, and which physical effect \
                                 changed.";

    fn takes(&self) -> Takes {
        Takes::One(SampleKind::TwinState)
    }

    fn gives(&self) -> Option<SampleKind> {
        Some(SampleKind::Detection)
    }

    fn check(&self, check: &mut Check<'_>, spot: &Spot) -> Option<WatchSettings> {
        let twin = check.above::<tauscope_twin::Config>(spot.index);
        let (model, filters) = match twin {
            Some(twin) => {
                // An invalid twin is already reported.
                let twin = check.settings::<TwinSettings>(twin)?;
                (twin.model.clone(), twin.filters())
            }
            None => (None, tauscope_twin::Config::default().filters(None)),
        };
        let effort_cutoff_hz = filters.effort_cutoff_hz;
        let mut config = self.clone();
        if let Some(path) = &mut config.state {
            *path = check.file.resolve(path);
        }
        if let Some(cell) = check.cell(spot.index) {
            if let Err(error) = build::watch(&config, model.as_ref(), effort_cutoff_hz, cell) {
                check.push(check.file.at_key(&spot.place, error.to_string()));
                return None;
            }
            let joints = cell.facts.joint_names.len();
            let state = config.state.as_ref().filter(|_| check.is_here(spot.index));
            if let Some(Err(problems)) = state.map(|path| learnt_state::of_watch(path, joints)) {
                check.report.append(problems);
                return None;
            }
        }
        Some(WatchSettings {
            config,
            model,
            effort_cutoff_hz,
        })
    }
}

impl StageSettings for WatchSettings {
    fn live(&self, site: &LiveSite<'_>) -> Result<Node<'static>, NodeError> {
        let (cell, state) = (site.cell()?, self.config.state.clone());
        let mut watch = build::watch(
            &self.config,
            self.model.as_ref(),
            self.effort_cutoff_hz,
            cell,
        )?;
        if let Some(path) = &state {
            let joints = cell.facts.joint_names.len();
            let memory = learnt_state::of_watch(path, joints).map_err(NodeError::LearntState)?;
            if let Some(memory) = memory {
                watch = watch.resumed(&memory);
            }
        }
        learnt_state::tell_what_is_lost(site.stage, site.restarts, state.as_deref());
        let watch = Announced::new(site.stage, Kept::new(watch, state), &cell.facts);
        Ok(Node::stage(Box::new(watch)))
    }

    fn replayed<'n>(&self, site: &mut ReplaySite<'_>) -> Result<Option<Node<'n>>, NodeError> {
        let model = self.model.as_ref();
        let watch = build::watch(&self.config, model, self.effort_cutoff_hz, site.cell)?;
        Ok(Some(Node::stage(Box::new(watch))))
    }

    fn detector(&self) -> Option<&str> {
        Some(watch::NAME)
    }
}
