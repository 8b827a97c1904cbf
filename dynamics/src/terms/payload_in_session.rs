//! A body that the arm puts down once and does not pick up again, or picks up and keeps.

use super::ghost::{Ghost, While};
use super::law::array;
use super::payload::{BODY_COORDINATES, BODY_PARAMETERS};
use super::payload_pickup::{coordinates_with_times, parameters_with_times, time, with_times};
use super::{
    CoordinateKind, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};
use crate::Inertia;

/// As a payload, from the start of the session to some time, or from some time to its end.
pub static EFFECT: Effect = Effect {
    name: "payload_in_session",
    words: Words::new(
        "Payload in a part of the session",
        "a payload in a part of the session",
        "Once in the session something was put down for good, or picked up and kept.",
        "The gripper and the tool: what was put down or picked up then?",
        "From {t_start_s} to {t_end_s} of the session the arm carries {mass_kg}, and not in the rest of it.",
    ),
    family: Family::Body,
    place: PlaceKind::Tool,
    layer: Layer::Body,
    odds_nats: -7.0,
    parameters: &with_times(
        BODY_PARAMETERS,
        Parameter::any("t_start_s"),
        Parameter::any("t_end_s"),
    ),
    coordinates: &with_times(
        BODY_COORDINATES,
        time("t_start_s", CoordinateKind::SessionTime),
        time("t_end_s", CoordinateKind::SessionTime),
    ),
    to_parameters: parameters_with_times,
    to_coordinates: coordinates_with_times,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::No(
        "simulate the recordings before and after it by scenarios of their own, one of which has a `payload`",
    ),
    concealed: None,
    traits: Traits {
        is_off_list: true,
        in_session: true,
        ..Traits::NONE
    },
    build: |site, values| {
        let body = Inertia::from_parameters(array(values));
        Ghost::boxed(
            &EFFECT,
            site,
            values,
            body,
            While::InSession(array(&values[10..])),
        )
    },
};

#[cfg(test)]
mod tests {
    use super::super::tests::{Instant, TwoJoints, assert_near, motion, run};
    use super::*;

    #[test]
    fn is_there_in_its_part_of_the_session() {
        let robot = TwoJoints::new();
        let site = robot.site_for(PlaceKind::Tool);
        let mut values = vec![2.0, 0.1, 0.0, 0.2, 0.1, 0.0, 0.0, 0.1, 0.0, 0.05];
        let mut payload = (super::super::payload::EFFECT.build)(&site, &values);
        let motion = motion(&robot.model, 100);
        let session_s = |at: &Instant| at.view().session_s;
        let (first, last) = (session_s(&motion[0]), session_s(&motion[99]));
        values.extend([first - 0.1, 0.5 * (first + last)]);
        let mut there = (EFFECT.build)(&site, &values);
        let always = run(&mut *payload, &motion);
        for (i, (at, now)) in motion.iter().zip(run(&mut *there, &motion)).enumerate() {
            let is_there = session_s(at) < 0.5 * (first + last);
            assert_near(now, if is_there { always[i] } else { [0.0; 2] });
        }
        assert!(there.inertia().is_none());
    }
}
