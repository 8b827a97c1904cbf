//! Form of effects in simulators' models.

use super::{Effect, TermSpec};

/// A quantity of a simulator's model. Signs are those of the joint's axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quantity {
    /// Viscous friction \[N m s/rad or N s/m\].
    Damping(f64),
    /// Friction that does not depend on speed \[N m or N\].
    DryFriction(f64),
    /// Dry friction at rest, where that is larger than in motion \[N m or N\].
    StaticFriction(f64),
    /// Inertia of the rotor, seen at the joint \[kg m² or kg\].
    Armature(f64),
    /// A spring.
    Spring {
        /// Stiffness \[N m/rad or N/m\].
        stiffness: f64,
        /// Position without force \[rad or m\].
        rest: f64,
    },
    /// Error of the joint's zero \[rad or m\]: if the encoder reads q, the joint is at q + this.
    Zero(f64),
    /// A body's mass, centre of mass and inertia ([`super::Term::inertia`]).
    Body,
    /// The direction of gravity in the base ([`super::Term::alter`]).
    Gravity,
}

/// The form of an effect in a simulator's model.
#[derive(Debug, Clone, Copy)]
pub enum Exported {
    /// Exactly by these quantities, from its parameters.
    As(fn(&[f64]) -> Vec<Quantity>),
    /// Approximately by these quantities; the sentence states the loss.
    Nearest(fn(&[f64]) -> Vec<Quantity>, &'static str),
    /// Not exported, with the reason.
    No(&'static str),
}

/// Reason for effects of the recording.
pub const OF_RECORDING: &str = "it is in what is recorded, not in the arm: mend the recording";
/// Reason for temporary effects.
pub const PASSES: &str = "it comes and goes: it belongs to a scenario, not to the model";
/// Reason for effects that change once or continuously.
pub const CHANGES: &str = "it changes in time; twin.yaml has what is left of it now as a simpler effect, which is written";

impl Effect {
    /// The quantities of a term of this effect, and the loss of an approximation.
    ///
    /// # Errors
    /// The reason why no simulator has a matching quantity.
    pub fn quantities(
        &self,
        spec: &TermSpec,
    ) -> Result<(Vec<Quantity>, Option<&'static str>), &'static str> {
        let value = |p: &super::Parameter| {
            spec.parameters
                .get(p.name)
                .copied()
                .or(p.default)
                .unwrap_or(0.0)
        };
        let values: Vec<f64> = self.parameters.iter().map(value).collect();
        match self.exported {
            Exported::As(of) => Ok((of(&values), None)),
            Exported::Nearest(of, lost) => Ok((of(&values), Some(lost))),
            Exported::No(why) => Err(why),
        }
    }
}
