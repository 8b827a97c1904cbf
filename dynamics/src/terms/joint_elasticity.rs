//! Elasticity of a joint: a spring between rotor and link.

use super::law::array;
use super::split_joint::split_joint;
use super::two_masses::{Deviation, Oscillator, Transmission};
use super::{
    Compliance, Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale,
    Simpler, Simulated, Traits, Words,
};

/// Share of the critical damping that the link has against a rotor that stands still. It is none of the
/// parameters: motions of robots do not show it.
/// Physical: resonances of geared joints have damping ratios of about 0.02 to 0.1.
const DAMPING_RATIO: f64 = 0.05;

/// A spring between rotor and link, T = -K δ - D δ̇ with the damping D = 2 ζ √(K M), ζ = 0.05, and a rotor of
/// inertia J. The encoder is on the rotor; the link starts at rest against it.
pub(super) static EFFECT: Effect = Effect {
    name: "joint_elasticity",
    words: Words::new(
        "Joint elasticity",
        "joint elasticity",
        "The gear or its flexspline twists under load, so that the link follows behind the motor.",
        "Joint {place}: gear and flexspline; a loose screw between gear and link gives, too.",
        "Joint {place} is elastic, {stiffness_nm_per_rad}, behind a rotor of {rotor_inertia_kgm2}.",
    ),
    family: Family::Transmission,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -4.0,
    parameters: &[
        Parameter::at_least("stiffness_nm_per_rad", 1.0),
        Parameter::at_least("rotor_inertia_kgm2", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("rotor_inertia_kgm2"),
        Coordinate::shape("stiffness_nm_per_rad", 5.0, 1e5, 18, Scale::Log),
    ],
    to_parameters: |c| vec![c[1], c[0]],
    to_coordinates: |p| vec![p[1], p[0]],
    simpler: Some(Simpler {
        effect: &super::rotor_inertia::EFFECT,
        numbers: &["rotor_inertia_kgm2"],
    }),
    excitation: Excitation::Fast,
    exported: super::Exported::No(
        "an elastic joint is two joints in series, the rotor in between: the tree of bodies has to be changed by hand",
    ),
    simulated: Simulated::Transmission(|x, inertia| Compliance {
        stiffness: x[1],
        damping: 2.0 * DAMPING_RATIO * (x[1] * inertia).sqrt(),
        half_gap: None,
    }),
    concealed: Some(|draw| {
        let rotor = draw.moved_kgm2()? * draw.chance.between(0.02, 0.1);
        // Not so soft that it sags by more than a twentieth of a radian.
        let softest = 20.0 * draw.largest_nm.max(0.1);
        Drawn::new([1e-5, 1.0 / softest], move |give| {
            vec![
                ("stiffness_nm_per_rad", 1.0 / give),
                ("rotor_inertia_kgm2", rotor),
            ]
        })
    }),
    traits: Traits {
        is_fast: true,
        ..Traits::NONE
    },
    build: |site, values| {
        let between = Spring(array::<2>(values)[1].max(1.0));
        split_joint(&EFFECT, site, values, between)
    },
};

/// Its stiffness \[N m/rad\].
#[derive(Debug)]
struct Spring(f64);

impl Transmission for Spring {
    fn settled(&self, inertia: f64, forcing: f64) -> Deviation {
        Deviation {
            angle: forcing * inertia / self.0,
            rate: 0.0,
        }
    }

    fn advance(&self, inertia: f64, from: Deviation, forcing: [f64; 2], dt_s: f64) -> Deviation {
        let frequency = (self.0 / inertia).sqrt();
        Oscillator::new(frequency, DAMPING_RATIO, dt_s).step(from, forcing)
    }

    fn acceleration(&self, inertia: f64, at: Deviation) -> f64 {
        let frequency = (self.0 / inertia).sqrt();
        -frequency * (frequency * at.angle + 2.0 * DAMPING_RATIO * at.rate)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, motion, run};
    use super::super::two_masses::tests::simulated;
    use super::*;

    #[test]
    fn agrees_with_a_simulation_of_both_masses_from_soft_to_stiff() {
        let robot = TwoJoints::new();
        let motion = motion(&robot.model, 200);
        // Upright, at about 1.3 kg m².
        for (stiffness, tolerance) in [(150.0, 0.05), (2000.0, 0.05), (30_000.0, 0.05)] {
            let mut term = (EFFECT.build)(&robot.site(), &[0.0, stiffness]);
            let ours = run(&mut *term, &motion);
            let damping = |inertia: f64| 2.0 * DAMPING_RATIO * (stiffness * inertia).sqrt();
            let mut angle = 0.0;
            let mut data = crate::Data::new(&robot.model);
            for _ in 0..100 {
                let mut q = motion[0].position;
                q[0] += angle;
                let (qd, qdd) = (motion[0].velocity, motion[0].acceleration);
                let load = crate::rnea(&robot.model, &mut data, &q, &qd, &qdd)[0];
                angle = -load / stiffness;
            }
            let expected = simulated(&robot, 200, angle, |at, inertia| {
                -stiffness * at.angle - damping(inertia) * at.rate
            });
            let (mut scale, mut worst) = (0.0_f64, 0.0_f64);
            for (ours, expected) in ours.iter().zip(&expected) {
                for j in 0..2 {
                    scale = scale.max(expected[j].abs());
                    worst = worst.max((ours[j] - expected[j]).abs());
                }
            }
            assert!(worst < tolerance * scale, "{stiffness}: {worst} of {scale}");
        }
    }

    #[test]
    fn a_very_stiff_joint_is_rigid() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[0.0, 1e7]);
        for effort in run(&mut *term, &motion(&robot.model, 200)) {
            assert!(effort.iter().all(|e| e.abs() < 0.05), "{effort:?}");
        }
    }
}
