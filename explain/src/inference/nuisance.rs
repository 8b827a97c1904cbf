//! Nuisances: errors of bodies, laws and stamps that every real arm has and no report names.

use tauscope_dynamics::Inertia;
use tauscope_dynamics::terms::{Coordinate, EFFECTS, Family, PlaceKind, words};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, BODY, Hypothesis, Whereabouts};

use super::laws::{column_of, curves};

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
/// Usual error of another simulation's law of friction, as a share. Chosen: two estimates of one arm differ by a fifth.
const OTHER_FRICTION_SHARE: f64 = 0.2;
/// Usual difference between the stamps of effort and position of one joint, apart from that of all \[s\], at least half a
/// sample. Chosen: of the order of a controller's cycle.
const STAMP_S: f64 = 0.001;
/// Usual difference between the stamps of effort and position that all joints share \[s\]. Chosen: current controllers and filters of drives take some milliseconds.
const COMMON_STAMP_S: f64 = 0.002;
/// Usual width of a filter that the efforts of all joints pass and positions do not, or the reverse \[s\]. Chosen: a
/// low-pass filter of 20 Hz.
const COMMON_WIDTH_S: f64 = 0.008;

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
    } else {
        of_another_simulation(problem, &mut all);
    }
    let none = || vec![0.0; problem.joints * problem.rows];
    let (mut late, mut wide) = (none(), none());
    let sample_s = sample_s(problem);
    for (joint, size) in sizes.iter().enumerate() {
        of_curves(problem, fit, joint, *size, laws, &mut all);
        let own = [
            of_stamps(problem, fit, joint),
            of_bandwidth(problem, fit, joint),
        ];
        let shares = [
            COMMON_STAMP_S / stamp_s(sample_s),
            (COMMON_WIDTH_S / sample_s).powi(2),
        ];
        let rows = problem.joint_rows(joint);
        for ((common, own), share) in [&mut late, &mut wide].into_iter().zip(&own).zip(shares) {
            for (common, x) in common[rows.clone()].iter_mut().zip(&own.column.values) {
                *common = share * x;
            }
        }
        all.extend(own);
    }
    all.extend([late, wide].map(|values| Nuisance {
        column: Column {
            joint: None,
            values,
        },
        source: Source::Stamp,
    }));
    all
}

/// Mean time between samples \[s\].
fn sample_s(problem: &Problem) -> f64 {
    let times = problem.tracks.iter().map(|track| &track.track.time_s);
    let (mut span_s, mut count) = (0.0, 0);
    for time in times.filter(|time| time.len() > 1) {
        span_s += time[time.len() - 1] - time[0];
        count += time.len() - 1;
    }
    (span_s / count.max(1) as f64).max(1e-6)
}

/// Usual difference between the stamps of effort and position of one joint \[s\].
fn stamp_s(sample_s: f64) -> f64 {
    STAMP_S.max(0.5 * sample_s.min(0.01))
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
        let unfound = usual_errors(&body)
            .into_iter()
            .zip(UNITS_OF_ERRORS)
            .filter(|(_, unit)| !is_effect(fit, link, unit));
        for (parameters, _) in unfound {
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

/// Whether an effect of the fit is an error of a link's parameters of this unit: then its number is the whole error.
fn is_effect(fit: &Fit, link: usize, unit: &str) -> bool {
    let is_of_link = |active: &&Active| {
        let effect = active.hypothesis.effect;
        let is_body = effect.family == Family::Body && effect.place == PlaceKind::Link;
        is_body && active.hypothesis.lasts() && active.hypothesis.place.link == link
    };
    let has_unit = |c: &Coordinate| words::unit(c.name).is_some_and(|(_, own)| own == unit);
    let is_error = |active: &Active| {
        let hypothesis = active.hypothesis;
        hypothesis.is_unnamed_body() || hypothesis.effect.coordinates.iter().any(has_unit)
    };
    fit.actives.iter().filter(is_of_link).any(is_error)
}

/// Usual errors of another simulation's effort, whose bodies are not known: a share of each
/// joint's effort, and of the part that is proportional to its acceleration.
fn of_another_simulation(problem: &Problem, all: &mut Vec<Nuisance>) {
    let n = problem.joints;
    for joint in 0..n {
        let rigid = Column {
            joint: Some(joint),
            values: problem.rigid()[problem.joint_rows(joint)].to_vec(),
        };
        let acceleration = column_of(problem, joint, |r, k| {
            problem.tracks[r].track.acceleration[k * n + joint]
        });
        let counted: Vec<usize> = problem.counted(joint).map(|(_, row, _)| row).collect();
        let product = |a: &Column, b: &Column| -> f64 {
            counted
                .iter()
                .map(|&row| a.values[row] * b.values[row])
                .sum()
        };
        let square = product(&acceleration, &acceleration).max(f64::MIN_POSITIVE);
        let inertia = product(&acceleration, &rigid) / square;
        let columns = [
            acceleration.times(INERTIA_SHARE * inertia),
            rigid.times(MASS_SHARE),
        ];
        let of = |column| Nuisance {
            column,
            source: Source::Curve,
        };
        all.extend(columns.map(of));
    }
}

/// Units of the parameters that the usual errors of a body change: its mass, its centre of mass, its inertia.
const UNITS_OF_ERRORS: [&str; BODY] = [
    "kg", "m", "m", "m", "kg m²", "kg m²", "kg m²", "kg m²", "kg m²", "kg m²",
];

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

fn of_curves(
    problem: &Problem,
    fit: &Fit,
    joint: usize,
    size: Size,
    laws: f64,
    all: &mut Vec<Nuisance>,
) {
    for curve in curves(problem, fit, joint) {
        let deviation = if curve.is_friction && problem.is_foreign {
            OTHER_FRICTION_SHARE * size.friction
        } else if curve.is_friction {
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

/// The joint's effort shifted in time.
fn of_stamps(problem: &Problem, fit: &Fit, joint: usize) -> Nuisance {
    Nuisance {
        column: late(problem, fit, joint).times(stamp_s(sample_s(problem))),
        source: Source::Stamp,
    }
}

/// The mean changes of the links' inertial parameters.
pub fn mean_bodies(nuisances: &[Nuisance], means: &[f64]) -> Vec<Active> {
    let mut all: Vec<Active> = Vec::new();
    for (nuisance, mean) in nuisances.iter().zip(means) {
        let Source::Body { link, parameters } = nuisance.source else {
            continue;
        };
        let Some(hypothesis) = body_hypothesis(link) else {
            continue;
        };
        let at = all
            .iter()
            .position(|active| active.hypothesis == hypothesis);
        let at = at.unwrap_or_else(|| {
            all.push(hypothesis.with(vec![0.0; parameters.len()]));
            all.len() - 1
        });
        for (x, parameter) in all[at].coordinates.iter_mut().zip(&parameters) {
            *x += mean * parameter;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::fixture::problem_with;
    use crate::inference::state::State;

    /// Guards against a mass that came out short by what the usual error of the same link took.
    #[test]
    fn a_link_whose_mass_is_found_has_no_usual_error_of_its_mass() {
        let problem = problem_with(3, |_, _, _| {});
        let state = State::new(&problem, true);
        let masses = |actives: Vec<Active>| {
            let fit = Fit::new(&problem, actives);
            let all = of(&problem, &fit, &state.sizes(&fit), true, [1.0, 1.0]);
            let of_mass = |nuisance: &Nuisance| match nuisance.source {
                Source::Body { link, parameters } if parameters[0] != 0.0 => Some(link),
                _ => None,
            };
            all.iter().filter_map(of_mass).collect::<Vec<usize>>()
        };
        let [upper, lower] = masses(Vec::new())[..] else {
            panic!("two links move")
        };
        let found = Hypothesis {
            effect: effect("link_mass").unwrap(),
            place: Whereabouts {
                link: lower,
                ..Whereabouts::default()
            },
        };
        assert_eq!(masses(vec![found.with(vec![0.3])]), [upper]);
    }
}
