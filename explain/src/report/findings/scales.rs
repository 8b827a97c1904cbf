//! Torque scales that were fitted, where the torque constants are not known.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde_json::Value;
use tauscope_dynamics::terms::Layer;
use tauscope_dynamics::terms::words::number;

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::interval::{HALF_WIDTH_95, parameter_deviations};
use crate::physics::active::{Active, Hypothesis};
use crate::physics::parameter_units::{grows_with_effort, power_of_effort};
use crate::read::input::Input;
use crate::read::start::KNOWN;

/// The torque scale of one joint \[A per N m\].
#[derive(Debug, Clone, Copy)]
struct Scale {
    joint: usize,
    gain: f64,
    deviation: f64,
}

impl Scale {
    fn is_known(&self) -> bool {
        self.deviation.is_finite() && self.gain > KNOWN * self.deviation
    }
}

/// The torque scales that were fitted.
#[derive(Debug, Default)]
pub struct Scales {
    each: Vec<Scale>,
}

impl Scales {
    /// Those of a fit whose numbers have the covariance `spread`.
    pub fn of(problem: &Problem, fit: &Fit, spread: &DMatrix<f64>) -> Self {
        let scales = fit.actives.iter().enumerate();
        let scales = scales.filter(|(_, active)| active.hypothesis.is_torque_scale());
        let of = |(index, active): (usize, &Active)| Scale {
            joint: active.hypothesis.place.joint,
            gain: 1.0 + active.coordinates[0],
            deviation: parameter_deviations(problem, fit, spread, index)[0],
        };
        Self {
            each: scales.map(of).collect(),
        }
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

    /// Joints and the standard deviations of their scales \[A per N m\].
    pub fn deviations(&self) -> impl Iterator<Item = (usize, f64)> {
        self.each.iter().map(|scale| (scale.joint, scale.deviation))
    }
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
    } = *scale;
    let joint = &joints[joint];
    let half = HALF_WIDTH_95 * deviation;
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

    #[test]
    fn a_scale_is_told_with_its_interval_and_one_that_is_not_known_is_said_not_to_be() {
        let said = |deviation: f64| {
            let scale = Scale {
                joint: 0,
                gain: 0.068,
                deviation,
            };
            note(&scale, &["pan".to_owned()])
        };
        assert!(
            said(0.002).contains("14.7 N m/A (95 % interval"),
            "{}",
            said(0.002)
        );
        assert!(said(0.06).contains("not identifiable"), "{}", said(0.06));
    }
}
