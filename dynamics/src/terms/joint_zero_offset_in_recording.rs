//! A joint whose zero differs in one recording from that in the others.

use super::ghost::While;
use super::joint_zero_offset::JointZeroOffset;
use super::law::array;
use super::payload_pickup::time;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated,
    Traits, Words,
};

/// As `joint_zero_offset`, between two times of the session that enclose a recording.
pub(super) static EFFECT: Effect = Effect {
    name: "joint_zero_offset_in_recording",
    words: Words::new(
        "Joint zero offset in one recording",
        "a joint zero that is off in one recording",
        "In one recording the joint stands elsewhere than its recorded position says, by a constant.",
        "Joint {place}: does its encoder slip on the shaft, or was the joint mastered anew between recordings?",
        "In recording {recording} the zero of joint {place} is another one than in the others: the joint stands at its \
         recorded position plus {offset_rad}.",
    ),
    family: Family::Mounting,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -7.0,
    parameters: &[
        Parameter::any("offset_rad"),
        Parameter::any("t_start_s"),
        Parameter::any("t_end_s"),
    ],
    coordinates: &[
        Coordinate::bending_factor("offset_rad"),
        time("t_start_s", CoordinateKind::SessionTime),
        time("t_end_s", CoordinateKind::SessionTime),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::No(
        "simulate that recording by a scenario of its own that has a `joint_zero_offset`",
    ),
    concealed: None,
    traits: Traits {
        is_off_list: true,
        fills_recording: true,
        most_at_one_place: 8,
        ..Traits::NONE
    },
    build: |site, values| {
        let there = While::InSession(array(&values[1..]));
        JointZeroOffset::boxed(&EFFECT, site, values, there)
    },
};

#[cfg(test)]
mod tests {
    use super::super::joint_zero_offset;
    use super::super::tests::{TwoJoints, assert_near, motion, run};
    use super::*;

    #[test]
    fn is_off_in_its_part_of_the_session_alone() {
        let robot = TwoJoints::new();
        let site = robot.site();
        let motion = motion(&robot.model, 100);
        let session_s: Vec<f64> = motion.iter().map(|at| at.view().session_s).collect();
        let middle_s = 0.5 * (session_s[0] + session_s[99]);
        let mut always = (joint_zero_offset::EFFECT.build)(&site, &[0.1]);
        let mut there = (EFFECT.build)(&site, &[0.1, session_s[0] - 0.1, middle_s]);
        let always = run(&mut *always, &motion);
        for (i, now) in run(&mut *there, &motion).into_iter().enumerate() {
            let is_off = session_s[i] < middle_s;
            assert_near(now, if is_off { always[i] } else { [0.0; 2] });
        }
        // The robot itself stays as it is.
        assert!(!there.alter(&mut robot.model.clone()));
    }
}
