//! Friction with elastic presliding: the `LuGre` model.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simpler, Simulated, Site, Term, Traits, Words,
};

/// The `LuGre` model with a static friction that equals the kinetic one (Canudas de Wit, Olsson, Åström
/// and Lischinsky, "A New Model for Control of Systems with Friction", 1995, equations 1 to 3), written
/// in the normalised bristle deflection u = σ0 z / Fc, which is ±1 during sliding, and κ = σ0 / Fc:
///
/// effort = Fc u + σ1 (qd - |qd| u),   du/dt = κ (qd - |qd| u)
pub(super) static EFFECT: Effect = Effect {
    name: "presliding_hysteresis",
    words: Words::new(
        "Pre-sliding hysteresis",
        "presliding hysteresis",
        "Friction is elastic before the joint slips, so it builds up gradually after each reversal.",
        "",
        "The friction of joint {place}, {coulomb_nm}, builds up elastically after each reversal, with a presliding stiffness of {bristle_stiffness_nm_per_rad}.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -3.5,
    parameters: &[
        Parameter::at_least("coulomb_nm", 0.0),
        Parameter::at_least("bristle_stiffness_nm_per_rad", 0.0),
        Parameter::at_least("bristle_damping_nms_per_rad", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_nm"),
        Coordinate::positive_factor("bristle_damping_nms_per_rad"),
        Coordinate::shape("stiffness_by_coulomb_per_rad", 3.0, 3000.0, 14, Scale::Log),
    ],
    to_parameters: |c| vec![c[0], c[2] * c[0], c[1]],
    to_coordinates: |p| vec![p[0], p[2], p[1] / p[0].max(1e-9)],
    simpler: Some(Simpler {
        effect: &super::coulomb_friction::EFFECT,
        numbers: &["coulomb_nm"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::Nearest(
        |p| vec![super::Quantity::DryFriction(p[0])],
        "only the dry friction is exported; a simulator lets a joint at rest creep or holds it, without an elastic deflection",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let (yields_rad, damping_s) = (draw.chance.between(0.01, 0.03), 0.01);
        Drawn::new(draw.efforts_nm(), move |f| {
            let stiffness = f / yields_rad;
            vec![
                ("coulomb_nm", f),
                ("bristle_stiffness_nm_per_rad", stiffness),
                ("bristle_damping_nms_per_rad", stiffness * damping_s),
            ]
        })
    }),
    traits: Traits {
        is_fast: true,
        ..Traits::NONE
    },
    build: |site, values| Box::new(PreslidingHysteresis::new(site, array(values))),
};

#[derive(Debug)]
struct PreslidingHysteresis {
    joint: usize,
    /// Fc, σ1, κ.
    values: [f64; 3],
    /// Bristle deflection u relative to that during sliding, -1 to 1.
    deflection: f64,
    velocity: Option<f64>,
}

impl PreslidingHysteresis {
    fn new(site: &Site<'_>, values: [f64; 3]) -> Self {
        Self {
            joint: site.joint,
            values,
            deflection: 0.0,
            velocity: None,
        }
    }
}

impl Term for PreslidingHysteresis {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.deflection = 0.0;
        self.velocity = None;
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let [coulomb, damping, steepness] = self.values;
        let velocity = at.velocity[self.joint];
        let before = self.velocity.unwrap_or(velocity);
        if at.dt_s > 0.0 || self.velocity.is_none() {
            // Over the distance moved the deflection approaches ±1 exponentially, at any speed.
            let distance = 0.5 * (before + velocity) * at.dt_s;
            let aim = distance.signum();
            let left = (-steepness * distance.abs()).exp();
            self.deflection = aim + (self.deflection - aim) * left;
            self.velocity = Some(velocity);
        }
        let stretching = velocity - velocity.abs() * self.deflection;
        effort[self.joint] += coulomb * self.deflection + damping * stretching;
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    /// The published model, integrated by small Euler steps.
    #[test]
    fn agrees_with_the_published_equations() {
        let (coulomb, stiffness, damping) = (3.0, 140.0, 1.4);
        let robot = TwoJoints::new();
        let coordinates = (EFFECT.to_coordinates)(&[coulomb, stiffness, damping]);
        let mut term = (EFFECT.build)(&robot.site(), &coordinates);
        let speed = |t: f64| 0.2 * (2.0 * t).sin() + 0.05 * (9.0 * t).cos();
        let (mut z, steps) = (0.0_f64, 1000);
        let mut worst = 0.0_f64;
        for k in 0..600 {
            let (dt, t) = (0.01, 0.01 * f64::from(k));
            let v = speed(t);
            if k > 0 {
                for i in 0..steps {
                    let part = (f64::from(i) + 0.5) / f64::from(steps);
                    let v = speed(t - dt + part * dt);
                    z += dt / f64::from(steps) * (v - stiffness / coulomb * v.abs() * z);
                }
            }
            let rate = v - stiffness / coulomb * v.abs() * z;
            let expected = stiffness * z + damping * rate;
            let at = sample(
                if k > 0 { dt } else { 0.0 },
                t,
                [0.0; 2],
                [v, 0.0],
                [0.0; 2],
            );
            let mut effort = [0.0; 2];
            term.act(&at.view(), &mut effort);
            worst = worst.max((effort[0] - expected).abs());
        }
        assert!(worst < 0.02, "{worst} of 3 N m");
    }

    #[test]
    fn slides_at_the_coulomb_effort() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[2.0, 1.0, 500.0]);
        let mut effort = [0.0; 2];
        for k in 0..100 {
            effort = [0.0; 2];
            let at = sample(0.01, 0.01 * f64::from(k), [0.0; 2], [-0.5, 0.0], [0.0; 2]);
            term.act(&at.view(), &mut effort);
        }
        assert!((effort[0] + 2.0).abs() < 1e-9);
    }
}
