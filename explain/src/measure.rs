//! Estimation of a fixed set of parameters every night: friction, offset and gain of each joint, the mass on the
//! tool, and the backlash of a gear that has any.
//!
//! An explanation contains only certain effects, so its parameters differ from night to night. A time series over
//! weeks needs the same parameters with intervals every night. Therefore all effects that [`is_followed`] are fitted
//! at once, in addition to the corrected twin that the input starts from. Swevers, Verdonck and De Schutter 2007 fit
//! a fixed set of parameters in the same way: see [`estimated`].
//! [`estimated`].
//!
//! [`is_followed`]: tauscope_dynamics::terms::Traits::is_followed

use std::collections::BTreeMap;

use tauscope_dynamics::terms::{PlaceKind, TermError, TermSpec, Traits};

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::units::scales;
use crate::fit::interval::{HALF_WIDTH_95, parameter_deviations};
use crate::inference::{Estimated, estimated};
use crate::physics::active::{Active, Hypothesis};
use crate::physics::torque_scale::unknown_scales;
use crate::read::audit;
use crate::read::input::Input;
use crate::read::recording::Recording;

/// Smallest number of compared rows of a joint that is measured.
/// Resolution: ten for each of its parameters.
const LEAST_ROWS: f64 = 40.0;
/// Largest half width of the 95 % interval of a reported gain, relative to its value.
/// Resolution: gravity or inertia that hardly contributes to the effort does not determine a gain.
const LEAST_KNOWN_GAIN: f64 = 0.5;

/// A parameter with its interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// Index of the joint; `None` for a parameter of the whole arm.
    pub joint: Option<usize>,
    /// Canonical name of the parameter, with its unit.
    pub name: &'static str,
    /// Value: that of the twin plus the estimated correction.
    pub value: f64,
    /// The 95 % interval.
    pub interval: [f64; 2],
}

/// The parameters of one night.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The parameters, joint by joint.
    pub numbers: Vec<Number>,
    /// Whether a joint's efforts are in N m, by joint. Otherwise they are in A, although the names of parameters say
    /// N m, because its torque constant is unknown.
    pub in_nm: Vec<bool>,
}

/// Estimates the parameters. `Ok(Err(reason))` if the recordings do not allow it.
///
/// # Errors
/// If a term of the start cannot be built for the robot.
pub fn measure(input: &Input) -> Result<Result<Measured, String>, TermError> {
    let n = input.model.dof();
    if let Some(recording) = input.fit.iter().find(|one| one.effort.is_empty()) {
        return Ok(Err(format!("recording {} holds no effort", recording.name)));
    }
    if audit::at_rest(input) {
        return Ok(Err(
            "no joint moves, so friction cannot be estimated".to_owned()
        ));
    }
    let constants = (input.torque_constants_nm_per_a.clone()).unwrap_or_else(|| vec![1.0; n]);
    let (unit_nm, unscaled) = scales(input, &constants, false);
    let begins = input
        .fit
        .iter()
        .map(|recording: &Recording| recording.start_ns);
    let context = Context {
        input,
        constants: &constants,
        unit_nm: &unit_nm,
        unscaled,
        loads: Vec::new(),
        session_start_ns: begins.min().unwrap_or(0),
        at_rest: false,
        twin_late_s: 0.0,
    };
    let problem = context.problem(&input.fit, &vec![false; n])?;
    let count = |joint: usize| {
        problem.weight[problem.joint_rows(joint)]
            .iter()
            .sum::<f64>()
    };
    let moves: Vec<bool> = (0..n).map(|joint| count(joint) >= LEAST_ROWS).collect();
    let followed = followed(&context, &moves);
    let (always, searched): (Vec<_>, Vec<_>) =
        followed.into_iter().partition(Hypothesis::is_linear);
    let mut actives = gains(&context, &moves);
    actives.extend(
        always
            .iter()
            .map(|one| one.with(vec![0.0; one.effect.coordinates.len()])),
    );
    let estimated = estimated(&problem, actives, &searched, input.bodies);
    let is_known = |joint| context.unscaled.iter().all(|(other, _)| *other != joint);
    let in_nm = (0..n).map(is_known).collect();
    let numbers = numbers(&context, &problem, &estimated);
    Ok(Ok(Measured { numbers, in_nm }))
}

/// Returns the followed effects at the joints that move.
fn followed(context: &Context<'_>, moves: &[bool]) -> Vec<Hypothesis> {
    let mut all = context.hypotheses();
    all.retain(|one| {
        let Traits { is_followed, .. } = one.effect.traits;
        is_followed && (one.effect.place != PlaceKind::Joint || moves[one.place.joint])
    });
    all
}

/// Returns a gain for each joint that moves and whose bodies are known.
fn gains(context: &Context<'_>, moves: &[bool]) -> Vec<Active> {
    if !context.input.bodies {
        return unknown_scales(&context.unscaled);
    }
    let first = |joint: usize| {
        let mut unscaled = context.unscaled.iter();
        unscaled
            .find(|(other, _)| *other == joint)
            .map_or(1.0, |(_, gain)| *gain)
    };
    let moving = (0..moves.len()).filter(|joint| moves[*joint]);
    unknown_scales(
        &moving
            .map(|joint| (joint, first(joint)))
            .collect::<Vec<_>>(),
    )
}

/// Returns all parameters of a fit, each added to that of the twin.
fn numbers(context: &Context<'_>, problem: &Problem, estimated: &Estimated) -> Vec<Number> {
    let Estimated { fit, covariance } = estimated;
    let own = of_twin(context, problem);
    let mut all = Vec::new();
    for (index, active) in fit.actives.iter().enumerate() {
        let effect = active.hypothesis.effect;
        let joint = active.hypothesis.only_joint().or_else(|| {
            let at_joint = effect.place == PlaceKind::Joint;
            at_joint.then_some(active.hypothesis.place.joint)
        });
        // The first parameter represents the effect.
        let name = effect.parameters[0].name;
        let value = active.parameters()[0];
        let half = HALF_WIDTH_95 * parameter_deviations(problem, fit, covariance, index)[0];
        let is_gain = active.hypothesis.is_torque_scale();
        let known = half.is_finite() && half > 0.0;
        if !known || (is_gain && half > LEAST_KNOWN_GAIN * value.abs()) {
            continue;
        }
        let value = value + own.get(&(joint, name)).copied().unwrap_or(0.0);
        let interval = [value - half, value + half];
        all.push(Number {
            joint,
            name,
            value,
            interval,
        });
    }
    all.sort_by_key(|one: &Number| (one.joint.is_none(), one.joint));
    all
}

/// Returns the parameters that the corrected twin already contains, in their units.
fn of_twin(
    context: &Context<'_>,
    problem: &Problem,
) -> BTreeMap<(Option<usize>, &'static str), f64> {
    let mut own = BTreeMap::new();
    let Some(start) = &context.input.start else {
        return own;
    };
    let model = &problem.model;
    let mut add = |joint, name, value: f64| *own.entry((joint, name)).or_insert(0.0) += value;
    for (joint, frictions) in problem.known_friction.iter().enumerate() {
        for (effect, value) in frictions {
            if let Some(effect) = tauscope_dynamics::terms::effect(effect) {
                add(Some(joint), effect.parameters[0].name, *value);
            }
        }
    }
    for (joint, offset) in start.offset.iter().enumerate() {
        let bias = |one: &&Hypothesis| one.effect.traits.is_followed && one.effect.traits.only_adds;
        if let Some(bias) = context.hypotheses().iter().find(bias) {
            add(
                Some(joint),
                bias.effect.parameters[0].name,
                offset * context.unit_nm[joint],
            );
        }
    }
    let other = |spec: &&TermSpec| {
        let effect = spec.effect().ok();
        effect.is_some_and(|effect| effect.traits.is_followed && !effect.may_be_overstated())
    };
    for spec in start.terms.iter().filter(other) {
        let Ok(effect) = spec.effect() else { continue };
        let name = effect.parameters[0].name;
        let joint = (spec.joint.as_ref()).and_then(|joint| model.joint_index(joint));
        if let Some(value) = spec.parameters.get(name) {
            add(joint, name, *value);
        }
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Noise, model, recording};

    /// Simulates two recordings with this Coulomb friction at the elbow.
    fn night(seed: u64, coulomb_nm: f64) -> Input {
        let mut noise = Noise(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        let mut add = |_: &[f64], qd: &[f64], effort: &mut [f64]| {
            effort[1] += coulomb_nm * qd[1].signum() + 0.4 * qd[1];
            for effort in effort {
                *effort += 0.05 * noise.next();
            }
        };
        let model = model();
        let fit = vec![
            recording(&model, 2 * seed, &mut add),
            recording(&model, 2 * seed + 1, &mut add),
        ];
        Input {
            case: "night".to_owned(),
            model,
            bodies: true,
            effort_unit: "Nm".to_owned(),
            torque_constants_nm_per_a: None,
            fit,
            holdout: Vec::new(),
            start: None,
            without: std::collections::BTreeSet::new(),
        }
    }

    #[test]
    fn a_night_has_every_number_with_an_interval_that_holds_the_true_one() {
        let measured = measure(&night(3, 1.5)).unwrap().unwrap();
        assert_eq!(measured.in_nm, [true, true]);
        let number = |joint: Option<usize>, name: &str| {
            let found = measured
                .numbers
                .iter()
                .find(|one| one.joint == joint && one.name == name);
            found.unwrap_or_else(|| panic!("{name} of {joint:?}: {:?}", measured.numbers))
        };
        for (joint, name, truth) in [
            (Some(1), "coulomb_nm", 1.5),
            (Some(1), "viscous_nms_per_rad", 0.4),
            (Some(0), "coulomb_nm", 0.0),
            (Some(0), "gain", 1.0),
            (Some(0), "bias_nm", 0.0),
            (None, "mass_kg", 0.0),
        ] {
            let Number {
                value,
                interval: [low, high],
                ..
            } = *number(joint, name);
            let half = 0.5 * (high - low);
            assert!(
                (value - truth).abs() < 2.0 * half,
                "{name}: {value}, {low} to {high}"
            );
            assert!(half < 0.25, "{name}: {value}, {low} to {high}");
        }
    }

    #[test]
    fn an_arm_that_stands_has_no_numbers() {
        let mut input = night(1, 1.0);
        for recording in &mut input.fit {
            recording.position.fill(0.3);
        }
        assert!(
            measure(&input)
                .unwrap()
                .unwrap_err()
                .contains("no joint moves")
        );
    }
}
