//! The hypotheses at the shapes that are tried, with their columns next to an explanation.

use std::sync::Arc;

use tauscope_dynamics::terms::{COULOMB_FRICTION, CoordinateKind, UNKNOWN};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::parallel;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::physics::friction::least;
use crate::propose::grid::shapes;
use crate::propose::{times, wall};

use super::curves::{self, Curve};
use super::prior::{self, Magnitude};

/// Effort below which a column is silent, as a share of the joint's. Resolution: of the rounding of efforts.
pub const SILENT: f64 = 1e-9;
/// Usual number of times at which a change may happen. Resolution: that of the scan over a recording.
const TIMES: f64 = 60.0;

/// A hypothesis at one shape.
#[derive(Debug, Clone)]
pub struct Variant {
    /// The effect and its place.
    pub hypothesis: Hypothesis,
    /// Its coordinates with the factors at zero.
    pub shape: Vec<f64>,
    /// Index of the column that its shape alone adds, if any.
    pub offset: Option<usize>,
    /// Index of the first of its factors' columns.
    pub first: usize,
    /// Means of the factors.
    pub centres: Vec<f64>,
    /// Standard deviations of the factors.
    pub deviations: Vec<f64>,
    /// By factor, whether it cannot be negative.
    pub positive: Vec<bool>,
    /// Logarithm of the prior \[nats\].
    pub log_prior: f64,
    /// Whether every explanation has it.
    pub is_forced: bool,
    /// Whether it corrects friction that the robot's file states.
    pub corrects_stated: bool,
    /// The curve of an `unknown`.
    pub curve: Option<Curve>,
}

impl Variant {
    /// The effect with these deviations of its factors from their means.
    pub fn with(&self, factors: &[f64]) -> Active {
        if let Some(curve) = &self.curve {
            return curve.with(factors);
        }
        let mut coordinates = self.shape.clone();
        let factors = factors.iter().zip(&self.centres);
        for (&i, (value, centre)) in self.hypothesis.factors().iter().zip(factors) {
            coordinates[i] = value + centre;
        }
        self.hypothesis.with(coordinates)
    }

    /// Whether several joints feel it and its effort is not linear in its numbers: a tangent says little of it.
    pub fn bends(&self) -> bool {
        let hypothesis = self.hypothesis;
        let is_bent = !hypothesis.is_linear() || hypothesis.effect.bends();
        is_bent && hypothesis.only_joint().is_none()
    }

    /// Deviations of an effect's factors from their means.
    pub fn factors_of(&self, active: &Active) -> Vec<f64> {
        if let Some(curve) = &self.curve {
            return curve.factors(&active.coordinates);
        }
        let factors = self.hypothesis.factors().into_iter().zip(&self.centres);
        factors
            .map(|(i, centre)| active.coordinates[i] - centre)
            .collect()
    }

    /// Prior means of all coordinates, zero for shapes and times.
    pub fn all_centres(&self) -> Vec<f64> {
        if self.curve.is_some() {
            return self.centres.clone();
        }
        let mut all = vec![0.0; self.shape.len()];
        for (&i, centre) in self.hypothesis.factors().iter().zip(&self.centres) {
            all[i] = *centre;
        }
        all
    }

    /// Prior standard deviations of all coordinates, infinite for shapes and times.
    pub fn all_deviations(&self) -> Vec<f64> {
        if self.curve.is_some() {
            return self.deviations.clone();
        }
        let mut all = vec![f64::INFINITY; self.shape.len()];
        for (&i, deviation) in self.hypothesis.factors().iter().zip(&self.deviations) {
            all[i] = *deviation;
        }
        all
    }

    /// Whether one explanation cannot have both. Laws nest, so a place has one of all laws that contain the same simplest one; but
    /// less of the friction that the robot's file states, and another law in its place, can be true together. What is missing is
    /// not subtracted, too. A joint's effort is late in one way. A joint has one unknown law: sums of several describe anything.
    pub fn excludes(&self, other: &Self) -> bool {
        let (own, others) = (self.hypothesis, other.hypothesis);
        if own.is_of_timing() && others.is_of_timing() {
            let (a, b) = (own.only_joint(), others.only_joint());
            return a.is_none() || b.is_none() || a == b;
        }
        let nests =
            simplest(own) == simplest(others) && self.corrects_stated == other.corrects_stated;
        own.place == others.place && (nests || opposes(own, others) || opposes(others, own))
    }

    /// Indices of its columns: the offset, if it has one, and those of its factors.
    pub fn with_offset(&self) -> std::ops::Range<usize> {
        self.offset.unwrap_or(self.first)..self.columns().end
    }

    /// Indices of its factors' columns.
    pub fn columns(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.deviations.len()
    }
}

/// Whether the one is dry friction that is missing and the other dry friction that was subtracted: one effort with two names.
fn opposes(one: Hypothesis, other: Hypothesis) -> bool {
    one.effect.traits.negates_friction && *other.effect == COULOMB_FRICTION
}

/// The columns of a variant, unwhitened.
#[derive(Debug, Clone)]
pub struct Given {
    /// The variant; `offset` and `first` are filled in.
    pub variant: Variant,
    /// Effort of its shape alone.
    pub alone: Option<Column>,
    /// Effort per unit of each factor.
    pub factors: Vec<Arc<Column>>,
    /// Whether it changes no compared row, so that no search needs it.
    pub is_silent: bool,
}

impl Given {
    /// Makes it a curve, where its columns are those of the curve's values.
    pub fn shape(&mut self, curve: Curve, sizes: &[Magnitude]) {
        self.factors = curve.mixed(&self.factors);
        let free = self.factors.len();
        let usual = prior::USUAL_SHARE * sizes[curve.hypothesis.place.joint].rms;
        self.variant.deviations = vec![usual; free];
        self.variant.centres = vec![0.0; free];
        self.variant.positive = vec![false; free];
        self.variant.curve = Some(curve);
    }
}

/// The simplest law that an effect contains.
pub fn simplest(hypothesis: Hypothesis) -> &'static str {
    let effect = hypothesis.effect;
    effect
        .simpler
        .map_or(effect.name, |simpler| simpler.effect.name)
}

/// Every hypothesis at every shape of its grid, and at its most promising times. The columns are tangents at `fit`.
pub fn of_hypotheses(
    problem: &Problem,
    fit: &Fit,
    hypotheses: &[Hypothesis],
    sizes: &[Magnitude],
) -> Vec<Given> {
    let of = |hypothesis: &Hypothesis| -> Vec<Given> {
        if *hypothesis.effect == UNKNOWN {
            return of_curves(problem, fit, hypothesis.place.joint, sizes);
        }
        // Times and walls are not on a grid: the data propose them.
        let (shapes, count) = if hypothesis.effect.is_surface() {
            (wall::shapes(problem, fit, *hypothesis), 1)
        } else if hypothesis.time_kind() == TimeKind::Always {
            let grid = shapes(problem, *hypothesis);
            let count = grid.len();
            (grid, count)
        } else {
            (times::shapes(problem, fit, *hypothesis), 1)
        };
        let given = shapes
            .into_iter()
            .map(|shape| at(problem, fit, *hypothesis, shape, count, sizes));
        given.flatten().collect()
    };
    parallel::map(hypotheses, of)
        .into_iter()
        .flatten()
        .collect()
}

/// The curves that are tried at a joint.
fn of_curves(problem: &Problem, fit: &Fit, joint: usize, sizes: &[Magnitude]) -> Vec<Given> {
    let all = curves::of_joint(problem, fit, joint);
    let count = all.len();
    let of = |(curve, columns): (Curve, Vec<Arc<Column>>)| {
        let own = (None, columns);
        let mut given = given(problem, curve.hypothesis, Vec::new(), own, count, sizes);
        given.shape(curve, sizes);
        (!given.is_silent).then_some(given)
    };
    all.into_iter().filter_map(of).collect()
}

/// A hypothesis at one of the `count` shapes of its grid; `None` if it changes no compared row.
pub fn at(
    problem: &Problem,
    fit: &Fit,
    hypothesis: Hypothesis,
    shape: Vec<f64>,
    count: usize,
    sizes: &[Magnitude],
) -> Option<Given> {
    let columns = fit.columns(problem, hypothesis, &shape);
    let own = (columns.alone.clone(), columns.factors.clone());
    let given = given(problem, hypothesis, shape, own, count, sizes);
    (!given.is_silent).then_some(given)
}

/// A variant with its columns.
pub fn given(
    problem: &Problem,
    hypothesis: Hypothesis,
    shape: Vec<f64>,
    (alone, factors): (Option<Column>, Vec<Arc<Column>>),
    count: usize,
    sizes: &[Magnitude],
) -> Given {
    let share = |column: &Column| {
        let of = |joint: usize| {
            let values = column.of_joint(joint, problem.rows)?;
            let weight = &problem.weight[problem.joint_rows(joint)];
            let counted = values.iter().zip(weight).filter(|(_, w)| **w > 0.0);
            let peak = counted.fold(0.0_f64, |most, (x, _)| most.max(x.abs()));
            Some(peak / sizes[joint].peak)
        };
        (0..problem.joints).filter_map(of).fold(0.0, f64::max)
    };
    let shares: Vec<f64> = factors.iter().map(|column| share(column)).collect();
    let of_shape = alone.as_ref().map(share);
    let is_silent = shares.iter().chain(&of_shape).all(|share| *share <= SILENT);
    let positive = hypothesis
        .effect
        .coordinates
        .iter()
        .filter_map(|c| match c.kind {
            CoordinateKind::Factor { minimum, .. } => {
                Some(least(problem, hypothesis, minimum) >= 0.0)
            }
            _ => None,
        });
    let times = match hypothesis.time_kind() {
        TimeKind::Always => 0.0,
        TimeKind::Step => TIMES.ln(),
        TimeKind::EveryRecording | TimeKind::Once => 2.0 * TIMES.ln(),
    };
    let is_forced = hypothesis.is_torque_scale();
    let stated = problem.known_friction[hypothesis.place.joint].get(hypothesis.effect.name);
    let log_prior = if is_forced {
        0.0
    } else {
        hypothesis.effect.odds_nats - (count as f64).ln() - times
    };
    Given {
        variant: Variant {
            hypothesis,
            shape,
            offset: None,
            first: 0,
            centres: vec![prior::centre(problem, hypothesis); shares.len()],
            deviations: prior::deviations(
                problem,
                hypothesis,
                &shares,
                sizes[hypothesis.place.joint],
            ),
            positive: positive.collect(),
            log_prior,
            is_forced,
            corrects_stated: problem.states_friction
                && hypothesis.effect.is_plain_friction()
                && stated.is_some_and(|known| *known > 0.0),
            curve: None,
        },
        alone,
        factors,
        is_silent,
    }
}
