//! A step from one explanation to the next.
//!
//! The objective is that of tangents, so the gain that it predicts is compared with the gain after refinement. Where that is
//! less than half of it, fewer effects are added (a trust region; Nocedal and Wright, *Numerical Optimization*, 2006,
//! chapter 4).

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;

use super::objective::{Objective, Set};
use super::refine::{self, Solution};
use super::search;
use super::space::Space;
use super::state::State;
use super::tangents;
use super::variants::Variant;

/// Smallest share of a predicted gain that a step must have. Chosen: a half, between the quarter and the three quarters of
/// Nocedal and Wright, algorithm 4.1.
const TRUSTED: f64 = 0.5;

/// A step that begins at an explanation.
pub struct Step<'a> {
    /// The recordings.
    pub problem: &'a Problem,
    /// Noise and nuisances.
    pub space: &'a Space,
    /// Estimates that accompany the explanation.
    pub state: &'a State<'a>,
    /// The objective, whose effects are tangents.
    pub objective: &'a Objective<'a>,
    /// Value of the explanation that the step begins at \[nats\].
    pub here: f64,
}

/// Result of a step.
pub struct Taken {
    /// The set.
    pub set: Set,
    /// Its refined numbers.
    pub solution: Solution,
    /// Its value \[nats\].
    pub value: f64,
    /// Whether it lacks some of what was found.
    pub is_shortened: bool,
}

impl Step<'_> {
    /// Steps from a set towards the set that was found.
    pub fn taken(&self, own: &Set, found: &Set) -> Taken {
        let score = |set: &Set| self.objective.score(set);
        let mut added: Vec<(f64, usize)> = (found.iter().filter(|v| !own.contains(v)))
            .map(|&v| (score(&search::without(found, v)), v))
            .collect();
        added.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut set, mut first, mut count) = (found.clone(), 0, added.len());
        loop {
            let (solution, value) = self.refined(&set);
            let predicted = score(&set) - score(own);
            let gained = value - self.here;
            let is_shortened = first > 0 || count < added.len();
            if count == 0 || gained >= TRUSTED * predicted {
                return Taken {
                    set,
                    solution,
                    value,
                    is_shortened,
                };
            }
            if count > 1 {
                count /= 2;
            } else {
                first += 1;
                count = usize::from(first < added.len());
            }
            let newcomers: Set = (added[first..].iter().take(count))
                .map(|(_, v)| *v)
                .collect();
            set = self.joined(own, found, newcomers);
        }
    }

    /// A set with some of the newcomers of `found`, without what they exclude.
    fn joined(&self, own: &Set, found: &Set, newcomers: Set) -> Set {
        let variant = |v: usize| &self.objective.variants[v];
        let stays = |v: &usize| {
            found.contains(v) || !newcomers.iter().any(|&w| variant(w).excludes(variant(*v)))
        };
        let mut set: Set = own.iter().copied().filter(stays).collect();
        set.extend(newcomers);
        set.sort_unstable();
        set
    }

    /// The refined numbers of a set, without the effects that they leave nothing to do, and its value.
    fn refined(&self, set: &Set) -> (Solution, f64) {
        let (problem, space) = (self.problem, self.space);
        let mut solution = refined(problem, space, self.objective, set);
        loop {
            let given = tangents::of_fit(problem, &solution.fit, &self.state.efforts);
            let measured = tangents::measured(problem, &solution.fit);
            let own = Objective::new(space, &measured, given);
            let all: Set = (0..own.variants.len()).collect();
            let kept = search::without_idle(&own, all.clone());
            if kept == all {
                return (solution, space.evidence(&measured) + own.score(&all));
            }
            solution = refined(problem, space, &own, &kept);
        }
    }
}

/// The numbers of a set, refined.
pub fn refined(problem: &Problem, space: &Space, objective: &Objective<'_>, set: &Set) -> Solution {
    let factors = objective.factors(set);
    let own = set.iter().map(|&v| &objective.variants[v]);
    let actives = own
        .clone()
        .zip(&factors)
        .map(|(variant, factors)| variant.with(factors));
    let fit = Fit::new(problem, actives.collect());
    let deviations: Vec<f64> = own.clone().flat_map(Variant::all_deviations).collect();
    let centres: Vec<f64> = own.flat_map(Variant::all_centres).collect();
    refine::refine(problem, space, fit, (&centres, &deviations))
}
