//! Facts for a pipeline's recorders, and warnings about its robots, twins and detectors.

use std::collections::BTreeMap;

use tauscope_dynamics::{Joint, Model};

use super::stages::detect::DetectSettings;
use super::stages::ingest::IngestSettings;
use super::stages::twin::TwinSettings;
use super::{Pipeline, Stage, StreamFacts};
use crate::build;
use crate::cell::Cell;
use crate::plausible;
use crate::provenance::sha256;

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
            let Some(DetectSettings { config, model }) = stage.settings.get() else {
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
            let Some(twin) = stage.settings.get::<TwinSettings>() else {
                continue;
            };
            let source = stage.inputs.first().map(|&input| &self.stages[input]);
            let source = source.and_then(|source| source.settings.get::<IngestSettings>());
            let Some(rate_hz) = source.and_then(IngestSettings::rate_hz) else {
                continue;
            };
            let faults = plausible::cutoffs_above_half(twin.filters(), rate_hz);
            warnings.extend(faults.map(|fault| format!("{}: {fault}", stage.name)));
        }
        warnings
    }

    /// Properties of the streams of these stages for their receivers.
    pub fn streams(&self, stages: &[usize]) -> Vec<StreamFacts> {
        let makers = stages.iter().map(|&from| &self.stages[from]);
        let facts = makers.filter_map(|maker| {
            Some(StreamFacts {
                stage: maker.name.clone(),
                cell: maker.cells.first()?.clone(),
                kind: maker.role.gives?,
                detector: maker.settings.detector().map(str::to_owned),
                judges_contact: maker.role.kind.judges_contact,
            })
        });
        facts.collect()
    }

    /// The cells of these streams.
    pub fn cells_of(&self, streams: &[StreamFacts]) -> Vec<&Cell> {
        let has = |cell: &&Cell| streams.iter().any(|stream| stream.cell == cell.facts.name);
        self.cells.values().filter(has).collect()
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
        for stage in &self.stages {
            let twin = stage.settings.get::<TwinSettings>();
            if let Some(hash) = twin.and_then(|twin| twin.model_sha256.clone()) {
                all.insert(format!("stages/{}/twin_sha256", stage.name), hash);
            }
        }
        all
    }
}
