//! Functions of a joint's motion that a law of its effort may have: of position, of velocity by direction, of load.

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;

/// Knots of the curves over position, and over velocity or load for each direction. Resolution: enough for the bend of
/// Stribeck friction and a few waves of position.
const POSITION_KNOTS: usize = 8;
const OTHER_KNOTS: usize = 4;

/// A hat function: 1 at its own knot, 0 at the others, straight between them and constant beyond the ends.
pub fn hat(knots: &[f64], own: usize, x: f64) -> f64 {
    let last = knots.len() - 1;
    let x = x.clamp(knots[0], knots[last]);
    let rises = |from: f64, to: f64| ((x - from) / (to - from).max(1e-12)).clamp(0.0, 1.0);
    let up = if own == 0 {
        1.0
    } else {
        rises(knots[own - 1], knots[own])
    };
    let down = if own == last {
        1.0
    } else {
        1.0 - rises(knots[own], knots[own + 1])
    };
    up.min(down)
}

/// A column over the samples of one joint.
pub fn column_of(
    problem: &Problem,
    joint: usize,
    mut value: impl FnMut(usize, usize) -> f64,
) -> Column {
    let tracks = problem.tracks.iter().enumerate();
    let of = |(r, track): (usize, &crate::data::track::FitTrack)| {
        (0..track.track.len()).map(|k| value(r, k)).collect()
    };
    let efforts = tracks.map(of).collect();
    problem.column_at(joint, efforts)
}

/// Values at which a joint's quantity is between its extremes: `count` knots, evenly.
fn even(lowest: f64, highest: f64, count: usize) -> Vec<f64> {
    let step = (highest - lowest) / (count - 1) as f64;
    (0..count).map(|k| lowest + step * k as f64).collect()
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    })
}

/// Functions of one quantity of a joint's motion.
#[derive(Debug)]
pub struct Curve {
    /// The quantity, in words.
    pub of: &'static str,
    /// Whether it is a law of friction.
    pub is_friction: bool,
    /// Columns that span the functions, at 1 N m or 1 N.
    pub columns: Vec<Column>,
}

/// Functions of a joint's position, velocity by direction, load, and load by direction.
pub fn curves(problem: &Problem, fit: &Fit, joint: usize) -> Vec<Curve> {
    let at = |k: usize| k * problem.joints + joint;
    let tracks = &problem.tracks;
    let load = fit.load(problem);
    let column = |value: &dyn Fn(usize, usize) -> f64| column_of(problem, joint, value);
    let of_own = |of: &dyn Fn(usize, usize) -> f64| {
        let all = (0..tracks.len()).flat_map(|r| (0..tracks[r].track.len()).map(move |k| (r, k)));
        range(all.map(|(r, k)| of(r, k)))
    };
    let position = |r: usize, k: usize| tracks[r].track.position[at(k)];
    let velocity = |r: usize, k: usize| tracks[r].track.velocity[at(k)];
    let loaded = |r: usize, k: usize| load[r][at(k)];
    let sign = |r: usize, k: usize| tauscope_dynamics::terms::sign(velocity(r, k));
    let (low, high) = of_own(&position);
    let knots = even(low, high, POSITION_KNOTS);
    let of_position =
        (0..POSITION_KNOTS).map(|own| column(&|r, k| hat(&knots, own, position(r, k))));
    let (low, high) = of_own(&velocity);
    let fastest = high.max(-low).max(1e-6);
    // Friction bends at low speeds: knots in a geometric row.
    let speeds: Vec<f64> = (0..OTHER_KNOTS)
        .map(|k| fastest * 0.25_f64.powi((OTHER_KNOTS - 1 - k) as i32))
        .collect();
    let directions = (0..OTHER_KNOTS).flat_map(|own| [(own, true), (own, false)]);
    let of_velocity = directions.map(|(own, forward)| {
        column(&|r, k| {
            let v = velocity(r, k);
            let on_side = f64::from(u8::from((v > 0.0) == forward));
            on_side * sign(r, k) * hat(&speeds, own, v.abs())
        })
    });
    let (low, high) = of_own(&loaded);
    let loads = even(low, high.max(low + 1e-9), OTHER_KNOTS);
    let of_load = (0..OTHER_KNOTS).map(|own| column(&|r, k| hat(&loads, own, loaded(r, k))));
    let by_load =
        (0..OTHER_KNOTS).map(|own| column(&|r, k| sign(r, k) * hat(&loads, own, loaded(r, k))));
    vec![
        Curve {
            of: "position",
            is_friction: false,
            columns: of_position.collect(),
        },
        Curve {
            of: "velocity",
            is_friction: true,
            columns: of_velocity.collect(),
        },
        Curve {
            of: "load",
            is_friction: false,
            columns: of_load.collect(),
        },
        Curve {
            of: "load, with the sign of its velocity",
            is_friction: true,
            columns: by_load.collect(),
        },
    ]
}
