//! A body that the arm picks up and drops again.

use super::ghost::{Ghost, While};
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
    odds_nats: -4.0,
    parameters: &with_times(
        BODY_PARAMETERS,
        Parameter::any("t_start_s"),
        Parameter::any("t_end_s"),
    ),
    coordinates: &with_times(
        BODY_COORDINATES,
        time("t_start_s", CoordinateKind::RecordingTime),
        time("t_end_s", CoordinateKind::RecordingTime),
    ),
    to_parameters: parameters_with_times,
    to_coordinates: coordinates_with_times,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::PASSES),
    simulated: Simulated::CarriedForAWhile,
    concealed: Some(|draw| drawn(draw, Some([[0.2, 0.4], [0.6, 0.85]]))),
    traits: Traits::NONE,
    build: |site, values| {
        let inertia = Inertia::from_parameters(array(values));
        let there = While::InEachRecording(array(&values[10..]));
        Ghost::boxed(&EFFECT, site, values, inertia, there)
    },
};

/// Entries of the ten body parameters, followed by those of two times.
pub(super) const fn with_times<T: Copy>(body: [T; 10], start: T, end: T) -> [T; 12] {
    let [mass, x, y, z, a, b, c, d, e, f] = body;
    [mass, x, y, z, a, b, c, d, e, f, start, end]
}

pub(super) const fn time(name: &'static str, kind: CoordinateKind) -> Coordinate {
    Coordinate { name, kind }
}

pub(super) fn parameters_with_times(c: &[f64]) -> Vec<f64> {
    [&parameters(&array(c))[..], &c[10..]].concat()
}

pub(super) fn coordinates_with_times(p: &[f64]) -> Vec<f64> {
    [&inertia(&array(p)).parameters()[..], &p[10..]].concat()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, assert_near, motion, run};
    use super::*;

    #[test]
    fn is_there_between_its_times() {
        let robot = TwoJoints::new();
        let site = robot.site_for(PlaceKind::Tool);
        let mut values = vec![2.0, 0.1, 0.0, 0.2, 0.1, 0.0, 0.0, 0.1, 0.0, 0.05];
        let mut payload = (super::super::payload::EFFECT.build)(&site, &values);
        // Half way between samples, so that each is either within or without.
        values.extend([0.295, 0.595]);
        let mut pickup = (EFFECT.build)(&site, &values);
        let motion = motion(&robot.model, 100);
        let always = run(&mut *payload, &motion);
        for (i, (at, now)) in motion.iter().zip(run(&mut *pickup, &motion)).enumerate() {
            let there = (0.295..0.595).contains(&at.time_s);
            assert_near(now, if there { always[i] } else { [0.0; 2] });
        }
        assert!(pickup.inertia().is_none());
    }
}
