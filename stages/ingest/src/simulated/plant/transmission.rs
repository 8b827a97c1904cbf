//! Two-mass joints: rotor and link, coupled by a spring or backlash.

use tauscope_dynamics::terms::{Compliance, Term};

/// Largest squared phase of the lighter mass's oscillation per step for which the spring is integrated
/// explicitly, which conserves its energy \[rad²\]. A stiffer spring is integrated implicitly.
/// Resolution: the error of the explicit integration, against conservation of energy.
const SLOW: f64 = 0.1;

/// The rotor of a joint. It carries the recorded encoder; the link moves independently.
#[derive(Debug, Clone)]
pub(super) struct Rotor {
    pub joint: usize,
    /// Coordinates of the term.
    coordinates: Vec<f64>,
    /// Coupling of rotor and link, from the coordinates and the inertia that the joint moves.
    compliance: fn(&[f64], f64) -> Compliance,
    /// Rotor inertia \[kg m²\].
    pub inertia: f64,
    /// Rotor position \[rad\].
    pub position: f64,
    /// Rotor velocity \[rad/s\].
    pub velocity: f64,
}

/// Torque on the link, linear in the velocities at the end of the step \[N m, N m s/rad\]:
/// `torque + slope (rotor velocity - link velocity)`.
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
    /// Creates the rotor of a term that splits its joint.
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

    /// Returns the deflection of the link from a rotor at rest that holds `load` \[rad\]. `inertia` is the
    /// inertia that the joint moves \[kg m²\].
    pub fn sag(&self, load: f64, inertia: f64) -> f64 {
        let between = (self.compliance)(&self.coordinates, inertia);
        let half = between.half_gap.unwrap_or(0.0);
        -load / between.stiffness - half.copysign(load)
    }

    /// Returns the coupling in a step of `dt_s` that begins with the link at `position` and `velocity`.
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
            // Unilateral: a contact pushes and never pulls.
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
