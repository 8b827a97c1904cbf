//! What a recorded current is in N m, where nobody knows the torque constants and the motion may tell.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde_json::Value;
use tauscope_dynamics::terms::Layer;

use crate::active::Hypothesis;
use crate::drive::{is_drive, off_with_the_links};
use crate::fit::Fit;
use crate::interval::{HALF_WIDTH_95, parameter_deviations};
use crate::problem::Problem;
use crate::words;

/// A known scale is at least this many times its own deviation.
const KNOWN: f64 = 5.0;

/// The scale of one drive \[A per N m\].
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

/// The scales of all drives that were fitted.
#[derive(Debug)]
pub struct Scales(Vec<Scale>);

impl Scales {
    /// As a fit has them; how far they are known counts that the URDF's masses are not exact.
    pub fn of(problem: &Problem, fit: &Fit, spread: &DMatrix<f64>) -> Self {
        let drives: Vec<usize> = (0..fit.actives.len())
            .filter(|&index| is_drive(&fit.actives[index].hypothesis))
            .collect();
        if drives.is_empty() {
            return Self(Vec::new());
        }
        let off = off_with_the_links(problem, fit);
        let of = |index: usize| {
            let own = parameter_deviations(problem, fit, spread, index)[0];
            let actives = &fit.actives;
            let at: usize = actives[..index].iter().map(|a| a.coordinates.len()).sum();
            Scale {
                joint: actives[index].hypothesis.place.joint,
                gain: 1.0 + actives[index].coordinates[0],
                deviation: own.hypot(off[at]),
            }
        };
        Self(drives.into_iter().map(of).collect())
    }

    /// What is known of each.
    pub fn notes(&self, joints: &[String]) -> Vec<String> {
        self.0.iter().map(|scale| note(scale, joints)).collect()
    }

    /// Turns the numbers of an effect on the recorded effort into N m where the scale of its joint is known; tells whether
    /// they are still in A.
    pub fn to_nm(
        &self,
        hypothesis: Hypothesis,
        parameters: &mut BTreeMap<String, Value>,
        intervals: &mut BTreeMap<String, [f64; 2]>,
    ) -> bool {
        let of_bodies = hypothesis.effect.layer == Layer::Body;
        let joint = hypothesis.only_joint().filter(|_| !of_bodies);
        let Some(scale) = self.0.iter().find(|scale| Some(scale.joint) == joint) else {
            return false;
        };
        if !scale.is_known() {
            return true;
        }
        let share = scale.deviation / scale.gain;
        for (name, value) in parameters {
            let Some(number) = value.as_f64().filter(|_| words::is_of_effort(name)) else {
                continue;
            };
            let known = number / scale.gain;
            *value = Value::from(known);
            if let Some(interval) = intervals.get_mut(name) {
                let wider = |end: f64| {
                    let own = end / scale.gain - known;
                    let wide = known + own.signum() * own.hypot(HALF_WIDTH_95 * share * known);
                    // No scale turns a sign.
                    if wide * end < 0.0 || end == 0.0 {
                        0.0
                    } else {
                        wide
                    }
                };
                *interval = interval.map(wider);
            }
        }
        false
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
            "The gain of joint {joint} is not identifiable: hardly any gravity or inertia acts on it in these recordings, and what \
             does hangs on how exact the URDF's masses are ({} A per N m, 95 % interval {} to {}). The numbers of its effects are in A.",
            words::number(gain),
            words::number(gain - half),
            words::number(gain + half)
        );
    }
    format!(
        "The drive of joint {joint} has {} N m/A (95 % interval {} to {}).",
        words::number(1.0 / gain),
        words::number(1.0 / (gain + half)),
        words::number(1.0 / (gain - half))
    )
}
