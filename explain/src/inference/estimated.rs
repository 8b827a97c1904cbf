//! The numbers of effects that are given, found or not.

use nalgebra::DMatrix;

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};

use super::objective::{Objective, Set};
use super::state::State;
use super::step::refined;
use super::{nuisance, sharpen, tangents};

/// Effects with their most probable numbers.
pub struct Estimated {
    /// The effects.
    pub fit: Fit,
    /// Covariance of all coordinates.
    pub covariance: DMatrix<f64>,
}

/// The most probable numbers of the effects `given`, and of those `optional` effects that make the recordings more likely.
/// `bodies` says whether the robot's bodies are known. The numbers are those next to the URDF's bodies and exact laws: what
/// these are off by is the same every night, so it does not hide a change.
pub fn estimated(
    problem: &Problem,
    given: Vec<Active>,
    optional: &[Hypothesis],
    bodies: bool,
) -> Estimated {
    let mut state = State::new(problem, bodies);
    state.scales = [0.0; 2];
    let mut fit = Fit::new(problem, given);
    let mut round = 0;
    loop {
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(problem, &fit, &sizes, bodies, state.scales);
        let all = tangents::all(problem, &fit, optional, &state.efforts);
        let measured = tangents::measured(problem, &fit);
        state.estimate_noise(&fit, &nuisances, &all, &measured, round == 0);
        let space = state.space(&nuisances);
        let mut objective = Objective::new(&space, &measured, all);
        let own: Set = (0..fit.actives.len()).collect();
        let sharper = sharpen::sharpened(problem, &fit, &objective, &own, &state.efforts);
        objective.extend(sharper);
        let others = (own.len()..objective.variants.len()).filter(|&v| objective.fits(&own, v));
        let sets = others.map(|v| own.iter().copied().chain([v]).collect::<Set>());
        let best = sets.max_by(|a, b| objective.score(a).total_cmp(&objective.score(b)));
        let better = best.filter(|set| objective.score(set) > objective.score(&own));
        // The first round's noise was estimated before the numbers were.
        let is_last = better.is_none() && round > 0 || round > optional.len();
        let solution = refined(problem, &space, &objective, &better.unwrap_or(own));
        if is_last {
            return Estimated {
                fit: solution.fit,
                covariance: solution.covariance,
            };
        }
        fit = solution.fit;
        round += 1;
    }
}
