//! Step 6, inference: one model of the data, one number that compares explanations, one search, one posterior.
//!
//! In: the data of step 2, the hypotheses, and where step 5 begins. Out: an [`Inferred`], the most probable explanation.
//!
//! The effort of a joint is that of the nominal twin, plus the effects of an explanation, plus nuisances that every real
//! arm has ([`nuisance`]), plus white and slow noise ([`noise`]). [`objective`] is the marginal likelihood of an
//! explanation with its prior, in which the effects are tangents at the last explanation ([`variants`]). [`search`] looks
//! for the best explanation, [`refine`] finds its most probable numbers, and the next round begins there.

mod around;
mod bounded;
mod curves;
mod estimated;
mod laws;
mod left_out;
mod margins;
mod nested;
mod noise;
mod normal;
mod nuisance;
mod objective;
mod predictions;
mod prior;
mod refine;
pub mod remainder;
mod rows;
mod search;
mod sharpen;
mod space;
mod state;
mod step;
mod tangents;
mod temper;
mod variants;
mod visited;

use nalgebra::DMatrix;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};

pub use estimated::{Estimated, estimated};
use margins::margins;
pub use margins::{AS_LIKELY, Alternative};
use nuisance::{Nuisance, Size};
use objective::{Objective, Set};
use predictions::Predictions;
use space::Space;
use state::{State, disfavour};
use step::{Step, Taken};
use variants::{Given, Variant};
use visited::Visited;

/// Most rounds of linearising, estimating the noise and searching. Resolution: bounds the computing time.
const ROUNDS: usize = 9;
/// Scales of the errors of bodies that the search begins with, in usual errors. Resolution: of the two, the estimates that
/// follow find any other.
const STARTS: [f64; 2] = [1.0, 0.1];

/// An explanation and what is known of it.
#[derive(Debug)]
pub struct Inferred {
    /// The effects with their most probable numbers.
    pub fit: Fit,
    /// Covariance of all coordinates.
    pub covariance: DMatrix<f64>,
    /// By effect, how much the explanation loses without it, whatever takes its place \[nats\].
    pub margins: Vec<f64>,
    /// By effect, other effects that would take its place, best first.
    pub alternatives: Vec<Vec<Alternative>>,
    /// Effects with one factor that were not found, and the smallest factor that would have been.
    pub smallest: Vec<(Hypothesis, f64)>,
    /// Mean changes of the links' inertial parameters, as effects.
    pub bodies: Vec<Active>,
    /// Features of the motion that predict what is left.
    pub remaining: Vec<remainder::Predicted>,
    /// Joints whose effort in pieces of recordings that are left out in turn is predicted better without the lasting effects.
    pub unpredictive: Vec<usize>,
}

/// Searches for the effects of a problem, from the effects `start` on. `bodies` says whether the robot's bodies are known.
pub fn infer(
    problem: &Problem,
    hypotheses: &[Hypothesis],
    start: Vec<Active>,
    bodies: bool,
    say: &dyn Fn(&str),
) -> Inferred {
    let mut state = State::new(problem, bodies);
    let mut fit = begun(
        problem,
        hypotheses,
        &mut state,
        Fit::new(problem, start),
        say,
    );
    let mut round = 0;
    let mut visited = Visited::default();
    loop {
        round += 1;
        say("comparing explanations");
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(problem, &fit, &sizes, bodies, state.scales);
        let given = tangents::all(problem, &fit, hypotheses, &state.efforts);
        let measured = tangents::measured(problem, &fit);
        state.estimate_noise(&fit, &nuisances, &given, &measured, false);
        let space = state.space(&nuisances);
        let (objective, mut taken, is_partial) = searched(problem, &state, &space, &fit, given);
        let own: Set = (0..fit.actives.len()).collect();
        let mut gained = objective.score(&taken.set) - objective.score(&own);
        visited.add(effects(&fit), gained);
        if visited.ends_with_least_gain(&effects(&taken.solution.fit)) {
            let here = (&objective, &measured);
            taken = step(problem, &state, &space, here, &own).taken(&own, &own);
            gained = 0.0;
        }
        let is_partial = is_partial || taken.is_shortened && gained > 0.0;
        let is_settled = round > 1 && !is_partial && gained < AS_LIKELY;
        let solution = taken.solution;
        if is_settled || round == ROUNDS {
            let all = effects(&solution.fit);
            let (margins, alternatives) = margins(&objective, &taken.set, &all);
            let predictions = Predictions::of(problem, &space, &solution.fit, &state.efforts);
            let residuals = predictions.as_ref().map(Predictions::residuals);
            let residuals = residuals.unwrap_or_default();
            let features = remainder::features(problem, &solution.fit);
            return Inferred {
                covariance: solution.covariance,
                margins,
                alternatives,
                smallest: around::smallest(&objective, &taken.set),
                bodies: nuisance::mean_bodies(&nuisances, solution.nuisances.as_slice()),
                unpredictive: predictions
                    .map_or_else(Vec::new, |predictions| predictions.unpredictive()),
                remaining: remainder::predicted(&space, &residuals, &features),
                fit: solution.fit,
            };
        }
        fit = solution.fit;
        follow(
            problem,
            &mut state,
            &space,
            &fit,
            is_partial,
            (&sizes, &nuisances),
        );
    }
}

/// The effects of a fit, without their numbers.
fn effects(fit: &Fit) -> Vec<Hypothesis> {
    fit.actives.iter().map(|active| active.hypothesis).collect()
}

/// The first explanation, next to bodies that are as the URDF says and next to bodies with usual errors: the more probable of
/// both. Bodies with usual errors would hide what is small; where they are off, next to exact ones they look like effects.
fn begun(
    problem: &Problem,
    hypotheses: &[Hypothesis],
    state: &mut State<'_>,
    fit: Fit,
    say: &dyn Fn(&str),
) -> Fit {
    say("comparing explanations");
    let sizes = state.sizes(&fit);
    let measured = tangents::measured(problem, &fit);
    let nuisances = nuisance::of(problem, &fit, &sizes, state.bodies, state.scales);
    let given = tangents::all(problem, &fit, hypotheses, &state.efforts);
    state.estimate_noise(&fit, &nuisances, &given, &measured, true);
    state.estimate_tempers(&fit, &nuisances, &linear_columns(&given), &measured);
    let starts: &[f64] = if state.bodies { &STARTS } else { &STARTS[..1] };
    let tried = starts.iter().map(|&scale| {
        state.scales[0] = scale;
        let nuisances = nuisance::of(problem, &fit, &sizes, state.bodies, state.scales);
        let space = state.space(&nuisances);
        let (_, taken, is_partial) = searched(problem, state, &space, &fit, given.clone());
        let is_partial = is_partial || taken.is_shortened;
        let value = taken.value - disfavour(state.scales);
        (
            value,
            scale,
            (taken.solution.fit, is_partial),
            space,
            nuisances,
        )
    });
    let best = tried.max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, scale, (found, is_partial), space, nuisances)) = best else {
        return fit;
    };
    state.scales[0] = scale;
    follow(
        problem,
        state,
        &space,
        &found,
        is_partial,
        (&sizes, &nuisances),
    );
    found
}

/// Searches from an explanation and refines what is found: the objective, what is reached, and whether a part of it was left for
/// later.
fn searched<'s>(
    problem: &Problem,
    state: &State<'_>,
    space: &'s Space,
    fit: &Fit,
    given: Vec<Given>,
) -> (Objective<'s>, Taken, bool) {
    let measured = tangents::measured(problem, fit);
    let mut objective = Objective::new(space, &measured, given);
    let own: Set = (0..fit.actives.len()).collect();
    let sharper = sharpen::sharpened(problem, fit, &objective, &own, &state.efforts);
    objective.extend(sharper);
    let found = search::search(&objective, own.clone());
    let (found, is_partial) = first_that_bends(&objective, &own, found);
    let found = nested::simplest(&objective, found);
    let here = (&objective, &measured);
    let taken = step(problem, state, space, here, &own).taken(&own, &found);
    (objective, taken, is_partial)
}

/// A step that begins at the set `own` of an objective.
fn step<'a>(
    problem: &'a Problem,
    state: &'a State<'_>,
    space: &'a Space,
    (objective, measured): (&'a Objective<'_>, &Column),
    own: &Set,
) -> Step<'a> {
    Step {
        problem,
        space,
        state,
        objective,
        here: space.evidence(measured) + objective.score(own),
    }
}

/// Estimates what accompanies an explanation anew. Where a part of what was found is left for later (`is_partial`), no row
/// is in the tail yet: that part may explain it.
fn follow(
    problem: &Problem,
    state: &mut State<'_>,
    space: &Space,
    fit: &Fit,
    is_partial: bool,
    (sizes, nuisances): (&[Size], &[Nuisance]),
) {
    state.estimate_scales(fit, sizes);
    if !is_partial {
        state.mark_tail(space, fit);
    }
    let (columns, measured) = predictions::tangents(problem, fit, &state.efforts);
    state.estimate_tempers(fit, nuisances, &columns, &measured);
}

/// An explanation as it is, with what is known of it: its numbers stay, and nothing is added.
pub fn around(problem: &Problem, hypotheses: &[Hypothesis], fit: Fit, bodies: bool) -> Inferred {
    let mut state = State::new(problem, bodies);
    let sizes = state.sizes(&fit);
    let nuisances = nuisance::of(problem, &fit, &sizes, bodies, state.scales);
    let given = tangents::all(problem, &fit, hypotheses, &state.efforts);
    let measured = tangents::measured(problem, &fit);
    state.estimate_noise(&fit, &nuisances, &given, &measured, false);
    let space = state.space(&nuisances);
    let objective = Objective::new(&space, &measured, given);
    let own: Set = (0..fit.actives.len()).collect();
    let (margins, alternatives) = margins(&objective, &own, &effects(&fit));
    let variants = objective.variants[..own.len()].iter();
    let deviations: Vec<f64> = variants.flat_map(Variant::all_deviations).collect();
    Inferred {
        covariance: refine::covariance(problem, &space, &fit, &deviations),
        margins,
        alternatives,
        smallest: around::smallest(&objective, &own),
        bodies: Vec::new(),
        remaining: Vec::new(),
        unpredictive: Vec::new(),
        fit,
    }
}

/// The set with only one new effect whose effort is not linear in its numbers and that several joints feel, and whether any
/// was left for later: such effects imitate each other until the numbers of one are refined.
fn first_that_bends(objective: &Objective<'_>, own: &Set, found: Set) -> (Set, bool) {
    let bends = |v: &usize| objective.variants[*v].bends();
    let new: Vec<usize> = found
        .iter()
        .copied()
        .filter(|v| !own.contains(v) && bends(v))
        .collect();
    if new.len() < 2 {
        return (found, false);
    }
    let score_without = |v: usize| {
        let less: Set = found.iter().copied().filter(|w| *w != v).collect();
        objective.score(&less)
    };
    let needed = new
        .iter()
        .copied()
        .min_by(|&a, &b| score_without(a).total_cmp(&score_without(b)));
    let kept = |v: &usize| !new.contains(v) || Some(*v) == needed;
    (found.into_iter().filter(kept).collect(), true)
}

/// The columns of all effects that are linear in their numbers, scaled by their prior standard deviations.
fn linear_columns(given: &[Given]) -> Vec<Column> {
    let is_linear = |v: &Variant| v.hypothesis.is_linear() && v.curve.is_none();
    let of = |given: &Given| -> Vec<Column> {
        let pairs = given.factors.iter().zip(&given.variant.deviations);
        pairs.map(|(c, deviation)| c.times(*deviation)).collect()
    };
    let linear = given.iter().filter(|given| is_linear(&given.variant));
    linear.flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::fixture::problem_with;
    use crate::physics::library;

    fn effects(
        add: impl FnMut(&[f64], &[f64], &mut [f64]),
    ) -> Vec<(&'static str, usize, Vec<f64>)> {
        let problem = problem_with(3, add);
        let mut hypotheses = library::hypotheses(&problem.model, true, &BTreeSet::new());
        hypotheses.extend(library::unnamed(&problem.model, true, &BTreeSet::new()));
        let inferred = infer(&problem, &hypotheses, Vec::new(), true, &|_| {});
        assert!(inferred.remaining.is_empty(), "{:?}", inferred.remaining);
        let actives = inferred.fit.actives.iter();
        let of = |a: &Active| {
            (
                a.hypothesis.effect.name,
                a.hypothesis.place.joint,
                a.parameters(),
            )
        };
        actives.map(of).collect()
    }

    #[test]
    fn an_arm_as_its_urdf_says_has_no_effects() {
        assert_eq!(effects(|_, _, _| {}), []);
    }

    #[test]
    fn friction_of_two_kinds_is_found_with_its_numbers() {
        let found = effects(|_, qd, effort| {
            effort[0] += 1.2 * qd[0];
            effort[1] += 0.8 * qd[1].signum();
        });
        let at = |name: &str| {
            let one = found.iter().find(|(effect, _, _)| *effect == name);
            one.map(|(_, joint, parameters)| (*joint, parameters[0]))
        };
        let near = |found: Option<(usize, f64)>, joint: usize, value: f64| {
            found.is_some_and(|(at, x)| at == joint && (x / value - 1.0).abs() < 0.1)
        };
        assert!(near(at("viscous_friction"), 0, 1.2), "{found:?}");
        assert!(near(at("coulomb_friction"), 1, 0.8), "{found:?}");
        assert_eq!(found.len(), 2, "{found:?}");
    }

    /// Masses are a rival of a gain so far from one.
    #[test]
    fn half_a_gain_is_found_as_a_gain() {
        let found = effects(|_, _, effort| effort[1] *= 0.55);
        let [("torque_gain", 1, gain)] = &found[..] else {
            panic!("{found:?}")
        };
        assert!((gain[0] - 0.55).abs() < 0.02, "{gain:?}");
    }
}
