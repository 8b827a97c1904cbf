//! A joint whose rotor and link are two masses, with a spring or play in between.

/// Share of the critical damping that the link has against a rotor that stands still, as in the term
/// `joint_elasticity`.
const SPRING_DAMPING: f64 = 0.05;
/// Natural frequency \[rad/s\] and damping ratio of the contact on either side of the play, as in the term
/// `backlash`.
const CONTACT_FREQUENCY: f64 = 300.0;
const CONTACT_DAMPING: f64 = 0.7;
/// A spring is taken where it is as a step begins, which takes no energy off it, unless the lighter mass
/// would swing through more than this in a step \[rad²\]; then it is taken where the step ends.
const SLOW: f64 = 0.1;

/// What is between rotor and link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// Gives way \[N m/rad\].
    Spring { stiffness: f64 },
    /// Comes through only on either side of it: half its width \[rad\].
    Play { half: f64 },
}

/// The rotor of a joint. Its encoder is what is recorded; the link moves as it likes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rotor {
    pub joint: usize,
    pub kind: Kind,
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
    /// How far the link hangs behind a rotor at rest that holds `load` \[rad\]. `inertia` is what the
    /// joint moves \[kg m²\].
    pub fn sag(&self, load: f64, inertia: f64) -> f64 {
        match self.kind {
            Kind::Spring { stiffness } => -load / stiffness,
            Kind::Play { half } => {
                let stiffness = inertia * CONTACT_FREQUENCY * CONTACT_FREQUENCY;
                -load / stiffness - half.copysign(load)
            }
        }
    }

    /// What comes through in a step of `dt_s` that begins with the link at `position` and `velocity`.
    pub fn coupling(&self, position: f64, velocity: f64, inertia: f64, dt_s: f64) -> Coupling {
        let twist = self.position - position;
        let (stiffness, damping, twist) = match self.kind {
            Kind::Spring { stiffness } => (
                stiffness,
                2.0 * SPRING_DAMPING * (stiffness * inertia).sqrt(),
                twist,
            ),
            Kind::Play { half } => {
                let depth = twist - twist.clamp(-half, half);
                let stiffness = inertia * CONTACT_FREQUENCY * CONTACT_FREQUENCY;
                let damping = 2.0 * CONTACT_DAMPING * CONTACT_FREQUENCY * inertia;
                let push = stiffness * depth + damping * (self.velocity - velocity);
                // A contact pushes and never pulls.
                if depth * push <= 0.0 {
                    return Coupling::default();
                }
                (stiffness, damping, depth)
            }
        };
        let lighter = self.inertia.min(inertia);
        let implicit = stiffness * dt_s * dt_s > SLOW * lighter;
        Coupling {
            torque: stiffness * twist,
            slope: damping + if implicit { stiffness * dt_s } else { 0.0 },
        }
    }
}
