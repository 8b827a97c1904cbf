//! Terms of [`Layer::Record`]: they convert the effort that the drives apply into the effort that they report.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Layer, MotionSample, Term, TermSpec};

use super::error::ScenarioError;
use super::plant::Plant;

/// Terms of [`Layer::Record`], applied at every integration step of the plant.
#[derive(Debug)]
pub(super) struct Record {
    terms: Vec<Box<dyn Term>>,
    zero: Vec<f64>,
    effort_nm: Vec<f64>,
    recording_s: f64,
}

impl Record {
    /// Builds the terms of [`Layer::Record`] among `specs`.
    pub fn new(model: &Model, specs: &[TermSpec]) -> Result<Self, ScenarioError> {
        let mut terms = Vec::new();
        for spec in specs {
            if spec.effect()?.layer == Layer::Record {
                terms.push(spec.build(model)?);
            }
        }
        Ok(Self {
            terms,
            zero: vec![0.0; model.dof()],
            effort_nm: vec![0.0; model.dof()],
            recording_s: 0.0,
        })
    }

    /// Updates the reported effort from the effort of the drives \[N m\], `dt_s` after the previous update.
    pub fn take(&mut self, plant: &Plant, effort_nm: &[f64], dt_s: f64) {
        let n = self.effort_nm.len();
        self.effort_nm.copy_from_slice(&effort_nm[..n]);
        self.recording_s += dt_s;
        let at = MotionSample {
            dt_s,
            recording_s: self.recording_s,
            session_s: plant.session_start_s() + self.recording_s,
            position: plant.position(),
            velocity: plant.velocity(),
            acceleration: &self.zero,
            transmitted: &self.zero,
        };
        for term in &mut self.terms {
            term.act(&at, &mut self.effort_nm);
        }
    }

    /// Returns the reported effort \[N m\].
    pub fn effort_nm(&self) -> &[f64] {
        &self.effort_nm
    }
}
