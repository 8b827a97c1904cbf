//! Torque scales that were fitted, where the torque constants are not known.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde_json::Value;
use tauscope_dynamics::terms::words::number;
use tauscope_dynamics::terms::{Layer, PlaceKind};

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::interval::{HALF_WIDTH_95, parameter_deviations};
use crate::fit::urdf_uncertainty::off_with_the_links;
use crate::physics::active::Hypothesis;
use crate::physics::parameter_units::{grows_with_effort, power_of_effort};
use crate::read::input::Input;
use crate::read::start::KNOWN;

/// Two scales that differ by less than this share agree.
/// Resolution: the interval of a torque constant from gravity is seldom narrower.
const AGREES: f64 = 0.1;

/// The torque scale of one joint \[A per N m\].
#[derive(Debug, Clone, Copy)]
struct Scale {
    joint: usize,
    gain: f64,
    deviation: f64,
    /// What it is in a fit without the bodies that were found, if there are any.
    unloaded: Option<f64>,
}

impl Scale {
    fn is_known(&self) -> bool {
        self.deviation.is_finite() && self.gain > KNOWN * self.deviation
    }

    /// What it is without the bodies that were found, if that is another number and as likely.
    fn rival(&self) -> Option<f64> {
        let apart = |unloaded: &f64| (unloaded - self.gain).abs();
        let rival = self.unloaded.filter(|u| *u > 0.0 && self.gain > 0.0);
        rival.filter(|u| apart(u) > AGREES * self.gain && apart(u) < HALF_WIDTH_95 * self.deviation)
    }
}

/// The torque scales that were fitted.
#[derive(Debug, Default)]
pub struct Scales {
    each: Vec<Scale>,
    /// By how much of themselves the bodies that were found may come from what is left.
    pull: f64,
}

impl Scales {
    /// Those of a fit. Their standard deviations include the errors of the URDF's masses, and what is left: a body that is
    /// named and a scale both explain weight, and what pulls the one pulls the other.
    pub fn of(problem: &Problem, fit: &Fit, spread: &DMatrix<f64>) -> Self {
        let fitted: Vec<usize> = (0..fit.actives.len())
            .filter(|&index| fit.actives[index].hypothesis.is_torque_scale())
            .collect();
        if fitted.is_empty() {
            return Self::default();
        }
        let off = off_with_the_links(problem, fit);
        let bare = without_bodies(problem, fit);
        let pull = bare.as_ref().map_or(0.0, |bare| pull_of_rest(fit, bare));
        let of = |index: usize| {
            let own = parameter_deviations(problem, fit, spread, index)[0];
            let actives = &fit.actives;
            let at: usize = actives[..index].iter().map(|a| a.coordinates.len()).sum();
            let (hypothesis, gain) = (
                actives[index].hypothesis,
                1.0 + actives[index].coordinates[0],
            );
            let same = |fit: &Fit| {
                fit.actives
                    .iter()
                    .find(|a| a.hypothesis == hypothesis)
                    .cloned()
            };
            let unloaded = bare
                .as_ref()
                .and_then(same)
                .map(|same| 1.0 + same.coordinates[0]);
            let pulled = pull * unloaded.map_or(0.0, |unloaded| unloaded - gain);
            Scale {
                joint: hypothesis.place.joint,
                gain,
                deviation: own.hypot(off[at]).hypot(pulled),
                unloaded,
            }
        };
        let each = fitted.into_iter().map(of).collect();
        Self { each, pull }
    }

    /// One note on each.
    pub fn notes(&self, joints: &[String]) -> Vec<String> {
        self.each.iter().map(|scale| note(scale, joints)).collect()
    }

    /// Converts the numbers of an effect on the recorded effort into N m if the scale of its joint is known. Returns whether
    /// they are still in A.
    pub fn to_nm(
        &self,
        hypothesis: Hypothesis,
        parameters: &mut BTreeMap<String, Value>,
        intervals: &mut BTreeMap<String, [f64; 2]>,
    ) -> bool {
        let of_bodies = hypothesis.effect.layer == Layer::Body;
        let joint = hypothesis.only_joint().filter(|_| !of_bodies);
        let Some(scale) = self.each.iter().find(|scale| Some(scale.joint) == joint) else {
            return false;
        };
        if !scale.is_known() {
            return true;
        }
        let share = scale.deviation / scale.gain;
        for (name, value) in parameters {
            let power = power_of_effort(name);
            let Some(number) = value.as_f64().filter(|_| power != 0) else {
                continue;
            };
            let in_nm = scale.gain.powi(-power);
            let known = number * in_nm;
            *value = Value::from(known);
            if let Some(interval) = intervals.get_mut(name) {
                *interval = wider(interval.map(|end| end * in_nm), known, share);
            }
        }
        false
    }

    /// Widens the intervals of a body that takes its weight from a torque scale, if the recordings do not tell which. Returns
    /// what is to be said of it.
    pub fn doubt_body(
        &self,
        hypothesis: Hypothesis,
        parameters: &BTreeMap<String, Value>,
        intervals: &mut BTreeMap<String, [f64; 2]>,
    ) -> Option<&'static str> {
        if !is_body(hypothesis) || self.each.iter().all(|scale| scale.rival().is_none()) {
            return None;
        }
        for (name, interval) in intervals
            .iter_mut()
            .filter(|(name, _)| grows_with_effort(name))
        {
            if let Some(number) = parameters.get(name).and_then(Value::as_f64) {
                *interval = wider(*interval, number, self.pull);
            }
        }
        Some(
            " Or it is not there, and the drives give less torque for each ampere: these recordings do not tell which.",
        )
    }

    /// Joints and the standard deviations of their scales \[A per N m\].
    pub fn deviations(&self) -> impl Iterator<Item = (usize, f64)> {
        self.each.iter().map(|scale| (scale.joint, scale.deviation))
    }
}

/// Whether it is weight that a link has gained or lost for good.
fn is_body(hypothesis: Hypothesis) -> bool {
    let hangs = matches!(hypothesis.effect.place, PlaceKind::Link | PlaceKind::Tool);
    hangs && hypothesis.effect.layer == Layer::Body && hypothesis.lasts()
}

/// The fit without the bodies in it, refined; none if it has none.
fn without_bodies(problem: &Problem, fit: &Fit) -> Option<Fit> {
    let hypotheses = fit.actives.iter().map(|active| active.hypothesis);
    let bodies = hypotheses
        .enumerate()
        .filter(|(_, hypothesis)| is_body(*hypothesis));
    let bodies: Vec<usize> = bodies.map(|(index, _)| index).collect();
    let less = |bare: Fit, &index: &usize| bare.without(problem, index);
    let any = !bodies.is_empty();
    any.then(|| bodies.iter().rev().fold(fit.clone(), less).refined(problem))
}

/// By how much of itself what is left could have made the bodies that `bare` lacks: the root of what is left over what
/// they explain, at the joint where that is least, and at most 1.
fn pull_of_rest(fit: &Fit, bare: &Fit) -> f64 {
    let over_rest = bare.variance.iter().zip(&fit.variance);
    let most = over_rest
        .map(|(bare, fit)| bare / fit - 1.0)
        .fold(0.0, f64::max);
    most.sqrt().recip().min(1.0)
}

/// Widens the interval of a number that is proportional to a scale. `share` is the scale's relative standard deviation.
fn wider(interval: [f64; 2], number: f64, share: f64) -> [f64; 2] {
    interval.map(|end| {
        let own = end - number;
        let wide = number + own.signum() * own.hypot(HALF_WIDTH_95 * share * number);
        // A scale does not change the sign.
        if wide * end < 0.0 || end == 0.0 {
            0.0
        } else {
            wide
        }
    })
}

/// Relative standard deviations of the start's torque scales, by joint.
#[derive(Debug)]
pub struct StartScales(Vec<f64>);

impl StartScales {
    /// Nothing to widen where the recordings are in N m or torque constants are known.
    pub fn of(input: &Input) -> Self {
        let unknown = input.effort_unit == "A" && input.torque_constants_nm_per_a.is_none();
        let start = input.start.as_ref().filter(|_| unknown);
        let share = |start: &crate::Start| {
            let each = start.gain.iter().zip(&start.gain_deviation);
            each.map(|(gain, deviation)| deviation / gain.abs())
                .collect()
        };
        Self(start.map_or_else(Vec::new, share))
    }

    /// Adds the uncertainty of the torque scale to the intervals of an effect. The scale is that of its joint or, for an
    /// effect on all joints, the one that is known best.
    pub fn widen(
        &self,
        hypothesis: Hypothesis,
        parameters: &BTreeMap<String, Value>,
        intervals: &mut BTreeMap<String, [f64; 2]>,
    ) {
        let best = self.0.iter().fold(f64::INFINITY, |best, s| best.min(*s));
        let share = match hypothesis.only_joint() {
            Some(joint) => self.0.get(joint).copied().unwrap_or(0.0),
            None => best,
        };
        // An unknown scale is part of the fit already.
        if !share.is_finite() || share * KNOWN >= 1.0 {
            return;
        }
        for (name, interval) in intervals {
            let scaled = power_of_effort(name) != 0 || grows_with_effort(name);
            if let Some(number) = parameters.get(name).and_then(Value::as_f64)
                && scaled
            {
                *interval = wider(*interval, number, share);
            }
        }
    }
}

fn note(scale: &Scale, joints: &[String]) -> String {
    let Scale {
        joint,
        gain,
        deviation,
        ..
    } = *scale;
    let joint = &joints[joint];
    let half = HALF_WIDTH_95 * deviation;
    if let Some(unloaded) = scale.rival() {
        return format!(
            "The drive of joint {joint} has {} N m/A with the bodies that were found, and {} N m/A with those of the URDF alone: \
             weight and torque constant explain the same effort. Recordings with a payload of known mass tell them apart.{}",
            number(1.0 / gain),
            number(1.0 / unloaded),
            if scale.is_known() {
                ""
            } else {
                " The numbers of its effects are in A."
            }
        );
    }
    if !scale.is_known() {
        return format!(
            "The gain of joint {joint} is not identifiable: gravity and inertia hardly load it in these recordings, and this small \
             load is uncertain because the URDF's masses are ({} A per N m, 95 % interval {} to {}). The numbers of its effects \
             are in A.",
            number(gain),
            number(gain - half),
            number(gain + half)
        );
    }
    format!(
        "The drive of joint {joint} has {} N m/A (95 % interval {} to {}).",
        number(1.0 / gain),
        number(1.0 / (gain + half)),
        number(1.0 / (gain - half))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(unloaded: Option<f64>, deviation: f64) -> Scale {
        Scale {
            joint: 0,
            gain: 0.068,
            deviation,
            unloaded,
        }
    }

    #[test]
    fn two_scales_are_rivals_if_they_differ_and_the_recordings_do_not_tell_which() {
        // As on a real arm: 14.7 N m/A with a payload that was not there, 10.1 without.
        assert_eq!(scale(Some(0.099), 0.024).rival(), Some(0.099));
        assert_eq!(scale(Some(0.099), 0.002).rival(), None);
        assert_eq!(scale(Some(0.069), 0.024).rival(), None);
        assert_eq!(scale(None, 0.024).rival(), None);
    }

    #[test]
    fn a_note_gives_both_and_says_what_would_tell() {
        let said = note(&scale(Some(0.099), 0.024), &["pan".to_owned()]);
        assert!(
            said.contains("14.7 N m/A") && said.contains("10.1 N m/A"),
            "{said}"
        );
        assert!(
            said.contains("payload of known mass") && said.contains("are in A"),
            "{said}"
        );
        let said = note(&scale(Some(0.099), 0.002), &["pan".to_owned()]);
        assert!(said.contains("95 % interval"), "{said}");
    }
}
