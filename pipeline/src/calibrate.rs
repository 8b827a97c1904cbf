//! Calibration: what a twin's gain, offset and noise per joint are, and what the detectors' scores do
//! while nothing touches the robot. The stages are the pipeline's own, so that the numbers hold there.

mod cutoff;
mod measured;
mod read;
mod spread;

use std::path::{Path, PathBuf};

use tauscope_bus::{JointState, TwinState};
use tauscope_dynamics::effort_scale::{EffortScale, ScaleFault};
use tauscope_ingest::{FileConfig, RecordedSource, Topics};
use tauscope_session::{Effect, Finding, by_recording};
use tauscope_twin::{
    Calibration, Expected, JointCorrection, Robot, TwinFile, spread_scale, telling_slopes,
};

use crate::build;
use crate::cell::{Cell, EffortUnit};
use crate::graph::Graph;
use crate::plausible;
use crate::provenance;
use crate::replay::ReplayError;
use crate::report::without_path;
use read::{Read, Settled};

/// What to calibrate, and on what.
#[derive(Debug)]
pub struct Job<'a> {
    /// The cell.
    pub cell: &'a Cell,
    /// Topics of the recordings.
    pub topics: &'a Topics,
    /// The twin, without a model.
    pub twin: &'a tauscope_twin::Config,
    /// Contact-free recordings that the gains are fitted on.
    pub fit: &'a [PathBuf],
    /// Contact-free recordings that noise and scores are measured on; those of the fit if empty.
    pub validation: &'a [PathBuf],
}

/// Why a calibration gives nothing.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// A recording cannot be run through the stages.
    #[error("{}: {}", recording.display(), without_path(recording, source.to_string()))]
    Recording {
        /// The recording.
        recording: PathBuf,
        /// Why.
        source: ReplayError,
    },
    /// No sample of the recordings measures an effort.
    #[error(
        "no sample to calibrate on: none of {samples} joint states measures an effort; record the topic that has efforts, \
         with the drives on"
    )]
    NoEffort {
        /// Joint states that were read.
        samples: u64,
    },
    /// The recordings are over before the filters have settled.
    #[error(
        "no sample to calibrate on: the twin's filters need {settling_s:.1} s without a gap, and the {samples} joint states \
         with efforts end before; record longer pieces"
    )]
    TooShort {
        /// Joint states with efforts that were read.
        samples: u64,
        /// Time that the filters need \[s\].
        settling_s: f64,
    },
    /// All samples are labelled as touched.
    #[error(
        "no sample to calibrate on: the labels leave no time in which nothing touches the robot"
    )]
    AllTouched,
    /// Nothing that is learnt from this recording can be right.
    #[error("{}: {oddity}", recording.display())]
    Implausible {
        /// The recording.
        recording: PathBuf,
        /// Why.
        oddity: Finding,
    },
    /// The arm stands, and how many N m an ampere gives is not known.
    #[error(
        "the arm stands in all recordings, so that no gain from N m to A can be told: record it in motion, or give \
         the torque constants"
    )]
    Stands,
    /// The recordings are not of this robot in this unit.
    #[error(transparent)]
    WrongScale(#[from] ScaleFault),
}

impl CalibrateError {
    /// Whether the arguments or files are wrong (exit code 2), rather than what happened since.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Recording { source, .. } => source.is_input(),
            Self::NoEffort { .. }
            | Self::TooShort { .. }
            | Self::AllTouched
            | Self::Implausible { .. }
            | Self::Stands
            | Self::WrongScale(_) => true,
        }
    }
}

/// A calibrated twin, and what was lost on the way to it.
#[derive(Debug)]
pub struct Calibrated {
    /// The twin.
    pub file: TwinFile,
    /// Samples that the gains were fitted on.
    pub samples: u64,
    /// Samples of the recordings that were lost or refused.
    pub lost: u64,
    /// What is odd in the recordings, a line each.
    pub notes: Vec<String>,
    /// Why the gains cannot be right, though they could be fitted.
    doubt: Option<CalibrateError>,
}

impl Job<'_> {
    /// Fits gain and offset, then measures noise and scores. `progress` is told the place of the
    /// recording among all that are read, and how far it is.
    ///
    /// # Errors
    /// If a recording cannot be read, or all are too short.
    pub fn run(&self, progress: &dyn Fn(usize, f64)) -> Result<Calibrated, CalibrateError> {
        let mut calibrated = self.fit(&|_, _| true, progress)?;
        if let Some(doubt) = calibrated.doubt.take() {
            return Err(doubt);
        }
        let measured = self.measured();
        if self.twin.effort_cutoff_hz.is_none() {
            self.choose_cutoffs(&mut calibrated.file, measured, &|index, fraction| {
                progress(self.fit.len() + index, fraction);
            })?;
        }
        let lost = self.measure(&mut calibrated.file, measured, &|index, fraction| {
            progress(self.recordings() - measured.len() + index, fraction);
        })?;
        calibrated.lost += if self.validation.is_empty() { 0 } else { lost };
        Ok(calibrated)
    }

    /// Fits gain and offset on the samples of which `is_free`, told the recording and the stamp, says that
    /// nothing touches the robot.
    ///
    /// # Errors
    /// If a recording cannot be read, or all are too short.
    pub fn fit(
        &self,
        is_free: &(dyn Fn(&Path, i64) -> bool + Sync),
        progress: &dyn Fn(usize, f64),
    ) -> Result<Calibrated, CalibrateError> {
        let joint_count = self.cell.facts.joint_names.len();
        let mut all = Read::default();
        let facts = &self.cell.facts;
        let in_nm =
            facts.effort_unit == EffortUnit::Nm || facts.torque_constants_nm_per_a.is_some();
        let from_topic = self.twin.expected == Expected::Topic;
        let mut calibration = Calibration::new(joint_count, in_nm || from_topic);
        let mut found = Vec::new();
        let mut all_stand = true;
        for (index, recording) in self.fit.iter().enumerate() {
            let step = &mut |fraction| progress(index, fraction);
            let read = self.each(recording, None, step, &mut |sample| {
                if is_free(recording, sample.header.stamp_ns) {
                    calibration.add(sample);
                }
            })?;
            all_stand &= read.stands;
            refuse_fault(recording, &read.findings)?;
            all.add(&read);
            found.push((recording.display().to_string(), read.findings));
        }
        let notes = by_recording(&found);
        let lost = all.lost;
        let Some(fits) = calibration.fit() else {
            let twin = build::twin(self.twin, None, self.cell);
            let settling_s = twin.map_or(0.0, |twin| twin.settling_time_s());
            return Err(all.why_nothing(settling_s));
        };
        let scale = EffortScale::of(&telling_slopes(&facts.joint_names, &fits));
        if let Some(fault) = scale.fault_in_nm().filter(|_| in_nm && !from_topic) {
            return Err(fault.into());
        }
        let doubt = match (from_topic, in_nm) {
            (true, _) => None,
            (false, true) => spread_scale(&fits).and_then(EffortScale::fault_of_spread_in_nm),
            (false, false) => scale.fault_in_a(),
        };
        let stands = (all_stand && !in_nm && !from_topic).then_some(CalibrateError::Stands);
        let mut file = self.file();
        for (name, fit) in self.cell.facts.joint_names.iter().zip(&fits) {
            let joint = JointCorrection {
                gain: fit.gain,
                // A twin in A already contains its torque constants; the fitted gain does not tell them.
                gain_deviation: (from_topic && !in_nm)
                    .then_some(fit.gain.abs().max(f64::MIN_POSITIVE)),
                offset: fit.offset,
                explained: Some(fit.explained),
                ..JointCorrection::default()
            };
            file.joints.insert(name.clone(), joint);
        }
        Ok(Calibrated {
            file,
            samples: calibration.samples(),
            lost,
            notes,
            doubt: stands.or(doubt.map(CalibrateError::from)),
        })
    }

    /// What noise and scores are measured on.
    fn measured(&self) -> &[PathBuf] {
        if self.validation.is_empty() {
            self.fit
        } else {
            self.validation
        }
    }

    /// How many recordings are read, for a progress bar.
    pub fn recordings(&self) -> usize {
        let measured = self.measured().len();
        let chosen = usize::from(self.twin.effort_cutoff_hz.is_none()) * measured;
        self.fit.len() + chosen + measured
    }

    /// Runs a recording through source and twin and hands over every sample whose filters have
    /// settled.
    fn each(
        &self,
        recording: &Path,
        model: Option<&TwinFile>,
        progress: &mut dyn FnMut(f64),
        take: &mut (dyn FnMut(&TwinState) + Send),
    ) -> Result<Read, CalibrateError> {
        let failed = |source: ReplayError| CalibrateError::Recording {
            recording: recording.to_owned(),
            source,
        };
        let mut plausible = plausible::of_cell(self.cell);
        let (mut measured, mut settled) = (0, 0);
        let mut run = || -> Result<(u64, Vec<Finding>), ReplayError> {
            let config = tauscope_ingest::Config::default();
            let file = FileConfig {
                path: recording.to_owned(),
                topics: self.topics.clone(),
            };
            let setup = build::ingest_setup(self.cell);
            let mut source = RecordedSource::open_to_learn(&file, &config, &setup)?;
            let findings = source.findings();
            let twin = build::twin(self.twin, model, self.cell)?;
            let mut graph = Graph::default();
            let states = graph.source("ingest", Box::new(source));
            let twins = graph.stage("twin", Box::new(twin), &states)?;
            let inputs = vec![
                graph.listen::<JointState>(&states)?,
                graph.listen::<TwinState>(&twins)?,
            ];
            let sink = Settled {
                plausible: &mut plausible,
                measured: &mut measured,
                ready: &mut settled,
                take: &mut *take,
                reset: true,
            };
            graph.sink("calibration", Box::new(sink), inputs);
            let counts = graph.run(&mut |fraction| {
                progress(fraction);
                true
            })?;
            let lost = counts.iter().flatten().map(|stage| stage.dropped).sum();
            Ok((lost, findings.get()))
        };
        let (lost, mut findings) = run().map_err(failed)?;
        findings.extend(plausible.findings());
        Ok(Read {
            lost,
            measured,
            settled,
            samples: plausible.samples(),
            stands: plausible.stands(),
            findings,
        })
    }

    /// The twin as far as it is known before the fit.
    pub fn file(&self) -> TwinFile {
        let facts = &self.cell.facts;
        TwinFile {
            version: tauscope_twin::TWIN_FILE_VERSION,
            robot: Robot {
                name: self
                    .cell
                    .model
                    .as_ref()
                    .map_or_else(String::new, |m| m.name().to_owned()),
                urdf_sha256: facts
                    .urdf
                    .as_ref()
                    .map_or_else(String::new, |urdf| provenance::sha256(urdf.as_bytes())),
            },
            effort_unit: facts.effort_unit.as_str().to_owned(),
            filters: self.twin.filters(None),
            joints: std::collections::BTreeMap::new(),
            terms: match self.twin.expected {
                Expected::Model => self.cell.stated_terms(),
                Expected::Topic => Vec::new(),
            },
            scores: std::collections::BTreeMap::new(),
            provenance: std::collections::BTreeMap::new(),
        }
    }
}

/// Refuses a recording from which nothing right can be learnt.
fn refuse_fault(recording: &Path, findings: &[Finding]) -> Result<(), CalibrateError> {
    match findings.iter().find(|it| it.effect() == Effect::Fault) {
        Some(fault) => Err(CalibrateError::Implausible {
            recording: recording.to_owned(),
            oddity: fault.clone(),
        }),
        None => Ok(()),
    }
}
