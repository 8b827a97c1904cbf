//! A sink that collects statistics of all twins and detectors of a replay.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_bus::{SampleRef, Sink, StageError};

use super::{Outcome, StageCounts};
use crate::cell::Cell;
use tauscope_session::{Finding, Plausible};

use crate::plausible::{self, PlausibleTwin};
use crate::tally::{DetectionTally, TwinTally};

/// Statistics of a replay.
#[derive(Debug, Clone, Default)]
pub struct Observed {
    /// Residual sums by twin stage.
    pub twins: BTreeMap<String, TwinTally>,
    /// Events by detect stage.
    pub detectors: BTreeMap<String, DetectionTally>,
    /// First and latest stamp \[ns\].
    pub stamps_ns: Option<(i64, i64)>,
    /// Implausibilities and irregularities, a line each; complete at the end.
    pub notes: Vec<String>,
}

impl Observed {
    /// Inserts the findings of the source before the other notes.
    pub fn note(&mut self, findings: &[Finding]) {
        let sentences = findings.iter().map(ToString::to_string);
        self.notes.splice(0..0, sentences);
    }

    /// Converts to the result of the replay of one recording.
    pub fn into_outcome(
        self,
        cell: &Cell,
        recording: String,
        stages: Vec<StageCounts>,
        files: Vec<PathBuf>,
    ) -> Outcome {
        let (first_ns, last_ns) = self.stamps_ns.unwrap_or_default();
        Outcome {
            recording,
            cell: cell.facts.name.clone(),
            effort_unit: cell.facts.effort_unit.as_str().to_owned(),
            joint_names: cell.facts.joint_names.clone(),
            duration_s: (last_ns - first_ns) as f64 * 1e-9,
            stamps_ns: (first_ns, last_ns),
            lost: stages.iter().map(|stage| stage.dropped).sum(),
            twins: self.twins.into_values().collect(),
            detectors: self.detectors.into_values().collect(),
            stages,
            files,
            notes: self.notes,
        }
    }
}

/// The sink.
#[derive(Debug)]
pub struct Observer {
    joint_names: Vec<String>,
    plausible: Plausible,
    /// Plausibility checks by twin stage.
    plausible_twins: BTreeMap<String, PlausibleTwin>,
    /// Statistics so far.
    pub observed: Observed,
}

impl Observer {
    /// Creates an observer of `cell` with these twins.
    pub fn new(cell: &Cell, plausible_twins: BTreeMap<String, PlausibleTwin>) -> Self {
        Self {
            joint_names: cell.facts.joint_names.clone(),
            plausible: plausible::of_cell(cell),
            plausible_twins,
            observed: Observed::default(),
        }
    }
}

impl Sink for &mut Observer {
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        let observed = &mut self.observed;
        let stamp_ns = match sample {
            SampleRef::TwinState(sample) => {
                if !observed.twins.contains_key(from) {
                    let tally = TwinTally::new(from, self.joint_names.len());
                    observed.twins.insert(from.to_owned(), tally);
                }
                if let Some(tally) = observed.twins.get_mut(from) {
                    tally.add(sample);
                }
                if let Some(plausible) = self.plausible_twins.get_mut(from) {
                    plausible.add(sample);
                }
                sample.header.stamp_ns
            }
            SampleRef::Detection(sample) => {
                if !observed.detectors.contains_key(from) {
                    let tally = DetectionTally::new(from, &self.joint_names);
                    observed.detectors.insert(from.to_owned(), tally);
                }
                if let Some(tally) = observed.detectors.get_mut(from) {
                    tally.add(sample);
                }
                sample.header.stamp_ns
            }
            SampleRef::JointState(sample) => {
                self.plausible.add(sample);
                sample.header.stamp_ns
            }
            SampleRef::Health(_) => return Ok(()),
        };
        let (first, _) = observed.stamps_ns.unwrap_or((stamp_ns, stamp_ns));
        observed.stamps_ns = Some((first, stamp_ns));
        Ok(())
    }

    fn finish(&mut self) -> Result<(), StageError> {
        let findings = self.plausible.findings().into_iter();
        let mut notes: Vec<String> = findings.map(|finding| finding.to_string()).collect();
        // Twins behind one source report the same irregularities.
        for note in self
            .plausible_twins
            .values()
            .flat_map(PlausibleTwin::oddities)
        {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        self.observed.notes = notes;
        Ok(())
    }
}
