//! Nuisances: errors of bodies, laws and stamps that every real arm has and no report names.

use tauscope_dynamics::Inertia;
use tauscope_dynamics::terms::{EFFECTS, PlaceKind};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{BODY, Hypothesis, Whereabouts};

/// Usual error of a mass in a URDF, as a share. Chosen: by order of magnitude.
const MASS_SHARE: f64 = 0.05;
/// Usual error of a centre of mass \[m\]. Chosen: as the mass.
const CENTRE_M: f64 = 0.005;
/// Usual error of an inertia about the centre of mass, as a share. Chosen: as the mass.
const INERTIA_SHARE: f64 = 0.1;
/// Usual error of a law that is a function of the joint's position or load, as a share of the joint's effort.
/// Chosen: an estimate scales it.
const LAW_SHARE: f64 = 0.02;
/// Usual error of a law of friction, as a share of the joint's friction. Chosen: as the other laws.
const FRICTION_SHARE: f64 = 0.05;
/// Usual difference between the stamps of effort and position of one joint, apart from that of all \[s\], at least half a
/// sample. Chosen: of the order of a controller's cycle.
const STAMP_S: f64 = 0.001;
/// Usual difference between the stamps of effort and position that all joints share \[s\]. Chosen: current controllers and filters of drives take some milliseconds.
const COMMON_STAMP_S: f64 = 0.004;
/// Knots of the curves over position, and over velocity or load for each direction. Resolution: enough for the bend of
/// Stribeck friction and a few waves of position.
const POSITION_KNOTS: usize = 8;
const OTHER_KNOTS: usize = 4;

/// A nuisance: its effort at one standard deviation.
#[derive(Debug)]
pub struct Nuisance {
    /// Its effort as a signal.
    pub column: Column,
    /// Its kind.
    pub source: Source,
}

/// Kinds of nuisances.
#[derive(Debug, Clone, Copy)]
pub enum Source {
    /// A change of a link's inertial parameters.
    Body {
        /// The link.
        link: usize,
        /// The change at one standard deviation.
        parameters: [f64; BODY],
    },
    /// A value of a curve over position, velocity or load of a joint.
    Curve,
    /// A shift of the joint's effort in time.
    Stamp,
}

/// Magnitudes of a joint that the sizes of nuisances are shares of \[N m or N\].
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Root mean square of the joint's effort.
    pub effort: f64,
    /// Root mean square of its friction.
    pub friction: f64,
}

/// The nuisances next to a fit. `scale` and `laws` multiply the usual errors of bodies and of laws.
pub fn of(
    problem: &Problem,
    fit: &Fit,
    sizes: &[Size],
    bodies: bool,
    [scale, laws]: [f64; 2],
) -> Vec<Nuisance> {
    let mut all = Vec::new();
    if bodies {
        of_bodies(problem, fit, scale, &mut all);
    }
    let mut common = vec![0.0; problem.joints * problem.rows];
    for (joint, size) in sizes.iter().enumerate() {
        of_curves(problem, fit, joint, *size, laws, &mut all);
        let (shift_s, own) = of_stamps(problem, fit, joint);
        let values = own
            .column
            .values
            .iter()
            .map(|x| x * COMMON_STAMP_S / shift_s);
        for (common, x) in common[problem.joint_rows(joint)].iter_mut().zip(values) {
            *common = x;
        }
        all.push(own);
        all.push(of_bandwidth(problem, fit, joint));
    }
    all.push(Nuisance {
        column: Column {
            joint: None,
            values: common,
        },
        source: Source::Stamp,
    });
    all
}

/// The effect that changes all inertial parameters of a link.
pub fn body_hypothesis(link: usize) -> Option<Hypothesis> {
    let describes = |e: &&&tauscope_dynamics::terms::Effect| {
        e.traits.describes_only && e.place == PlaceKind::Link
    };
    EFFECTS.iter().find(describes).map(|&effect| Hypothesis {
        effect,
        place: Whereabouts {
            link,
            ..Whereabouts::default()
        },
    })
}

fn of_bodies(problem: &Problem, fit: &Fit, scale: f64, all: &mut Vec<Nuisance>) {
    let model = &problem.model;
    for joint in 0..problem.joints {
        let link = model.body_link(joint);
        let body = model.links()[link].inertia;
        let Some(hypothesis) = body_hypothesis(link).filter(|_| body.mass_kg() > 0.0) else {
            continue;
        };
        let units = fit.columns(problem, hypothesis, &[0.0; BODY]);
        for parameters in usual_errors(&body) {
            let mut values = vec![0.0; problem.joints * problem.rows];
            for (unit, parameter) in units.factors.iter().zip(&parameters) {
                for (value, unit) in values.iter_mut().zip(&unit.values) {
                    *value += scale * parameter * unit;
                }
            }
            let parameters = parameters.map(|x| scale * x);
            all.push(Nuisance {
                column: Column {
                    joint: None,
                    values,
                },
                source: Source::Body { link, parameters },
            });
        }
    }
}

/// The usual errors of a body: changes of its ten inertial parameters, ten of them.
fn usual_errors(body: &Inertia) -> Vec<[f64; BODY]> {
    let (mass, com, about) = (body.mass_kg(), body.com_m(), body.inertia_about_com_kgm2());
    let own = body.parameters();
    let change = |other: Inertia| {
        let there = other.parameters();
        std::array::from_fn(|k| there[k] - own[k])
    };
    let mut all = vec![change(Inertia::new(
        mass * (1.0 + MASS_SHARE),
        com,
        about.map(|x| x * (1.0 + MASS_SHARE)),
    ))];
    for axis in 0..3 {
        let mut moved = com;
        moved[axis] += CENTRE_M;
        all.push(change(Inertia::new(mass, moved, about)));
    }
    // In the order xx, xy, xz, yy, yz, zz.
    let diagonal = [0, 3, 5];
    let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
    for (k, (a, b)) in pairs.into_iter().enumerate() {
        let usual = (about[diagonal[a]] * about[diagonal[b]]).abs().sqrt();
        let mut other = about;
        other[k] += INERTIA_SHARE * usual;
        all.push(change(Inertia::new(mass, com, other)));
    }
    all
}

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

fn of_curves(
    problem: &Problem,
    fit: &Fit,
    joint: usize,
    size: Size,
    laws: f64,
    all: &mut Vec<Nuisance>,
) {
    for curve in curves(problem, fit, joint) {
        let deviation = if curve.is_friction {
            FRICTION_SHARE * size.friction
        } else {
            LAW_SHARE * size.effort
        };
        for mut column in curve.columns {
            column
                .values
                .iter_mut()
                .for_each(|x| *x *= laws * deviation);
            all.push(Nuisance {
                column,
                source: Source::Curve,
            });
        }
    }
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

/// Effect of another bandwidth on the joint's effort: half the second derivative times the square of a sample. Motion and
/// effort pass through different filters before they are recorded.
fn of_bandwidth(problem: &Problem, fit: &Fit, joint: usize) -> Nuisance {
    let n = problem.joints;
    let recorded = &fit.efforts(problem).recorded;
    let column = column_of(problem, joint, |r, k| {
        let last = problem.tracks[r].track.time_s.len() - 1;
        if k == 0 || k == last {
            return 0.0;
        }
        let effort = |k: usize| recorded[r][k * n + joint];
        0.5 * (effort(k + 1) - 2.0 * effort(k) + effort(k - 1))
    });
    Nuisance {
        column,
        source: Source::Stamp,
    }
}

/// Derivative of a joint's effort with respect to time: its negative is the change per second of delay.
pub fn late(problem: &Problem, fit: &Fit, joint: usize) -> Column {
    let n = problem.joints;
    let recorded = &fit.efforts(problem).recorded;
    column_of(problem, joint, |r, k| {
        let (time, effort) = (&problem.tracks[r].track.time_s, &recorded[r]);
        let (before, after) = (k.saturating_sub(1), (k + 1).min(time.len() - 1));
        let span_s = (time[after] - time[before]).max(1e-9);
        (effort[after * n + joint] - effort[before * n + joint]) / span_s
    })
}

/// The joint's effort shifted in time, and by how much.
fn of_stamps(problem: &Problem, fit: &Fit, joint: usize) -> (f64, Nuisance) {
    let mut shift_s = STAMP_S;
    for track in &problem.tracks {
        let time = &track.track.time_s;
        if time.len() > 1 {
            let mean = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
            shift_s = shift_s.max(0.5 * mean.min(0.01));
        }
    }
    (
        shift_s,
        Nuisance {
            column: late(problem, fit, joint).times(shift_s),
            source: Source::Stamp,
        },
    )
}
