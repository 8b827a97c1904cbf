//! Static description of an effect: name, place, parameters, limits, wording.

use super::concealed::{Draw, Drawn};
use super::export::Exported;
use super::words::Words;
use super::{Site, Term, UNKNOWN};

mod parameter;
#[cfg(test)]
mod tests;

pub use parameter::{Coordinate, CoordinateKind, Parameter, Scale};

/// Static description of an effect. All properties of an effect are defined in its own file; no other code tests for
/// the name of an effect.
#[derive(Debug)]
pub struct Effect {
    /// Canonical name.
    pub name: &'static str,
    /// Wording in reports.
    pub words: Words,
    /// Kind of physics.
    pub family: Family,
    /// Kind of place.
    pub place: PlaceKind,
    /// Stage of the chain from motion to recorded effort at which it acts.
    pub layer: Layer,
    /// Logarithm of its prior odds at one place of an arm \[nats\]: about 0 for friction, -3 for an occasional effect
    /// (a payload, a torque constant), -4 for a rare one, -5 for a single event, and -7 for a very rare effect.
    /// Chosen: by order of magnitude; no survey was counted.
    pub odds_nats: f64,
    /// Parameters in files and reports.
    pub parameters: &'static [Parameter],
    /// Coordinates that a fit searches; the order of the values that `build` takes.
    pub coordinates: &'static [Coordinate],
    /// Computes the parameters, in their order, from coordinates.
    pub to_parameters: fn(&[f64]) -> Vec<f64>,
    /// Computes the coordinates, in their order, from parameters.
    pub to_coordinates: fn(&[f64]) -> Vec<f64>,
    /// The simpler effect that it contains; `None` if it contains none.
    pub simpler: Option<Simpler>,
    /// Motion that excites it.
    pub excitation: Excitation,
    /// Its form in a simulator's model.
    pub exported: Exported,
    /// Form in the simulated arm.
    pub simulated: Simulated,
    /// Draws a random instance to conceal; `None` for purely descriptive effects. A larger one of its `sizes` changes
    /// some effort more.
    pub concealed: Option<fn(&mut Draw<'_>) -> Option<Drawn>>,
    /// Properties of only a few effects.
    pub traits: Traits,
    /// Builds the term at a site from its coordinates.
    pub build: fn(&Site<'_>, &[f64]) -> Box<dyn Term>,
}

/// Names are unique.
impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Effect {
    /// Whether its effort is linear in its factors to first order only, so that it is recomputed for each of their
    /// values.
    pub fn bends(&self) -> bool {
        let bends =
            |c: &Coordinate| matches!(c.kind, CoordinateKind::Factor { step, .. } if step < 1.0);
        self.coordinates.iter().any(bends)
    }

    /// Time during which it acts.
    pub fn time(&self) -> Time {
        let count = |kind| self.coordinates.iter().filter(|c| c.kind == kind).count();
        match (
            count(CoordinateKind::RecordingTime),
            count(CoordinateKind::SessionTime),
        ) {
            (0, 0) => Time::Always,
            (0, 1) => Time::Step,
            (_, 0) => Time::EveryRecording,
            _ => Time::Once,
        }
    }

    /// Whether it is a stiff surface in space that the arm touches.
    pub fn is_surface(&self) -> bool {
        self.family == Family::Contact && self.time() == Time::Always
    }

    /// Whether it is a lasting property of the arm, not a temporary event.
    pub fn lasts(&self) -> bool {
        matches!(self.time(), Time::Always | Time::Step) && self.family != Family::Contact
    }

    /// Whether it is Coulomb or viscous friction.
    pub fn is_plain_friction(&self) -> bool {
        self.family == Family::PlainFriction
    }

    /// Whether a twin may contain too much of it, so that a correction reduces it.
    pub fn may_be_overstated(&self) -> bool {
        self.is_plain_friction() || self.traits.may_be_overstated
    }

    /// Whether it splits its joint into rotor and link.
    pub fn splits_joint(&self) -> bool {
        matches!(self.simulated, Simulated::Transmission(_))
    }

    /// Name in reports: `unknown` for purely descriptive effects and for those that are not in the list of canonical
    /// names.
    pub fn said(&self) -> &'static str {
        if self.traits.describes_only || self.traits.is_off_list {
            UNKNOWN.name
        } else {
            self.name
        }
    }
}

/// Kind of physics of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Coulomb and viscous friction. A curve of friction is searched together with them, and a twin may contain too
    /// much of them.
    PlainFriction,
    /// Other friction.
    Friction,
    /// A function of the joint's position.
    Spring,
    /// Rotor and gear.
    Transmission,
    /// Inertia of links and of their loads.
    Body,
    /// Mounting of the arm.
    Mounting,
    /// External forces.
    Contact,
    /// Report of the drive or its sensor.
    Recording,
    /// No effect of the library fits.
    Unnamed,
}

/// Time during which an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// All the time.
    Always,
    /// It changes once in a session.
    Step,
    /// During an interval of every recording.
    EveryRecording,
    /// During an interval of the session.
    Once,
}

/// Motion that excites an effect; those that distinguish it from the most other effects come last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Excitation {
    /// All speeds in both directions, including very low ones.
    Speeds,
    /// The whole range of the joint, slowly.
    WholeRange,
    /// Gravity from all directions, and effort of all sizes.
    Poses,
    /// Fast reversals.
    Fast,
}

impl Excitation {
    /// Motion that distinguishes two effects.
    #[must_use]
    pub fn between(self, other: Self) -> Self {
        // Poses and fast reversals distinguish their effects from all others; speeds distinguish functions of
        // position from friction.
        match self.max(other) {
            most @ (Self::Poses | Self::Fast) => most,
            _ => self.min(other),
        }
    }
}

/// A simpler effect with a single parameter that an effect contains.
#[derive(Debug, Clone, Copy)]
pub struct Simpler {
    /// The simpler effect.
    pub effect: &'static Effect,
    /// Parameters that correspond to the parameter of the simpler effect. For an effect that changes once, the value
    /// after the change comes first.
    pub numbers: &'static [&'static str],
}

/// Form of an effect in the simulated arm.
#[derive(Debug, Clone, Copy)]
pub enum Simulated {
    /// Changed bodies or gravity: [`Term::alter`].
    Model,
    /// A body of the first ten coordinates, carried between the times of the last two.
    CarriedForAWhile,
    /// An external force at the present pose of the links.
    Load,
    /// An additional effort in the joint, on the motor's side.
    Joint,
    /// Compliance between rotor and link, from coordinates and the inertia that the joint moves \[kg m²\]; the second
    /// parameter is the rotor's inertia.
    Transmission(fn(&[f64], f64) -> Compliance),
    /// A change of the recorded effort.
    Record,
    /// Not simulated, with the reason.
    No(&'static str),
}

/// Compliance between the rotor and the link of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compliance {
    /// Stiffness \[N m/rad\].
    pub stiffness: f64,
    /// Damping \[N m s/rad\].
    pub damping: f64,
    /// Half the width of the gap between them \[rad\]. With a gap, a contact pushes and never pulls.
    pub half_gap: Option<f64>,
}

/// Properties of only a few effects.
#[derive(Debug, Clone, Copy)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a fact of its own, told by name in the few files that give it"
)]
pub struct Traits {
    /// Largest number of instances at one place.
    pub most_at_one_place: usize,
    /// Names of the second instance's parameters, if two at one place are reported as one finding.
    pub second: &'static [&'static str],
    /// It depends on the effort that the gear transmits.
    pub needs_load: bool,
    /// It acts in the fastest part of the motion, around reversals or in the spring of a gear, which smoothing blurs.
    pub is_fast: bool,
    /// A term of [`Layer::Record`] that only adds.
    pub only_adds: bool,
    /// It is Coulomb friction with the opposite sign.
    pub negates_friction: bool,
    /// It only shifts effort or position in time.
    pub shifts_time: bool,
    /// It limits the effort, as a sensor's or a drive's range does; a finding names the limited one.
    pub cuts_off: bool,
    /// It multiplies the whole effort of a joint: without a known scale of the joint it carries no information.
    pub is_scale: bool,
    /// It describes a residual without a known cause.
    pub describes_only: bool,
    /// It has a law and a name here, but is not in the list of names that reports may use. A finding is an `unknown`
    /// with this name in the parameter `kind`, so that readers of the standard list see an `unknown` with its
    /// parameters.
    pub is_off_list: bool,
    /// Parameter of its simpler effect, from its coordinates and a time of the session \[s\], if it changes
    /// continuously. Its coordinates are this parameter at the start of the session and its growth.
    pub drifts: Option<fn(&[f64], f64) -> f64>,
    /// It acts during one whole recording: its two times are the ends of a recording.
    pub fills_recording: bool,
    /// It acts from the start of the session to some time, or from some time to its end, possibly over several
    /// recordings.
    pub in_session: bool,
    /// Robot files and twins contain it, possibly too much of it.
    pub may_be_overstated: bool,
    /// It is estimated every night, whether present or not, and followed over weeks.
    pub is_followed: bool,
    /// Parameter in which the detection limit is reported: its first factor. `None` if this factor does not make the
    /// effect.
    pub smallest_told_as: Option<&'static str>,
}

impl Traits {
    /// No special property.
    pub const NONE: Self = Self {
        most_at_one_place: 1,
        second: &[],
        needs_load: false,
        is_fast: false,
        only_adds: false,
        negates_friction: false,
        shifts_time: false,
        cuts_off: false,
        is_scale: false,
        describes_only: false,
        is_off_list: false,
        drifts: None,
        fills_recording: false,
        in_session: false,
        may_be_overstated: false,
        is_followed: false,
        smallest_told_as: None,
    };
}

/// Kind of place of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceKind {
    /// One joint.
    Joint,
    /// One joint, and a second one that drives it ([`Site::source`]).
    TwoJoints,
    /// A moving link.
    Link,
    /// The tool link, at the end of the arm.
    Tool,
    /// The base link.
    Base,
    /// All joints alike.
    All,
}

/// Stage of the chain from motion to recorded effort at which a term acts. Within a layer the order is that of the
/// list of terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// Changes the effort of the bodies: payload, tilt, elasticity, external forces. Adds to the effort.
    Body,
    /// Acts at a joint, in addition to the transmitted effort: friction, springs, rotor inertia. Adds.
    Joint,
    /// Changes the recorded effort: gain, bias, delay. Transforms the effort of all preceding terms.
    Record,
}
