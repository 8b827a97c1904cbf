//! The physics that a rigid-body twin leaves out, each term written once: the twin adds it, the
//! simulated cell suffers it, an explanation fits it.
//!
//! A term is one file with an [`Effect`] that describes it and a [`Term`] that computes it; it is
//! known once it stands in [`EFFECTS`]. Names and parameters are canonical: files and reports hold
//! them. A fit does not search in the parameters but in [`Coordinate`]s in which the effort is as
//! linear as it can be, e.g. `A sin(q - q0)` by the factors of `sin q` and `cos q`.

mod asymmetric_coulomb;
mod backlash;
mod base_tilt;
mod cable_spring;
mod contact_wall;
mod coulomb_friction;
mod counterbalance_spring;
mod expansion;
mod external_push;
mod friction_step;
mod ghost;
mod joint_elasticity;
mod law;
mod link_com;
mod link_inertia;
mod link_mass;
mod load_dependent_friction;
mod payload;
mod payload_pickup;
mod physics;
mod presliding_hysteresis;
mod quadratic_drag;
mod rotor_inertia;
mod spec;
mod stribeck_friction;
mod table;
mod temperature_viscous;
#[cfg(test)]
mod tests;
mod torque_bias;
mod torque_delay;
mod torque_gain;
mod torque_lowpass;
mod torque_ripple;
mod torque_saturation;
mod transmission_coupling;
mod two_masses;
mod viscous_friction;

use std::sync::Arc;

use crate::{Inertia, Model};

pub use expansion::Expansion;
pub use physics::Physics;
pub use spec::{TermError, TermSpec};
pub use table::{Against, Table, TableSpec, table};

/// Every effect there is.
pub static EFFECTS: &[&Effect] = &[
    &viscous_friction::EFFECT,
    &coulomb_friction::EFFECT,
    &stribeck_friction::EFFECT,
    &asymmetric_coulomb::EFFECT,
    &load_dependent_friction::EFFECT,
    &presliding_hysteresis::EFFECT,
    &quadratic_drag::EFFECT,
    &temperature_viscous::EFFECT,
    &friction_step::EFFECT,
    &rotor_inertia::EFFECT,
    &torque_gain::EFFECT,
    &torque_bias::EFFECT,
    &transmission_coupling::EFFECT,
    &counterbalance_spring::EFFECT,
    &cable_spring::EFFECT,
    &torque_ripple::EFFECT,
    &payload::EFFECT,
    &link_mass::EFFECT,
    &link_com::EFFECT,
    &link_inertia::EFFECT,
    &base_tilt::EFFECT,
    &external_push::EFFECT,
    &contact_wall::EFFECT,
    &payload_pickup::EFFECT,
    &torque_delay::EFFECT,
    &torque_lowpass::EFFECT,
    &torque_saturation::EFFECT,
    &joint_elasticity::EFFECT,
    &backlash::EFFECT,
    &table::EFFECT,
];

/// The effect of that canonical name.
pub fn effect(name: &str) -> Option<&'static Effect> {
    EFFECTS.iter().copied().find(|effect| effect.name == name)
}

/// Over this speed the sign of a velocity is smoothed \[rad/s\].
pub const SIGN_SMOOTHING_RAD_S: f64 = 0.002;

/// The sign of a velocity \[rad/s\], smooth through standstill so that it has a value at rest and a
/// simulation can be integrated through a reversal: tanh(qd / 0.002 rad/s).
#[inline]
pub fn sign(velocity: f64) -> f64 {
    let x = velocity / SIGN_SMOOTHING_RAD_S;
    // Beyond this tanh is 1 in double precision.
    if x.abs() > 19.1 { x.signum() } else { x.tanh() }
}

/// What there is to know of a term without its numbers.
#[derive(Debug)]
pub struct Effect {
    /// Canonical name.
    pub name: &'static str,
    /// What kind of place it is in.
    pub place: PlaceKind,
    /// Where in the chain from motion to recorded effort it acts.
    pub layer: Layer,
    /// Its parameters as files and reports hold them.
    pub parameters: &'static [Parameter],
    /// What a fit searches in; the order of the values that `build` takes.
    pub coordinates: &'static [Coordinate],
    /// Parameters, in their order, from coordinates.
    pub to_parameters: fn(&[f64]) -> Vec<f64>,
    /// Coordinates, in their order, from parameters.
    pub to_coordinates: fn(&[f64]) -> Vec<f64>,
    /// Makes the term at a site from its coordinates.
    pub build: fn(&Site<'_>, &[f64]) -> Box<dyn Term>,
}

/// What kind of place an effect is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceKind {
    /// One joint.
    Joint,
    /// One joint, and another that it is driven by ([`Site::source`]).
    TwoJoints,
    /// A moving link.
    Link,
    /// What is held or touched at the end of the arm: the tool link.
    Tool,
    /// The base link.
    Base,
    /// All joints alike.
    All,
}

/// Where in the chain from motion to recorded effort a term acts. Within a layer the order is that of
/// the list of terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// It changes what the bodies cost: payload, tilt, elasticity, external forces. Adds to the effort.
    Body,
    /// It acts at a joint beside the transmitted effort: friction, springs, rotor inertia. Adds.
    Joint,
    /// It changes what is recorded: gain, bias, delay. Transforms all that came before it.
    Record,
}

/// A parameter of an effect, as files hold it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Canonical name, with its unit.
    pub name: &'static str,
    /// The least value that is physically possible.
    pub minimum: f64,
    /// What it is where a file does not give it; `None` if it must be given.
    pub default: Option<f64>,
}

/// A number that a fit searches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinate {
    /// For messages and tests.
    pub name: &'static str,
    /// How it enters the effort.
    pub kind: CoordinateKind,
}

impl Parameter {
    /// A parameter that a file must give.
    pub const fn at_least(name: &'static str, minimum: f64) -> Self {
        Self {
            name,
            minimum,
            default: None,
        }
    }

    /// A parameter of any value that a file must give.
    pub const fn any(name: &'static str) -> Self {
        Self::at_least(name, f64::NEG_INFINITY)
    }

    /// The same, but a file may leave it out.
    #[must_use]
    pub const fn or(self, default: f64) -> Self {
        Self {
            default: Some(default),
            ..self
        }
    }
}

impl Coordinate {
    /// A factor of either sign.
    pub const fn factor(name: &'static str) -> Self {
        Self {
            name,
            kind: CoordinateKind::Factor {
                step: 1.0,
                minimum: f64::NEG_INFINITY,
            },
        }
    }

    /// A factor that is not negative.
    pub const fn positive_factor(name: &'static str) -> Self {
        Self {
            name,
            kind: CoordinateKind::Factor {
                step: 1.0,
                minimum: 0.0,
            },
        }
    }

    /// A shape that is first tried at `steps` values.
    pub const fn shape(
        name: &'static str,
        lower: f64,
        upper: f64,
        steps: usize,
        scale: Scale,
    ) -> Self {
        Self {
            name,
            kind: CoordinateKind::Shape {
                lower,
                upper,
                steps,
                scale,
            },
        }
    }
}

/// How a coordinate enters the effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CoordinateKind {
    /// As a factor, exactly or to first order about 0: with all factors 0 (and some shape) the term does
    /// nothing, or what its shape alone does. `step` is small enough for a difference quotient (1 where
    /// it is exact); the fitted value may not be below `minimum`.
    Factor {
        /// Step of the difference quotient.
        step: f64,
        /// The least value that is physically possible.
        minimum: f64,
    },
    /// In any other way: searched between `lower` and `upper`.
    Shape {
        /// Lowest value worth a try.
        lower: f64,
        /// Highest value worth a try.
        upper: f64,
        /// How many values to try first.
        steps: usize,
        /// How they are spread.
        scale: Scale,
    },
    /// A time within each recording \[s from its start\].
    RecordingTime,
    /// A time within the session \[s from the start of its first recording\].
    SessionTime,
}

/// How values of a shape are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By a constant ratio.
    Log,
    /// As shares of the largest effort of the joint.
    OfEffort,
}

/// Where a term is: indices into the model's joints and links. What the effect's [`PlaceKind`] does not
/// ask for is passed over.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// The robot.
    pub model: &'a Model,
    /// The joint.
    pub joint: usize,
    /// The joint that drives it, for [`PlaceKind::TwoJoints`].
    pub source: usize,
    /// The link.
    pub link: usize,
}

/// One instant of a motion; slices hold one number per joint in URDF order.
#[derive(Debug, Clone, Copy)]
pub struct MotionSample<'a> {
    /// Time since the sample before \[s\]; 0 for the first and for a repeated stamp.
    pub dt_s: f64,
    /// Time since the start of the recording \[s\].
    pub recording_s: f64,
    /// Time since the start of the session, the first recording \[s\].
    pub session_s: f64,
    /// Position \[rad or m\].
    pub position: &'a [f64],
    /// Velocity \[rad/s or m/s\].
    pub velocity: &'a [f64],
    /// Acceleration \[rad/s² or m/s²\].
    pub acceleration: &'a [f64],
    /// Effort that the gears transmit, friction left out: the rigid body's with the [`Layer::Body`]
    /// terms \[N m or N\]. For terms of that layer the rigid body's alone.
    pub transmitted: &'a [f64],
}

/// One piece of physics with its numbers, at one place of one robot.
///
/// What it does is told as effort of the motor: friction that holds a joint back by 4 N m costs
/// +4 N m while the joint moves forward. The torque on the joint is the opposite.
pub trait Term: std::fmt::Debug + Send {
    /// What it is.
    fn effect(&self) -> &'static Effect;

    /// Its coordinates, in the effect's order.
    fn coordinates(&self) -> &[f64];

    /// Forgets what came before: a new recording or a gap.
    fn reset(&mut self) {}

    /// Changes `effort` (per joint in URDF order) by what this term does at this instant, given all that
    /// came since the last [`Term::reset`]; to be called once per sample, in order. [`Layer::Record`]
    /// terms find the effort of all that came before them and transform it, others add to it. Does not
    /// allocate.
    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]);

    /// Takes what bodies cost along the motion that the following calls of [`Term::act`] go through, sample by sample
    /// and over any [`Term::reset`]: for terms that move a link by a little, which need not ask for it then.
    fn expand(&mut self, _along: &Arc<Expansion>) {}

    /// Makes the change part of the model where it is one of rigid bodies or of gravity; `false` if it
    /// is not.
    fn alter(&self, _model: &mut Model) -> bool {
        false
    }

    /// The inertia that it adds at a link's frame for good, if that is what it is.
    fn inertia(&self) -> Option<(usize, Inertia)> {
        None
    }

    /// The curve of an `unknown` effect: all there is to it.
    fn table(&self) -> Option<&Table> {
        None
    }
}
