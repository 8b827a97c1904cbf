//! Calibration of a twin's gain, offset and noise per joint, and of the detectors' contact-free scores. It uses the
//! stages of the pipeline, so that the values hold there.

mod cutoff;
mod measured;
mod read;
mod spread;

use std::path::{Path, PathBuf};

use tauscope_bus::TwinState;
use tauscope_bus::shell::{Ends, Group, Input, Node};
use tauscope_dynamics::effort_scale::{EffortScale, ScaleFault};
use tauscope_ingest::{FileConfig, RecordedSource, Topics};
use tauscope_session::{Effect, Finding, by_recording};
use tauscope_twin::{
    Calibration, Expected, JointCorrection, Robot, TwinFile, spread_scale, telling_slopes,
};

use crate::build;
use crate::cell::{Cell, EffortUnit};
use crate::plausible;
use crate::provenance;
use crate::replay::{self, ReplayError};
use crate::report::without_path;
use read::{Read, Settled};

/// A calibration: the twin and its recordings.
#[derive(Debug)]
pub struct Job<'a> {
    /// The cell.
    pub cell: &'a Cell,
    /// Topics of the recordings.
    pub topics: &'a Topics,
    /// The twin, without a model.
    pub twin: &'a tauscope_twin::Config,
    /// Contact-free recordings for fitting the gains.
    pub fit: &'a [PathBuf],
    /// Contact-free recordings for measuring noise and scores; if empty, those of the fit.
    pub validation: &'a [PathBuf],
}

/// Error that ends a calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// A recording that the stages cannot process.
    #[error("{}: {}", recording.display(), without_path(recording, source.to_string()))]
    Recording {
        /// The recording.
        recording: PathBuf,
        /// The cause.
        source: ReplayError,
    },
    /// No sample with a measured effort.
    #[error(
        "no sample to calibrate on: none of {samples} joint states measures an effort; record the topic that has efforts, \
         with the drives on"
    )]
    NoEffort {
        /// Number of joint states read.
        samples: u64,
    },
    /// Recordings that end before the filters have settled.
    #[error(
        "no sample to calibrate on: the twin's filters need {settling_s:.1} s without a gap, and the {samples} joint states \
         with efforts end before; record longer pieces"
    )]
    TooShort {
        /// Number of joint states with efforts read.
        samples: u64,
        /// Settling time of the filters \[s\].
        settling_s: f64,
    },
    /// No sample that is contact-free by the labels.
    #[error(
        "no sample to calibrate on: the labels leave no time in which nothing touches the robot"
    )]
    AllTouched,
    /// An implausible recording, which would give a wrong calibration.
    #[error("{}: {oddity}", recording.display())]
    Implausible {
        /// The recording.
        recording: PathBuf,
        /// The fault.
        oddity: Finding,
    },
    /// An arm at rest with unknown torque constants.
    #[error(
        "the arm is at rest in all recordings, so the gain from N m to A cannot be determined: record it in motion, or give \
         the torque constants"
    )]
    Stands,
    /// Recordings that are not of this robot, or not in this unit.
    #[error(transparent)]
    WrongScale(#[from] ScaleFault),
}

impl CalibrateError {
    /// Whether the error is in the arguments or input files (exit code 2).
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

/// A calibrated twin, with the number of lost samples.
#[derive(Debug)]
pub struct Calibrated {
    /// The twin.
    pub file: TwinFile,
    /// Number of samples for the fit of the gains.
    pub samples: u64,
    /// Number of samples of the recordings that were lost or refused.
    pub lost: u64,
    /// Irregularities in the recordings, a line each.
    pub notes: Vec<String>,
    /// Reason why the fitted gains are implausible.
    doubt: Option<CalibrateError>,
}

impl Job<'_> {
    /// Fits gain and offset, then measures noise and scores. `progress` receives the index of the recording among all
    /// that are read, and its completed fraction.
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

    /// Fits gain and offset on the contact-free samples; `is_free` decides by recording and stamp.
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
                // An external twin in A already contains its torque constants, so they do not follow from the fitted
                // gain.
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

    /// Recordings on which noise and scores are measured.
    fn measured(&self) -> &[PathBuf] {
        if self.validation.is_empty() {
            self.fit
        } else {
            self.validation
        }
    }

    /// Number of recordings that are read, for a progress bar.
    pub fn recordings(&self) -> usize {
        let measured = self.measured().len();
        let chosen = usize::from(self.twin.effort_cutoff_hz.is_none()) * measured;
        self.fit.len() + chosen + measured
    }

    /// Runs a recording through source and twin and passes every sample with settled filters to `take`.
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
            let sink = Settled {
                plausible: &mut plausible,
                measured: &mut measured,
                ready: &mut settled,
                take: &mut *take,
                reset: true,
            };
            let mut group = Group::default();
            let of = |name: &str| Input::Of(name.to_owned());
            group.add(Node::source(Box::new(source)), Ends::new("ingest", vec![]))?;
            let states = vec![of("ingest")];
            group.add(Node::stage(Box::new(twin)), Ends::new("twin", states))?;
            let both = vec![of("ingest"), of("twin")];
            group.add(Node::sink(Box::new(sink)), Ends::new("calibration", both))?;
            let counts = replay::run(&mut group, &mut |fraction| {
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

    /// The twin file before the fit.
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

/// Rejects an implausible recording.
fn refuse_fault(recording: &Path, findings: &[Finding]) -> Result<(), CalibrateError> {
    match findings.iter().find(|it| it.effect() == Effect::Fault) {
        Some(fault) => Err(CalibrateError::Implausible {
            recording: recording.to_owned(),
            oddity: fault.clone(),
        }),
        None => Ok(()),
    }
}
