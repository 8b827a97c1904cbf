//! A joint with backlash in its transmission.

use super::law::array;
use super::split_joint::split_joint;
use super::two_masses::{Deviation, Oscillator, Transmission};
use super::{
    Compliance, Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale,
    Simpler, Simulated, Traits, Words,
};

/// Natural frequency \[rad/s\] and damping ratio of the contact on either side of the gap.
/// Chosen: it settles within about 20 ms without bouncing, as fast as the comparison responds. A stiffer contact only
/// turns the noise of a measured acceleration into impacts.
const CONTACT_FREQUENCY: f64 = 300.0;
/// Physical: about 1/√2, at which a second-order step response hardly overshoots.
const CONTACT_DAMPING: f64 = 0.7;

/// Longest integration step within the gap \[s\].
/// Physical: a third of the contact's time constant, 1 / 300 rad/s.
const STEP_S: f64 = 1e-3;
/// Largest number of steps between two samples.
/// Resolution: bounds the computing time after a gap of more than 0.2 s, over which the motion is unknown.
const MOST_STEPS: f64 = 200.0;

/// Rotor and link are separated by a gap of a given total width. Within the gap no torque is transmitted; on either
/// side a stiff, damped contact pushes and never pulls. The rotor has the inertia J and carries the encoder; the link
/// starts at rest on the side that it loads.
pub(super) static EFFECT: Effect = Effect {
    name: "backlash",
    words: Words::new(
        "Backlash",
        "backlash",
        "Play in the gear: for a moment after each reversal the motor turns alone.",
        "Joint {place}: play between motor and link; gear, coupling, key and their screws.",
        "Joint {place} has a play of {gap_rad} behind a rotor of {rotor_inertia_kgm2}.",
    ),
    family: Family::Transmission,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -4.0,
    parameters: &[
        Parameter::at_least("gap_rad", 0.0),
        Parameter::at_least("rotor_inertia_kgm2", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("rotor_inertia_kgm2"),
        Coordinate::shape("gap_rad", 0.0003, 0.035, 10, Scale::Log),
    ],
    to_parameters: |c| vec![c[1], c[0]],
    to_coordinates: |p| vec![p[1], p[0]],
    simpler: Some(Simpler {
        effect: &super::rotor_inertia::EFFECT,
        numbers: &["rotor_inertia_kgm2"],
    }),
    excitation: Excitation::Fast,
    exported: super::Exported::No(
        "a gear with play is two joints in series, the rotor in between: the tree of bodies has to be changed by hand",
    ),
    simulated: Simulated::Transmission(|x, inertia| Compliance {
        stiffness: inertia * CONTACT_FREQUENCY * CONTACT_FREQUENCY,
        damping: 2.0 * CONTACT_DAMPING * CONTACT_FREQUENCY * inertia,
        half_gap: Some(0.5 * x[1]),
    }),
    concealed: Some(|draw| {
        let rotor = draw.moved_kgm2()? * draw.chance.between(0.02, 0.1);
        Drawn::new([5e-4, 0.03], move |gap| {
            vec![("gap_rad", gap), ("rotor_inertia_kgm2", rotor)]
        })
    }),
    traits: Traits {
        is_fast: true,
        is_followed: true,
        ..Traits::NONE
    },
    build: |site, values| {
        let between = Play {
            half: 0.5 * array::<2>(values)[1].max(0.0),
        };
        split_joint(&EFFECT, site, values, between)
    },
};

#[derive(Debug)]
struct Play {
    /// Half the width of the gap \[rad\].
    half: f64,
}

impl Play {
    /// Penetration of the link into a contact \[rad\].
    fn depth(&self, angle: f64) -> f64 {
        angle - angle.clamp(-self.half, self.half)
    }

    /// Acceleration by the contact; 0 without contact or if the contact would pull.
    fn push(&self, at: Deviation) -> f64 {
        let depth = self.depth(at.angle);
        let push =
            -CONTACT_FREQUENCY * (CONTACT_FREQUENCY * depth + 2.0 * CONTACT_DAMPING * at.rate);
        if push * depth < 0.0 { push } else { 0.0 }
    }
}

impl Transmission for Play {
    fn settled(&self, _inertia: f64, forcing: f64) -> Deviation {
        let depth = forcing / (CONTACT_FREQUENCY * CONTACT_FREQUENCY);
        Deviation {
            angle: depth + self.half.copysign(forcing),
            rate: 0.0,
        }
    }

    fn advance(&self, _inertia: f64, from: Deviation, forcing: [f64; 2], dt_s: f64) -> Deviation {
        let steps = (dt_s / STEP_S).ceil().clamp(1.0, MOST_STEPS);
        let h = dt_s / steps;
        let contact = Oscillator::new(CONTACT_FREQUENCY, CONTACT_DAMPING, h);
        let slope = (forcing[1] - forcing[0]) / steps;
        let mut at = from;
        for k in 0..steps as u32 {
            let now = forcing[0] + slope * f64::from(k);
            let pushed = self.push(at) != 0.0;
            if pushed {
                let side = self.half.copysign(at.angle);
                at.angle -= side;
                at = contact.step(at, [now, now + slope]);
                at.angle += side;
            } else {
                let mean = now + 0.5 * slope;
                at.angle += h * (at.rate + 0.5 * h * mean);
                at.rate += h * mean;
            }
        }
        at
    }

    fn acceleration(&self, _inertia: f64, at: Deviation) -> f64 {
        self.push(at)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, motion, run};
    use super::super::two_masses::tests::simulated;
    use super::*;

    #[test]
    fn agrees_with_a_simulation_of_both_masses_away_from_impacts() {
        let robot = TwoJoints::new();
        let gap = 0.01;
        let motion = motion(&robot.model, 300);
        let mut term = (EFFECT.build)(&robot.site(), &[0.0, gap]);
        let ours = run(&mut *term, &motion);
        let play = Play { half: gap / 2.0 };
        let forcing = -motion[0].transmitted[0];
        let start = play.settled(1.0, forcing).angle;
        let expected = simulated(&robot, 300, start, |at, inertia| inertia * play.push(at));
        let mut off: Vec<_> = ours
            .iter()
            .zip(&expected)
            .map(|(ours, expected)| (ours[0] - expected[0]).abs())
            .collect();
        let largest = expected
            .iter()
            .fold(0.0_f64, |most, e| most.max(e[0].abs()));
        off.sort_by(f64::total_cmp);
        assert!(largest > 2.0, "it is felt: {largest}");
        assert!(off[off.len() * 9 / 10] < 0.1, "{}", off[off.len() * 9 / 10]);
    }

    #[test]
    fn without_play_the_joint_is_rigid() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[0.0, 0.0]);
        for effort in run(&mut *term, &motion(&robot.model, 200)) {
            assert!(effort.iter().all(|e| e.abs() < 0.1), "{effort:?}");
        }
    }
}
