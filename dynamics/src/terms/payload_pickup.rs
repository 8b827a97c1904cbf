//! A body that the arm picks up and drops again.

use super::ghost::Ghost;
use super::law::array;
use super::payload::{BODY_COORDINATES, BODY_PARAMETERS, drawn, inertia, parameters};
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated,
    Traits, Words,
};
use crate::Inertia;

/// As a payload, between two times of each recording.
pub static EFFECT: Effect = Effect {
    name: "payload_pickup",
    words: Words::new(
        "Payload for a while",
        "a payload for a while",
        "Something was picked up and put down again that the twin does not know of.",
        "The gripper: what did it hold in that time?",
        "The arm carries {mass_kg} for a while in each recording, from {t_start_s} to {t_end_s}.",
    ),
    family: Family::Body,
    place: PlaceKind::Tool,
    layer: Layer::Body,
    parameters: &{
        let mut all = [Parameter::any("t_start_s"); 12];
        let mut i = 0;
        while i < 10 {
            all[i] = BODY_PARAMETERS[i];
            i += 1;
        }
        all[11] = Parameter::any("t_end_s");
        all
    },
    coordinates: &{
        let mut all = [time("t_start_s"); 12];
        let mut i = 0;
        while i < 10 {
            all[i] = BODY_COORDINATES[i];
            i += 1;
        }
        all[11] = time("t_end_s");
        all
    },
    to_parameters: |c| [&parameters(&array(c))[..], &c[10..]].concat(),
    to_coordinates: |p| [&inertia(&array(p)).parameters()[..], &p[10..]].concat(),
    simpler: None,
    limit: None,
    excitation: Excitation::Poses,
    simulated: Simulated::CarriedForAWhile,
    concealed: Some(|draw| drawn(draw, Some([[0.2, 0.4], [0.6, 0.85]]))),
    traits: Traits::NONE,
    build: |site, values| {
        let inertia = Inertia::from_parameters(array(values));
        let window_s = Some(array(&values[10..]));
        Ghost::boxed(&EFFECT, site, values, inertia, window_s)
    },
};

const fn time(name: &'static str) -> Coordinate {
    Coordinate {
        name,
        kind: CoordinateKind::RecordingTime,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, motion, run};
    use super::*;

    #[test]
    fn is_there_between_its_times() {
        let robot = TwoJoints::new();
        let site = robot.site_for(PlaceKind::Tool);
        let mut values = vec![2.0, 0.1, 0.0, 0.2, 0.1, 0.0, 0.0, 0.1, 0.0, 0.05];
        let mut payload = (super::super::payload::EFFECT.build)(&site, &values);
        values.extend([0.3, 0.6]);
        let mut pickup = (EFFECT.build)(&site, &values);
        let motion = motion(&robot.model, 100);
        let always = run(&mut *payload, &motion);
        for (i, (at, now)) in motion.iter().zip(run(&mut *pickup, &motion)).enumerate() {
            let there = (0.3..0.6).contains(&at.time_s);
            assert_eq!(now, if there { always[i] } else { [0.0; 2] });
        }
        assert!(pickup.inertia().is_none());
    }
}
