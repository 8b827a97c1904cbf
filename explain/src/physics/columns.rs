//! Regressor columns of a hypothesis in addition to other effects, one per factor.

use std::sync::Arc;

use tauscope_dynamics::terms::Layer;

use crate::data::column::{Column, Columns};
use crate::data::efforts::{Efforts, TrackEfforts, scale};
use crate::data::memo::MOST_ROWS;
use crate::data::problem::Problem;
use crate::physics::active::{Active, Hypothesis};
use crate::physics::efforts::recorded_on_top;
use crate::physics::parts::Parts;
use crate::physics::shaped_bodies::{bodies_of, in_time, steps};
use crate::physics::unit_columns::{computed, units};

/// The columns of a hypothesis at some shape, in addition to the effects `actives` with their `parts`.
pub fn columns(
    problem: &Problem,
    (actives, parts): (&[Active], &Parts),
    hypothesis: Hypothesis,
    shape: &[f64],
) -> Arc<Columns> {
    let gains = &parts.gains;
    let body = hypothesis.effect.layer == Layer::Body;
    let plain = parts.is_plain(&hypothesis);
    if hypothesis.needs_load() && plain {
        let efforts = Efforts::of_bodies(parts.load(problem, actives));
        return Arc::new(computed(problem, &[], &efforts, hypothesis, shape, gains));
    }
    if !plain && body && !in_time(hypothesis, shape) && problem.rows <= MOST_ROWS {
        return Arc::new(recorded(problem, (actives, parts), hypothesis, shape));
    }
    if !plain {
        let efforts = parts.efforts(problem, actives);
        return Arc::new(computed(
            problem, actives, efforts, hypothesis, shape, gains,
        ));
    }
    let units = units(problem, hypothesis, shape);
    if !body || gains.iter().all(|gain| (gain - 1.0).abs() <= 0.0) {
        return units;
    }
    let scale = |column: &Column| {
        let mut column = column.clone();
        for (k, value) in column.values.iter_mut().enumerate() {
            *value *= gains[column.joint.unwrap_or(k / problem.rows)];
        }
        column
    };
    Arc::new(Columns {
        alone: units.alone.as_ref().map(scale),
        factors: units.factors.iter().map(|c| Arc::new(scale(c))).collect(),
    })
}

/// The columns of an effect on bodies where effects of the recording transform some joints' efforts.
fn recorded(
    problem: &Problem,
    (actives, parts): (&[Active], &Parts),
    hypothesis: Hypothesis,
    shape: &[f64],
) -> Columns {
    let efforts = parts.efforts(problem, actives);
    let gains = &parts.gains;
    let plain = units(problem, hypothesis, shape);
    let bodies = bodies_of(problem, hypothesis, shape);
    let of = |body: &TrackEfforts, plain: &Column, step: f64| {
        let mut scaled = body.clone();
        scale(&mut scaled, gains);
        let on_top = recorded_on_top(problem, actives, efforts, &scaled, step);
        let mut values = plain.values.clone();
        for joint in 0..problem.joints {
            let own = &mut values[problem.joint_rows(joint)];
            if parts.transformed[joint] {
                problem.joint_signal(&on_top, joint, own);
                for value in own {
                    *value /= step;
                }
            } else {
                for value in own {
                    *value *= gains[joint];
                }
            }
        }
        Column {
            joint: None,
            values,
        }
    };
    let steps = steps(hypothesis);
    let factors = bodies.factors.iter().zip(&plain.factors).zip(steps);
    let factors = factors.map(|((body, plain), (_, step))| Arc::new(of(body, plain, step)));
    let alone = bodies.alone.as_ref().zip(plain.alone.as_ref());
    Columns {
        factors: factors.collect(),
        alone: alone.map(|(body, plain)| of(body, plain, 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::fit::fitted::Fit;
    use crate::fixture::{at_joint, problem_with};
    use crate::physics::library;

    #[test]
    fn the_column_of_viscous_friction_is_the_filtered_velocity() {
        let problem = problem_with(1, |_, _, _| {});
        let fit = Fit::new(&problem, Vec::new());
        let columns = fit.columns(&problem, at_joint("viscous_friction", 1), &[0.0]);
        assert!(columns.alone.is_none());
        let mut expected = vec![0.0; problem.rows];
        let velocity: Vec<Vec<f64>> = (problem.tracks.iter())
            .map(|track| track.track.velocity.clone())
            .collect();
        problem.joint_signal(&velocity, 1, &mut expected);
        let column = columns.factors[0].of_joint(1, problem.rows).unwrap();
        let off = column.iter().zip(&expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9);
        assert!(columns.factors[0].of_joint(0, problem.rows).is_none());
    }

    /// So small that what is linear to first order only is linear.
    const SMALL: f64 = 1e-3;

    /// Also where another effect transforms what is recorded.
    #[test]
    fn so_many_times_its_column_is_what_a_linear_effect_adds() {
        let problem = problem_with(2, |_, _, _| {});
        let gain = at_joint("torque_gain", 0).with(vec![0.2]);
        for beside in [Vec::new(), vec![gain]] {
            let fit = Fit::new(&problem, beside);
            let all = library::hypotheses(&problem.model, true, &BTreeSet::new());
            for hypothesis in all
                .into_iter()
                .filter(|h| h.is_linear() && !h.factors().is_empty())
            {
                let shape = vec![0.0; hypothesis.effect.coordinates.len()];
                let columns = fit.columns(&problem, hypothesis, &shape);
                let mut coordinates = shape;
                coordinates[0] = SMALL;
                let added = fit.added(&problem, &hypothesis.with(coordinates));
                for joint in 0..problem.joints {
                    let of = |column: &crate::data::column::Column| {
                        let values = column.of_joint(joint, problem.rows).map(<[f64]>::to_vec);
                        values.unwrap_or_else(|| vec![0.0; problem.rows])
                    };
                    let (unit, added) = (of(&columns.factors[0]), of(&added));
                    let size = added.iter().fold(1e-9_f64, |most, x| most.max(x.abs()));
                    for (unit, added) in unit.iter().zip(&added) {
                        let off = (SMALL * unit - added).abs();
                        assert!(off < 0.02 * size, "{}: {off}", hypothesis.effect.name);
                    }
                }
            }
        }
    }
}
