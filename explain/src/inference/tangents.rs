//! Effects as their tangents: the effort at an effect's own numbers, and its derivatives with respect to the factors.

use std::sync::Arc;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::jacobian::step_of;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::propose::grid::shapes;

use super::curves::Curve;
use super::prior::{self, Magnitude};
use super::variants::{Given, given, of_hypotheses};

/// The effects of `fit` as they are, and behind them every hypothesis next to it; see [`of_hypotheses`].
pub fn all(
    problem: &Problem,
    fit: &Fit,
    hypotheses: &[Hypothesis],
    sizes: &[Magnitude],
) -> Vec<Given> {
    let mut all = of_fit(problem, fit, sizes);
    all.extend(of_hypotheses(problem, fit, hypotheses, sizes));
    all
}

/// The effects of a fit as they are, one each, in their order.
pub fn of_fit(problem: &Problem, fit: &Fit, sizes: &[Magnitude]) -> Vec<Given> {
    let jacobian = fit.jacobian(problem);
    let own_efforts = fit.own_efforts(problem);
    let free = fit.parameters();
    let of = |(i, active): (usize, &Active)| {
        let own = free.iter().zip(&jacobian);
        let own = own.filter(|((of, c), _)| *of == i && fit.is_factor(i, *c));
        let factors: Vec<(f64, Arc<Column>)> = own
            .map(|((_, c), column)| {
                let centre = prior::centre(problem, active.hypothesis);
                (active.coordinates[*c] - centre, Arc::clone(column))
            })
            .collect();
        let alone = intercept(problem, own_efforts[i].clone(), &factors);
        let largest = alone
            .values
            .iter()
            .fold(0.0_f64, |most, x| most.max(x.abs()));
        let most_effort = sizes.iter().map(|size| size.rms).fold(0.0, f64::max);
        let alone = (largest > 1e-6 * most_effort).then_some(alone);
        let factors: Vec<Arc<Column>> = factors.into_iter().map(|(_, column)| column).collect();
        // At its best shape an effect is as probable beforehand as at any other of its grid.
        let count = match active.hypothesis.time_kind() {
            TimeKind::Always => shapes(problem, active.hypothesis).len(),
            _ => 1,
        };
        let mut given = given(
            problem,
            active.hypothesis,
            active.shape(),
            (alone, factors),
            count,
            sizes,
        );
        if let Some(table) = &active.curve {
            given.shape(Curve::new(table.clone(), active.hypothesis), sizes);
        }
        given
    };
    fit.actives.iter().enumerate().map(of).collect()
}

/// The intercept of a tangent: the effort `alone` of an effect, less that of its factors.
fn intercept(problem: &Problem, mut alone: Column, factors: &[(f64, Arc<Column>)]) -> Column {
    for (factor, column) in factors {
        for (k, value) in alone.values.iter_mut().enumerate() {
            let of = match (alone.joint, column.joint) {
                (Some(_), Some(_)) | (None, None) => column.values[k],
                (Some(own), None) => column.values[own * problem.rows + k],
                (None, Some(own)) if k / problem.rows == own => column.values[k % problem.rows],
                (None, Some(_)) => 0.0,
            };
            *value -= factor * of;
        }
    }
    alone
}

/// An effect that is added to a fit, as its tangent at its own numbers. Its grid has `count` shapes.
pub fn tangent(
    problem: &Problem,
    fit: &Fit,
    active: &Active,
    count: usize,
    sizes: &[Magnitude],
) -> Given {
    let hypothesis = active.hypothesis;
    let centre = prior::centre(problem, hypothesis);
    let here = fit.added(problem, active);
    let factor = |c: usize| {
        let step = step_of(problem, active, c);
        let mut there = active.clone();
        there.coordinates[c] += step;
        let mut column = fit.added(problem, &there);
        for (there, here) in column.values.iter_mut().zip(&here.values) {
            *there = (*there - here) / step;
        }
        (active.coordinates[c] - centre, Arc::new(column))
    };
    let factors: Vec<(f64, Arc<Column>)> = hypothesis.factors().into_iter().map(factor).collect();
    let alone = intercept(problem, here, &factors);
    let factors = factors.into_iter().map(|(_, column)| column).collect();
    let own = (Some(alone), factors);
    given(problem, hypothesis, active.shape(), own, count, sizes)
}

/// The measured effort, less what the twin without the effects of `fit` explains, as far as that is the sum of the
/// effects' own efforts.
pub fn measured(problem: &Problem, fit: &Fit) -> Column {
    let mut values = fit.residual.clone();
    for own in fit.own_efforts(problem) {
        let first = own.joint.map_or(0, |joint| joint * problem.rows);
        for (value, add) in values[first..].iter_mut().zip(&own.values) {
            *value += add;
        }
    }
    Column {
        joint: None,
        values,
    }
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::Inertia;
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::fixture::{at_joint, model, problem, problem_with, recording};
    use crate::physics::active::Whereabouts;

    /// Guards against an inertia that did not follow a moved centre of mass, so that an unknown body fitted better.
    #[test]
    fn a_moved_centre_of_mass_moves_the_inertia_by_the_parallel_axis_theorem() {
        let plain = model();
        let link = plain.link_index("lower").unwrap();
        let own = plain.links()[link].inertia;
        let [x, y, z] = own.com_m();
        let moved = Inertia::new(
            own.mass_kg(),
            [x + 0.15, y, z],
            own.inertia_about_com_kgm2(),
        );
        let mut real = plain.clone();
        real.attach(link, moved - own);
        let recordings = [1, 2].map(|seed| recording(&real, seed, |_, _, _| {}));
        let problem = problem(&plain, &recordings);
        let hypothesis = Hypothesis {
            effect: effect("link_com").unwrap(),
            place: Whereabouts {
                link,
                ..Whereabouts::default()
            },
        };
        let rms = |fit: &Fit| (fit.squares[1] / fit.count[1]).sqrt();
        let exact = hypothesis.with(vec![0.15, 0.0, 0.0]);
        let fit = Fit::new(&problem, vec![exact.clone()]);
        let least = rms(&fit);
        assert!(least < 0.01, "{least}");
        // The tangent at zero leaves 2 kg times the square of 0.15 m.
        let one = Magnitude {
            rms: 1.0,
            peak: 1.0,
        };
        let bare = Fit::new(&problem, Vec::new());
        let explained = |given: &Given, factor: f64| -> f64 {
            let alone = given.alone.as_ref().unwrap();
            let rows = alone.values.iter().zip(&given.factors[0].values);
            let left = bare
                .residual
                .iter()
                .zip(rows)
                .map(|(r, (a, x))| (r - a - factor * x).powi(2));
            (left.skip(problem.rows).sum::<f64>() / problem.rows as f64).sqrt()
        };
        let [zero, there] = [hypothesis.with(vec![0.0; 3]), exact]
            .map(|active| tangent(&problem, &bare, &active, 1, &[one, one]));
        assert!(explained(&there, 0.15) < 0.02 && explained(&zero, 0.15) > 0.04);
    }

    /// Guards the indices of the effects of a fit: a delay that was refined to zero changes no row.
    #[test]
    fn an_effect_that_changes_nothing_keeps_its_place() {
        let problem = problem_with(4, |_, _, _| {});
        let actives = vec![
            at_joint("torque_delay", 0).with(vec![0.0]),
            at_joint("viscous_friction", 1).with(vec![0.5]),
        ];
        let fit = Fit::new(&problem, actives);
        let one = Magnitude {
            rms: 1.0,
            peak: 1.0,
        };
        let given = of_fit(&problem, &fit, &[one, one]);
        let silent: Vec<bool> = given.iter().map(|given| given.is_silent).collect();
        assert_eq!(silent, [true, false]);
    }
}
