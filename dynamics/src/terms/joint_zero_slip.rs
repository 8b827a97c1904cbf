//! A joint whose zero jumps once: an encoder that slips on its shaft, a belt that jumps a tooth.

use std::sync::Arc;

use super::ghost::While;
use super::joint_zero_offset::JointZeroOffset;
use super::payload_pickup::time;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Simpler, Simulated, Term, Traits, Words,
};

/// As `joint_zero_offset`, with one offset before a time of the session and another from then on.
pub(super) static EFFECT: Effect = Effect {
    name: "joint_zero_slip",
    words: Words::new(
        "Joint zero that jumped",
        "a joint zero that jumped once",
        "From some time on the joint stands elsewhere than its recorded position says, or elsewhere than before.",
        "Joint {place}: does its encoder, coupling or clamp slip on the shaft, did a belt jump a tooth?",
        "The zero of joint {place} jumped, {change_time_session_s} into the session: the joint stood at its recorded position \
         plus {offset_before_rad} before, and stands at its recorded position plus {offset_after_rad} since.",
    ),
    family: Family::Mounting,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -7.0,
    parameters: &[
        Parameter::any("offset_before_rad"),
        Parameter::any("offset_after_rad"),
        Parameter::any("change_time_session_s"),
    ],
    coordinates: &[
        Coordinate::bending_factor("offset_before_rad"),
        Coordinate::bending_factor("offset_after_rad"),
        time("change_time_session_s", CoordinateKind::SessionTime),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::joint_zero_offset::EFFECT,
        numbers: &["offset_after_rad", "offset_before_rad"],
    }),
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::No(
        "simulate the recordings from then on by a scenario of their own that has a `joint_zero_offset`",
    ),
    concealed: None,
    traits: Traits {
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        let time_s = values[2];
        let part =
            |offset: f64, there: While| JointZeroOffset::new(&EFFECT, site, &[offset], there);
        Box::new(JointZeroSlip {
            values: [values[0], values[1], time_s],
            parts: [
                part(values[0], While::InSession([f64::NEG_INFINITY, time_s])),
                part(values[1], While::InSession([time_s, f64::INFINITY])),
            ],
        })
    },
};

#[derive(Debug)]
struct JointZeroSlip {
    values: [f64; 3],
    /// Before and after.
    parts: [JointZeroOffset; 2],
}

impl Term for JointZeroSlip {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        for part in &mut self.parts {
            part.act(at, effort);
        }
    }

    fn know_recorded(&mut self, efforts: &Arc<Vec<f64>>) {
        for part in &mut self.parts {
            part.know_recorded(efforts);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::joint_zero_offset;
    use super::super::tests::{TwoJoints, assert_near, motion, run};
    use super::*;

    #[test]
    fn one_offset_comes_after_the_other() {
        let robot = TwoJoints::new();
        let site = robot.site();
        let motion = motion(&robot.model, 100);
        let session_s: Vec<f64> = motion.iter().map(|at| at.view().session_s).collect();
        let middle_s = 0.5 * (session_s[0] + session_s[99]);
        let constant = |offset: f64| {
            let mut term = (joint_zero_offset::EFFECT.build)(&site, &[offset]);
            run(&mut *term, &motion)
        };
        let (before, after) = (constant(0.02), constant(-0.05));
        let mut slip = (EFFECT.build)(&site, &[0.02, -0.05, middle_s]);
        for (i, now) in run(&mut *slip, &motion).into_iter().enumerate() {
            let is_before = session_s[i] < middle_s;
            assert_near(now, if is_before { before[i] } else { after[i] });
        }
    }
}
