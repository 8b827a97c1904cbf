//! A joint whose rotor and link are two masses, with a spring or play in between.

use tauscope_dynamics::terms::{Compliance, Term};

/// A spring is taken where it is as a step begins, which takes no energy off it, unless the lighter mass
/// would swing through more than this in a step \[rad²\]; then it is taken where the step ends.
/// Resolution: the error of the explicit integration, against its energy being kept.
const SLOW: f64 = 0.1;

/// The rotor of a joint. Its encoder is what is recorded; the link moves as it likes.
#[derive(Debug, Clone)]
pub(super) struct Rotor {
    pub joint: usize,
    /// Coordinates of the term, and what is between rotor and link by them and the inertia that the joint moves.
    coordinates: Vec<f64>,
    compliance: fn(&[f64], f64) -> Compliance,
    /// \[kg m²\]
    pub inertia: f64,
    /// \[rad\]
    pub position: f64,
    /// \[rad/s\]
    pub velocity: f64,
}

/// Torque on the link, and what makes it grow in a step \[N m, N m s/rad\]:
/// `torque + slope (rotor velocity - link velocity)` with the velocities at the end of the step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Coupling {
    pub torque: f64,
    pub slope: f64,
}

impl Coupling {
    pub fn at(&self, rotor_velocity: f64, link_velocity: f64) -> f64 {
        self.torque + self.slope * (rotor_velocity - link_velocity)
    }
}

impl Rotor {
    /// The rotor of a term that splits its joint.
    pub fn new(term: &dyn Term, compliance: fn(&[f64], f64) -> Compliance, joint: usize) -> Self {
        let coordinates = term.coordinates().to_vec();
        Self {
            joint,
            inertia: (term.effect().to_parameters)(&coordinates)[1],
            coordinates,
            compliance,
            position: 0.0,
            velocity: 0.0,
        }
    }

    /// How far the link hangs behind a rotor at rest that holds `load` \[rad\]. `inertia` is what the
    /// joint moves \[kg m²\].
    pub fn sag(&self, load: f64, inertia: f64) -> f64 {
        let between = (self.compliance)(&self.coordinates, inertia);
        let half = between.half_gap.unwrap_or(0.0);
        -load / between.stiffness - half.copysign(load)
    }

    /// What comes through in a step of `dt_s` that begins with the link at `position` and `velocity`.
    pub fn coupling(&self, position: f64, velocity: f64, inertia: f64, dt_s: f64) -> Coupling {
        let Compliance {
            stiffness,
            damping,
            half_gap,
        } = (self.compliance)(&self.coordinates, inertia);
        let mut twist = self.position - position;
        if let Some(half) = half_gap {
            twist -= twist.clamp(-half, half);
            let push = stiffness * twist + damping * (self.velocity - velocity);
            // A contact pushes and never pulls.
            if twist * push <= 0.0 {
                return Coupling::default();
            }
        }
        let lighter = self.inertia.min(inertia);
        let implicit = stiffness * dt_s * dt_s > SLOW * lighter;
        Coupling {
            torque: stiffness * twist,
            slope: damping + if implicit { stiffness * dt_s } else { 0.0 },
        }
    }
}
