//! Noise, heavy tails and the scales of nuisances, estimated along with an explanation.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{COULOMB_FRICTION, Effect, VISCOUS_FRICTION, sign};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::solved;

use super::laws;
use super::left_out::LeftOut;
use super::noise::{self, Noise, Whitener};
use super::nuisance::{self, Nuisance, Size};
use super::objective::{Objective, Set};
use super::prior::Magnitude;
use super::remainder;
use super::rows::{Rows, pieces};
use super::space::Space;
use super::tangents;
use super::temper;
use super::variants::Given;

/// Factor between two scales of the errors of bodies or laws that are compared. Resolution: of an estimate that some ten
/// bodies allow.
const SCALE_STEP: f64 = 1.8;
/// Least and largest scale of the errors of bodies, and of laws, in usual errors. Chosen: a body that is off by more than
/// twice the usual error is a finding, and no law is truer than one percent of a joint's effort.
const SCALES: [[f64; 2]; 2] = [[0.1, 1.8], [0.55, 1.0]];
/// Weight of the usual errors against an estimate: twice the squared logarithm of the scale is taken off \[nats\].
/// Chosen: a normal prior on the logarithm with a standard deviation of one half.
const SCALE_WEIGHT: f64 = 2.0;
/// Largest weight of an innovation, in standard deviations. Statistical: a normal variable exceeds it once in 370 rows.
const TAIL: f64 = 3.0;
/// Fewer rows say nothing of a joint's noise. Resolution: of three numbers.
const LEAST_ROWS: usize = 20;

/// Estimates that accompany an explanation.
pub struct State<'a> {
    problem: &'a Problem,
    /// Whether the robot's bodies are known.
    pub bodies: bool,
    rows: Vec<Rows>,
    /// Each joint's measured effort.
    pub efforts: Vec<Magnitude>,
    noises: Vec<Noise>,
    /// Additional variance of each joint's rows: heavy tails.
    extra: Vec<Vec<f64>>,
    /// Weight of each joint's likelihood.
    pub(super) tempers: Vec<f64>,
    /// Scales of the errors of bodies and of laws, in usual errors.
    pub scales: [f64; 2],
}

impl<'a> State<'a> {
    pub fn new(problem: &'a Problem, bodies: bool) -> Self {
        let rows: Vec<Rows> = (0..problem.joints).map(|j| Rows::of(problem, j)).collect();
        let of = |(joint, rows): (usize, &Rows)| {
            let values = rows.pick(&problem.measured[problem.joint_rows(joint)]);
            let squares: f64 = values.iter().map(|x| x * x).sum();
            let peak = values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            Magnitude {
                rms: (squares / values.len().max(1) as f64).sqrt().max(1e-9),
                peak: peak.max(1e-9),
            }
        };
        let efforts: Vec<Magnitude> = rows.iter().enumerate().map(of).collect();
        Self {
            problem,
            bodies,
            noises: efforts
                .iter()
                .map(|effort| Noise::start(effort.rms))
                .collect(),
            extra: rows.iter().map(|rows| vec![0.0; rows.len()]).collect(),
            scales: [1.0, 1.0],
            tempers: vec![1.0; problem.joints],
            rows,
            efforts,
        }
    }

    /// The space with these nuisances.
    pub fn space(&self, nuisances: &[Nuisance]) -> Space {
        let of = |joint: usize| {
            let filter = Whitener::new(&self.rows[joint], &self.noises[joint], &self.extra[joint]);
            filter.tempered(self.tempers[joint])
        };
        let filters = (0..self.problem.joints).map(of).collect();
        let columns: Vec<&Column> = nuisances.iter().map(|n| &n.column).collect();
        Space::new(self.problem, self.rows.clone(), filters, &columns)
    }

    /// Estimates the noise of each joint next to the nuisances and the effects of `fit`; at first, next to every effect that is
    /// linear in its numbers, with slow noise no larger than the white noise, so that it cannot hide what is searched for.
    pub fn estimate_noise(
        &mut self,
        fit: &Fit,
        nuisances: &[Nuisance],
        given: &[Given],
        measured: &Column,
        is_first: bool,
    ) {
        let problem = self.problem;
        for joint in 0..problem.joints {
            let rows = &self.rows[joint];
            if rows.len() < LEAST_ROWS {
                continue;
            }
            let own = |column: &Column| column.of_joint(joint, problem.rows).map(|x| rows.pick(x));
            let mut columns: Vec<Vec<f64>> =
                nuisances.iter().filter_map(|n| own(&n.column)).collect();
            let (of_fit, others) = given.split_at(fit.actives.len());
            let is_linear = |given: &&Given| {
                given.variant.hypothesis.is_linear() && given.variant.curve.is_none()
            };
            let others = others.iter().filter(|given| is_first && is_linear(given));
            for given in of_fit.iter().chain(others) {
                for (column, deviation) in given.factors.iter().zip(&given.variant.deviations) {
                    let scaled = own(column).map(|x| x.iter().map(|x| x * deviation).collect());
                    columns.extend(scaled);
                }
            }
            let matrix = DMatrix::from_fn(rows.len(), columns.len(), |k, c| columns[c][k]);
            let white = problem.white_noise[joint];
            let most_slow = if is_first { white } else { f64::INFINITY };
            if let Some(mut y) = own(measured) {
                for alone in of_fit.iter().filter_map(|given| own(given.alone.as_ref()?)) {
                    y.iter_mut().zip(alone).for_each(|(y, alone)| *y -= alone);
                }
                let data = noise::Data {
                    rows,
                    y: &y,
                    columns: &matrix,
                    extra: &self.extra[joint],
                };
                let bounds = (white, most_slow);
                self.noises[joint] =
                    noise::estimate(&data, self.efforts[joint].rms, self.noises[joint], bounds);
            }
        }
    }

    /// Estimates how far bodies and laws are off (empirical Bayes), next to the effects of a fit.
    pub fn estimate_scales(&mut self, fit: &Fit, sizes: &[Size]) {
        let problem = self.problem;
        let measured = tangents::measured(problem, fit);
        let value = |state: &Self, scales: [f64; 2]| {
            let nuisances = nuisance::of(problem, fit, sizes, state.bodies, scales);
            let space = state.space(&nuisances);
            let given = tangents::of_fit(problem, fit, &state.efforts);
            let own = Objective::new(&space, &measured, given);
            let all: Set = (0..own.variants.len()).collect();
            space.evidence(&measured) + own.score(&all) - disfavour(scales)
        };
        for which in (0..2).filter(|which| *which == 1 || self.bodies) {
            let [least, largest] = SCALES[which];
            let mut best = value(self, self.scales);
            for factor in [SCALE_STEP, 1.0 / SCALE_STEP] {
                loop {
                    let mut scales = self.scales;
                    scales[which] = (factor * scales[which]).clamp(least, largest);
                    let next = value(self, scales);
                    if next <= best {
                        break;
                    }
                    (best, self.scales) = (next, scales);
                }
            }
        }
    }

    /// Estimates the weight of each joint's likelihood, next to nuisances and `columns` at their prior standard deviations.
    pub fn estimate_tempers(
        &mut self,
        fit: &Fit,
        nuisances: &[Nuisance],
        columns: &[Column],
        measured: &Column,
    ) {
        let pieces = pieces(self.problem);
        let space = self.space(nuisances);
        let features = remainder::features(self.problem, fit);
        if let Some(left_out) = LeftOut::new(&space, columns, measured, pieces) {
            self.tempers = temper::tempers(&space, &left_out, &features, pieces, &self.tempers);
        }
    }

    /// Gives rows far outside the noise the variance with which they are at its tail.
    pub fn mark_tail(&mut self, space: &Space, fit: &Fit) {
        let residual = Column {
            joint: None,
            values: fit.residual.clone(),
        };
        let all = space.innovations(&residual).into_iter().enumerate();
        for (joint, innovations) in all {
            let white = self.noises[joint].white.powi(2);
            let weight = self.tempers[joint];
            for (extra, z) in self.extra[joint].iter_mut().zip(innovations) {
                // The earlier estimate is replaced, so that a row gets its weight back once it is explained.
                let ratio = (z / TAIL).powi(2) / weight * (white + *extra) / white;
                *extra = white * (ratio - 1.0).max(0.0);
            }
        }
    }

    /// The magnitudes that nuisances are shares of.
    pub fn sizes(&self, fit: &Fit) -> Vec<Size> {
        let of = |joint: usize| Size {
            effort: self.efforts[joint].rms,
            friction: friction_rms(self.problem, fit, &self.rows[joint], joint),
        };
        (0..self.problem.joints).map(of).collect()
    }
}

/// Logarithm of the prior of usual errors over that of `scales` \[nats\].
pub fn disfavour(scales: [f64; 2]) -> f64 {
    scales.iter().map(|s| SCALE_WEIGHT * s.ln().powi(2)).sum()
}

/// Root mean square of the friction in a rough fit of one joint: Coulomb and viscous friction, inertia, load and an offset by
/// least squares.
fn friction_rms(problem: &Problem, fit: &Fit, rows: &Rows, joint: usize) -> f64 {
    let count = rows.len();
    if count < LEAST_ROWS {
        return 0.0;
    }
    let n = problem.joints;
    let track = |r: usize| &problem.tracks[r].track;
    let load = fit.load(problem);
    let speed = |r: usize, k: usize| track(r).velocity[k * n + joint];
    let columns = [
        laws::column_of(problem, joint, |r, k| sign(speed(r, k))),
        laws::column_of(problem, joint, speed),
        laws::column_of(problem, joint, |r, k| track(r).acceleration[k * n + joint]),
        laws::column_of(problem, joint, |r, k| load[r][k * n + joint]),
    ]
    .map(|column| rows.pick(&column.values));
    let matrix = DMatrix::from_fn(count, 5, |k, c| {
        columns.get(c).map_or(1.0, |column| column[k])
    });
    // Another simulation's effort has friction, too: what is left of it is a share of all friction.
    let y = if problem.is_foreign {
        rows.pick(&problem.measured[problem.joint_rows(joint)])
    } else {
        // The twin that the explanation starts from may have most of it.
        let known = |effect: &Effect| {
            let known = problem.known_friction[joint].get(effect.name);
            known.copied().unwrap_or(0.0)
        };
        let known = [known(&COULOMB_FRICTION), known(&VISCOUS_FRICTION)];
        let left = rows.pick(&tangents::measured(problem, fit).values[problem.joint_rows(joint)]);
        let stated = columns[0].iter().zip(&columns[1]);
        let stated = stated.map(|(sign, speed)| known[0] * sign + known[1] * speed);
        left.iter()
            .zip(stated)
            .map(|(left, stated)| left + stated)
            .collect()
    };
    let y = DVector::from_vec(y);
    let normal = matrix.tr_mul(&matrix);
    let Some(x) = solved(&normal, &matrix.tr_mul(&y), &[true; 5], 1e-6) else {
        return 0.0;
    };
    let friction = (0..count).map(|k| (x[0] * columns[0][k] + x[1] * columns[1][k]).powi(2));
    (friction.sum::<f64>() / count as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::fixture::{model, problem, recording};
    use crate::inference::nuisance;
    use crate::physics::active::{Hypothesis, Whereabouts};

    /// A base upside down has hardly a tangent, so its effort is that of its shape.
    #[test]
    fn the_effort_of_a_shape_is_no_noise() {
        let plain = model();
        let mut real = plain.clone();
        real.set_gravity(plain.gravity().map(|g| -g));
        let recordings = [1, 2, 3].map(|seed| recording(&real, seed, |_, _, _| {}));
        let problem = problem(&plain, &recordings);
        let tilt = Hypothesis {
            effect: effect("base_tilt").unwrap(),
            place: Whereabouts::default(),
        };
        let fit = Fit::new(&problem, vec![tilt.with(vec![PI, 0.0])]);
        let mut state = State::new(&problem, true);
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(&problem, &fit, &sizes, true, state.scales);
        let given = tangents::of_fit(&problem, &fit, &state.efforts);
        let measured = tangents::measured(&problem, &fit);
        state.estimate_noise(&fit, &nuisances, &given, &measured, false);
        for (noise, effort) in state.noises.iter().zip(&state.efforts) {
            assert!(noise.slow < 0.05 * effort.rms, "{noise:?}");
        }
    }
}
