//! A holding brake that releases late: its coil must build up a field before the armature lifts off, and until then
//! the joint drags the brake (VDI 2241 part 1, *Switch-operated clutches and brakes*, 1982: separation time).

use super::gauge::Gauge;
use super::law::array;
use super::{
    Against, Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Scale, Simulated, Site, Term, Traits, Words, sign,
};

/// Effort F exp(-(t / T)⁸) sgn(qd), where t is the time since the joint was last at rest: all of F until shortly
/// before T, then nothing, because a released armature lifts off at once.
pub(super) static EFFECT: Effect = Effect {
    name: "late_brake",
    words: Words::new(
        "Brake that lets go late",
        "a brake that lets go late",
        "After each standstill the joint first drags its brake along, until the brake lets go.",
        "Joint {place}: the brake, its air gap and lining, its supply voltage under load, and the delay that the drive waits.",
        "The brake of joint {place} still drags with {drag_nm} as a motion begins, and lets go after {release_s}.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -7.0,
    parameters: &[
        Parameter::at_least("drag_nm", 0.0),
        Parameter::at_least("release_s", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("drag_nm"),
        Coordinate::shape("release_s", 0.1, 2.0, 7, Scale::Log),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No("no attribute has a brake that drags on after it was released"),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let release = draw.chance.between(0.15, 0.6);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![("drag_nm", f), ("release_s", release)]
        })
    }),
    traits: Traits {
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| Box::new(LateBrake::new(site, array(values))),
};

/// Shortest release time of a brake \[s\].
/// Resolution: keeps a quotient finite; far below a sample.
const FASTEST_S: f64 = 1e-6;

#[derive(Debug)]
struct LateBrake {
    joint: usize,
    values: [f64; 2],
    since_rest: Gauge,
}

impl LateBrake {
    fn new(site: &Site<'_>, values: [f64; 2]) -> Self {
        Self {
            joint: site.joint,
            values,
            since_rest: Gauge::new(Against::SinceRest, site.joint, 0.0),
        }
    }
}

impl Term for LateBrake {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.since_rest.reset();
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let [drag, release_s] = self.values;
        let late = self.since_rest.read(at) / release_s.max(FASTEST_S);
        effort[self.joint] += drag * (-late.powi(8)).exp() * sign(at.velocity[self.joint]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    /// Efforts of the first joint, which rests for a second and then moves, every 0.01 s.
    fn efforts(values: &[f64], velocity: f64) -> Vec<f64> {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), values);
        let at = |k: u32| {
            let v = if k < 100 { 0.0 } else { velocity };
            let at = sample(0.01, 0.01 * f64::from(k), [0.0; 2], [v, 0.0], [0.0; 2]);
            let mut effort = [0.0; 2];
            term.act(&at.view(), &mut effort);
            assert_eq!(effort[1], 0.0);
            effort[0]
        };
        (0..300).map(at).collect()
    }

    #[test]
    fn it_drags_as_a_motion_begins_and_then_lets_go() {
        for direction in [1.0, -1.0] {
            let efforts = efforts(&[2.0, 0.4], 0.5 * direction);
            assert!((efforts[110] - 2.0 * direction).abs() < 0.02);
            assert!(efforts[170].abs() < 1e-3);
        }
    }
}
