//! A base that is tilted differently in one recording than in the others.

use super::base_tilt::BaseTilt;
use super::ghost::While;
use super::law::array;
use super::payload_pickup::time;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated,
    Traits, Words,
};

/// As `base_tilt`, between two times of the session that enclose a recording.
pub(super) static EFFECT: Effect = Effect {
    name: "base_tilt_in_recording",
    words: Words::new(
        "Base tilt in one recording",
        "a base that is tilted in one recording",
        "In one recording the base is tilted differently from the others.",
        "The support of the base: a vehicle that was parked elsewhere, a cart on soft ground, a loose foot?",
        "In recording {recording} the base is tilted differently from the others: roll {roll_rad}, pitch {pitch_rad}.",
    ),
    family: Family::Mounting,
    place: PlaceKind::Base,
    layer: Layer::Body,
    odds_nats: -7.0,
    parameters: &[
        Parameter::any("roll_rad"),
        Parameter::any("pitch_rad"),
        Parameter::any("t_start_s"),
        Parameter::any("t_end_s"),
    ],
    coordinates: &[
        Coordinate::bending_factor("roll_rad"),
        Coordinate::bending_factor("pitch_rad"),
        time("t_start_s", CoordinateKind::SessionTime),
        time("t_end_s", CoordinateKind::SessionTime),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::No(
        "simulate that recording by a scenario of its own that has a `base_tilt`",
    ),
    concealed: None,
    traits: Traits {
        is_off_list: true,
        fills_recording: true,
        most_at_one_place: 8,
        ..Traits::NONE
    },
    build: |site, values| {
        let there = While::InSession(array(&values[2..]));
        BaseTilt::boxed(&EFFECT, site, values, there)
    },
};

#[cfg(test)]
mod tests {
    use super::super::base_tilt;
    use super::super::tests::{TwoJoints, assert_near, motion, run};
    use super::*;
    use crate::Model;

    #[test]
    fn leans_in_its_part_of_the_session_alone() {
        let robot = TwoJoints::new();
        let site = robot.site_for(PlaceKind::Base);
        let motion = motion(&robot.model, 100);
        let session_s: Vec<f64> = motion.iter().map(|at| at.view().session_s).collect();
        let middle_s = 0.5 * (session_s[0] + session_s[99]);
        let mut always = (base_tilt::EFFECT.build)(&site, &[0.1, -0.2]);
        let mut there = (EFFECT.build)(&site, &[0.1, -0.2, session_s[0] - 0.1, middle_s]);
        let always = run(&mut *always, &motion);
        for (i, now) in run(&mut *there, &motion).into_iter().enumerate() {
            let leans = session_s[i] < middle_s;
            assert_near(now, if leans { always[i] } else { [0.0; 2] });
        }
        // The robot itself stays level before and after.
        let mut model: Model = robot.model.clone();
        assert!(!there.alter(&mut model));
        assert_eq!(model.gravity(), robot.model.gravity());
    }
}
