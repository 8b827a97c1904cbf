//! Input of a pipeline's recorders, and warnings about its robots, twins and detectors.

use std::collections::BTreeMap;

use tauscope_dynamics::{Joint, Model};
use tauscope_record::{RecordError, Recorder};
use tauscope_watch as watch;

use super::{Pipeline, Role, Stage};
use crate::build::{self, StreamFacts};
use crate::cell::Cell;
use crate::plausible;
use crate::provenance::sha256;
use crate::settings::Settings;

impl Pipeline {
    /// Warnings about former keys of the file, about valid but questionable settings of detectors (on `host`, if
    /// given), and about implausible values of robots.
    pub fn warnings(&self, host: Option<&str>) -> Vec<String> {
        let here = |stage: &&Stage| host.is_none() || stage.host.as_deref() == host;
        let mut warnings = self.former_keys.clone();
        for (name, cell) in &self.cells {
            let joints = cell.model.iter().flat_map(Model::joints);
            let remarks = joints.filter_map(Joint::remark);
            let findings = cell.findings.iter().cloned();
            let all = findings.chain(remarks);
            warnings.extend(all.map(|remark| format!("cell `{name}`: {remark}")));
        }
        for stage in self.stages.iter().filter(here) {
            let Settings::Detect { config, model } = &stage.settings else {
                continue;
            };
            let cell = stage.cells.first().and_then(|cell| self.cells.get(cell));
            // An error in it is already reported.
            let setup = cell.and_then(|cell| build::detect_setup(model.as_ref(), cell).ok());
            if let Some(warning) = setup.and_then(|setup| config.warning(&setup)) {
                warnings.push(format!("{}: {warning}", stage.name));
            }
        }
        warnings
    }

    /// Warnings about twins whose low-passes have no effect, if the rate of their source is known in advance.
    pub fn rate_warnings(&self, host: Option<&str>) -> Vec<String> {
        let here = |stage: &&Stage| host.is_none() || stage.host.as_deref() == host;
        let mut warnings = Vec::new();
        for stage in self.stages.iter().filter(here) {
            let Settings::Twin { config, model } = &stage.settings else {
                continue;
            };
            let source = stage.inputs.first().map(|&input| &self.stages[input]);
            let Some(rate_hz) = source.and_then(rate_hz) else {
                continue;
            };
            let filters = config.filters(model.as_ref().map(|model| model.filters));
            let faults = plausible::cutoffs_above_half(filters, rate_hz);
            warnings.extend(faults.map(|fault| format!("{}: {fault}", stage.name)));
        }
        warnings
    }

    /// Properties of the streams of these stages that a recorder needs.
    pub fn streams(&self, stages: &[usize]) -> Vec<StreamFacts> {
        let makers = stages.iter().map(|&from| &self.stages[from]);
        let facts = makers.filter_map(|maker| {
            let detector = match &maker.settings {
                Settings::Detect { config, .. } => {
                    let detector = config.name();
                    detector.map(str::to_owned)
                }
                Settings::Watch { .. } => Some(watch::NAME.to_owned()),
                _ => None,
            };
            Some(StreamFacts {
                stage: maker.name.clone(),
                cell: maker.cells.first()?.clone(),
                kind: maker.role.gives()?,
                detector,
                judges_contact: maker.role != Role::Watch,
            })
        });
        facts.collect()
    }

    /// Builds a recorder of the output streams of these stages.
    ///
    /// # Errors
    /// If streams and file names are inconsistent, or a file cannot be created.
    pub fn recorder(
        &self,
        config: &tauscope_record::Config,
        inputs: &[usize],
    ) -> Result<Recorder, RecordError> {
        let streams = self.streams(inputs);
        let is_inputs = |cell: &&Cell| streams.iter().any(|stream| stream.cell == cell.facts.name);
        let cells: Vec<&Cell> = self.cells.values().filter(is_inputs).collect();
        build::recorder(config, &cells, &streams, &self.provenance())
    }

    /// Provenance for the metadata of all recorded files.
    pub fn provenance(&self) -> BTreeMap<String, String> {
        let mut all = BTreeMap::from([
            ("tauscope".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("pipeline_sha256".to_owned(), sha256(self.text.as_bytes())),
        ]);
        for (name, cell) in &self.cells {
            if let Some(urdf) = &cell.facts.urdf {
                all.insert(format!("cells/{name}/urdf_sha256"), sha256(urdf.as_bytes()));
            }
        }
        for (stage, hash) in &self.model_sha256 {
            all.insert(format!("stages/{stage}/twin_sha256"), hash.clone());
        }
        all
    }
}

/// Sample rate of a source \[Hz\], if known before it is read.
fn rate_hz(source: &Stage) -> Option<f64> {
    let Settings::Ingest(config) = &source.settings else {
        return None;
    };
    if let Some(scenario) = &source.scenario {
        return Some(scenario.scenario.rate_hz);
    }
    if let Some(controller) = &config.ur_rtde {
        return Some(controller.rate_hz);
    }
    let file = config.file.as_ref()?;
    let recording = tauscope_session::open(&file.path).ok()?;
    plausible::recorded_rate_hz(&recording, &file.topics.state).ok()?
}
