//! Replay of a recording through the stages of a pipeline, in one process and at full speed. The output is
//! reproducible byte for byte.

mod error;
mod observe;
mod run;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use tauscope_bus::Sink;
use tauscope_bus::shell::{Ends, Group, Input, Node};
use tauscope_ingest::Findings;

use crate::cell::Cell;
use crate::pipeline::stages::ingest::IngestSettings;
use crate::pipeline::stages::record::redirect;
use crate::pipeline::stages::twin::TwinSettings;
use crate::pipeline::{Pipeline, Placement, ReplaySite, Stage};
use crate::plausible::PlausibleTwin;
use crate::tally::{DetectionTally, TwinTally};

pub use error::ReplayError;
pub use observe::Observer;
pub use run::StageCounts;
pub(crate) use run::run;

/// Handling of an archive that already holds a twin's effort.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum TwinChoice {
    /// Recompute it.
    #[default]
    Recompute,
    /// Use `/twin/joint_states` and `/residual` of the archive.
    Keep,
}

/// Result of the replay of one recording.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The recording's name without the extension.
    pub recording: String,
    /// The cell.
    pub cell: String,
    /// Unit of the efforts.
    pub effort_unit: String,
    /// The joints, in URDF order.
    pub joint_names: Vec<String>,
    /// Time from the first to the last sample \[s\].
    pub duration_s: f64,
    /// Stamps of the first and the last sample \[ns since the epoch\].
    pub stamps_ns: (i64, i64),
    /// Number of samples that were lost or refused, over all stages.
    pub lost: u64,
    /// Residual sums by twin stage.
    pub twins: Vec<TwinTally>,
    /// Events by detect stage.
    pub detectors: Vec<DetectionTally>,
    /// Sample counters by stage, in the order of the pipeline.
    pub stages: Vec<StageCounts>,
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Implausibilities and irregularities of the recording, a line each.
    pub notes: Vec<String>,
}

/// A pipeline prepared for replay: recordings replace its source.
#[derive(Debug)]
pub struct Replay<'a> {
    pipeline: &'a Pipeline,
    /// The source that the recordings replace, and its settings.
    source: (&'a Stage, &'a IngestSettings),
    /// Indices of the source and of its downstream stages in the pipeline.
    members: Vec<usize>,
    twin: TwinChoice,
    reads_ahead: bool,
}

impl<'a> Replay<'a> {
    /// Prepares `pipeline`; `source` names the stage that the recordings replace, if there are several.
    ///
    /// # Errors
    /// If that stage is missing or ambiguous.
    pub fn new(
        pipeline: &'a Pipeline,
        source: Option<&str>,
        twin: TwinChoice,
    ) -> Result<Self, ReplayError> {
        let stages = pipeline.stages.iter();
        let sources = stages.filter_map(|stage| Some((stage, stage.settings.get()?)));
        let sources: Vec<(&Stage, &IngestSettings)> = sources.collect();
        let names = || -> Vec<String> {
            let names = sources.iter().map(|(stage, _)| stage.name.clone());
            names.collect()
        };
        let source = match (source, &sources[..]) {
            (_, []) => return Err(ReplayError::NoSource),
            (None, [only]) => *only,
            (None, _) => return Err(ReplayError::ManySources { stages: names() }),
            (Some(name), _) => {
                let found = sources.iter().find(|(stage, _)| stage.name == name);
                *found.ok_or_else(|| ReplayError::UnknownSource {
                    name: name.to_owned(),
                    known: names().join(", "),
                })?
            }
        };
        let members = members(pipeline, source.0);
        Ok(Self {
            pipeline,
            source,
            members,
            twin,
            reads_ahead: false,
        })
    }

    /// Sets whether recordings are read in a separate thread, which uses a second core. The result is the same.
    #[must_use]
    pub fn reading_ahead(mut self, ahead: bool) -> Self {
        self.reads_ahead = ahead;
        self
    }

    /// External programs, which a replay leaves out although they depend on its source. Stages that listen only to
    /// them are left out, too.
    pub fn left_out(&self) -> Vec<&'a str> {
        let outside = |stage: &&Stage| stage.role.kind.placement == Placement::Program;
        self.pipeline
            .stages
            .iter()
            .filter(outside)
            .map(|stage| stage.name.as_str())
            .collect()
    }

    /// Replays one recording into `out`, if given. `progress` receives the completed fraction, 0 to 1; if it returns
    /// `false`, the replay is cancelled ([`ReplayError::Interrupted`]).
    ///
    /// # Errors
    /// If the recording cannot be read or the output cannot be written; unfinished files keep the suffix `.part`.
    pub fn run(
        &self,
        recording: &Path,
        out: Option<&Path>,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Outcome, ReplayError> {
        self.run_with(recording, out, None, progress)
    }

    /// Replays one recording as [`run`](Self::run) does, without output files. The additional sink, if given,
    /// receives the samples of every stage.
    ///
    /// # Errors
    /// If the recording cannot be read, or the additional sink fails.
    pub fn run_beside(
        &self,
        recording: &Path,
        beside: Option<Box<dyn Sink + '_>>,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Outcome, ReplayError> {
        self.run_with(recording, None, beside, progress)
    }

    fn run_with(
        &self,
        recording: &Path,
        out: Option<&Path>,
        beside: Option<Box<dyn Sink + '_>>,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Outcome, ReplayError> {
        let cell = self.cell();
        let stem = stem(recording);
        let mut observer = Observer::new(cell, self.plausible_twins());
        let mut group = Group::default();
        let mut streams = BTreeSet::new();
        let (mut findings, mut files) = (Findings::default(), Vec::new());
        // By twin.
        let mut shared: BTreeMap<usize, tauscope_detect::Shared> = BTreeMap::new();
        for &index in &self.members {
            let stage = &self.pipeline.stages[index];
            let listened = stage.inputs.iter().copied();
            let listened: Vec<usize> = listened.filter(|input| streams.contains(input)).collect();
            let is_source = stage.name == self.source.0.name;
            if listened.is_empty() && stage.role.gives.is_some() && !is_source {
                continue;
            }
            let behind = listened.first().copied().unwrap_or(index);
            let mut site = ReplaySite {
                cell,
                recording,
                out,
                source: &self.source.1.config,
                keeps_twin: self.twin == TwinChoice::Keep,
                reads_ahead: self.reads_ahead,
                pipeline: self.pipeline,
                inputs: &listened,
                shared: shared.entry(behind).or_default().clone(),
                findings: &mut findings,
                files: &mut files,
            };
            let Some(node) = stage.settings.replayed(&mut site)? else {
                continue;
            };
            let mut inputs = Vec::new();
            // A twin of the archive is a source.
            if !node.is_source() {
                inputs.extend(self.inputs(listened.iter().copied()));
            }
            if stage.role.kind.hears_health {
                inputs.extend(listened.iter().map(|&at| Input::HealthOf(self.name(at))));
            }
            if !node.is_sink() {
                streams.insert(index);
            }
            group.add(node, Ends::new(&stage.name, inputs))?;
        }
        let sinks: [(&str, Option<Box<dyn Sink + '_>>); 2] = [
            ("observer", Some(Box::new(&mut observer))),
            ("beside", beside),
        ];
        let stage_count = group.len();
        for (name, sink) in sinks {
            if let Some(sink) = sink {
                let inputs = self.inputs(streams.iter().copied());
                group.add(Node::sink(sink), Ends::new(name, inputs))?;
            }
        }
        let mut stages = run(&mut group, progress)?.ok_or(ReplayError::Interrupted)?;
        stages.truncate(stage_count);
        drop(group);
        observer.observed.note(&findings.get());
        Ok(observer.observed.into_outcome(cell, stem, stages, files))
    }

    fn plausible_twins(&self) -> BTreeMap<String, PlausibleTwin> {
        let stages = self.members.iter().map(|&at| &self.pipeline.stages[at]);
        let twins = stages.filter_map(|stage| {
            let TwinSettings { config, model, .. } = stage.settings.get()?;
            let twin = PlausibleTwin::new(config, model.as_ref(), self.cell());
            Some((stage.name.clone(), twin))
        });
        twins.collect()
    }

    /// Returns the files that a replay of `recording` into `out` writes.
    pub fn files(&self, recording: &Path, out: &Path) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for &index in &self.members {
            if let Some(config) = self.pipeline.stages[index].settings.get() {
                redirect(config, Some(out), recording, &mut files);
            }
        }
        files
    }

    /// The name of the cell whose recordings are replayed.
    pub fn cell_name(&self) -> &'a str {
        &self.cell().facts.name
    }

    fn cell(&self) -> &'a Cell {
        let name = self.source.0.cells.first().map_or("", String::as_str);
        &self.pipeline.cells[name]
    }

    /// Inputs for the streams of these stages.
    fn inputs(&self, stages: impl IntoIterator<Item = usize>) -> Vec<Input> {
        let names = stages.into_iter().map(|index| self.name(index));
        names.map(Input::Of).collect()
    }

    fn name(&self, index: usize) -> String {
        self.pipeline.stages[index].name.clone()
    }
}

/// A recording's name; see [`tauscope_archive::name_of`].
pub fn stem(recording: &Path) -> String {
    tauscope_archive::name_of(recording)
}

/// Returns `source` and every downstream stage that does not depend on an external program, in the order of the
/// pipeline.
fn members(pipeline: &Pipeline, source: &Stage) -> Vec<usize> {
    let mut members: Vec<usize> = Vec::new();
    for (index, stage) in pipeline.stages.iter().enumerate() {
        let hangs = stage.inputs.iter().any(|input| members.contains(input));
        let ours = stage.role.kind.placement != Placement::Program;
        if stage.name == source.name || (hangs && ours) {
            members.push(index);
        }
    }
    members
}
