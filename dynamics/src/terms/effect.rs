//! What there is to know of a term without its numbers.

use super::concealed::{Draw, Drawn};
use super::export::Exported;
use super::words::Words;
use super::{Site, Term, UNKNOWN};

mod parameter;
#[cfg(test)]
mod tests;

pub use parameter::{Coordinate, CoordinateKind, Parameter, Scale};

/// What there is to know of a term without its numbers. Nobody else asks what is true of an effect of a certain name: what is
/// known of it stands here, in the term's own file.
#[derive(Debug)]
pub struct Effect {
    /// Canonical name.
    pub name: &'static str,
    /// What a report says of it.
    pub words: Words,
    /// What kind of physics it is.
    pub family: Family,
    /// What kind of place it is in.
    pub place: PlaceKind,
    /// Where in the chain from motion to recorded effort it acts.
    pub layer: Layer,
    /// Logarithm of the prior odds that it is met at one place of an arm \[nats\]: next to nothing for friction, -3 for what is
    /// met now and then (a payload, a torque constant), -4 for what is met seldom, -5 for what happens once, and -7 for what
    /// few have met. Chosen: by order of magnitude; no survey was counted.
    pub odds_nats: f64,
    /// Its parameters as files and reports hold them.
    pub parameters: &'static [Parameter],
    /// What a fit searches in; the order of the values that `build` takes.
    pub coordinates: &'static [Coordinate],
    /// Parameters, in their order, from coordinates.
    pub to_parameters: fn(&[f64]) -> Vec<f64>,
    /// Coordinates, in their order, from parameters.
    pub to_coordinates: fn(&[f64]) -> Vec<f64>,
    /// The simpler effect that it contains; `None` if it contains none.
    pub simpler: Option<Simpler>,
    /// The motion that shows it.
    pub excitation: Excitation,
    /// Its form in a simulator's model.
    pub exported: Exported,
    /// How a simulated arm suffers it.
    pub simulated: Simulated,
    /// Draws one at random, to be concealed; `None` for what only describes. Its `sizes` change some effort the more the larger.
    pub concealed: Option<fn(&mut Draw<'_>) -> Option<Drawn>>,
    /// What is true of a few effects only.
    pub traits: Traits,
    /// Makes the term at a site from its coordinates.
    pub build: fn(&Site<'_>, &[f64]) -> Box<dyn Term>,
}

/// There is but one effect of a name.
impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Effect {
    /// When it acts.
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

    /// Whether it is something stiff in space that the arm meets.
    pub fn is_surface(&self) -> bool {
        self.family == Family::Contact && self.time() == Time::Always
    }

    /// Whether it is part of the arm, not something that comes and goes.
    pub fn lasts(&self) -> bool {
        matches!(self.time(), Time::Always | Time::Step) && self.family != Family::Contact
    }

    /// Whether it is Coulomb or viscous friction.
    pub fn is_plain_friction(&self) -> bool {
        self.family == Family::PlainFriction
    }

    /// Whether a twin may hold more of it than there is, so that a correction takes some of it away.
    pub fn may_be_overstated(&self) -> bool {
        self.is_plain_friction() || self.traits.may_be_overstated
    }

    /// Whether it splits its joint in rotor and link.
    pub fn splits_joint(&self) -> bool {
        matches!(self.simulated, Simulated::Transmission(_))
    }

    /// What it is called in reports: what only describes, and what the list of canonical names lacks, is `unknown`.
    pub fn said(&self) -> &'static str {
        if self.traits.describes_only || self.traits.is_off_list {
            UNKNOWN.name
        } else {
            self.name
        }
    }
}

/// What kind of physics an effect is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Coulomb and viscous friction: a curve of friction goes with them, and there may be less of them than a twin says.
    PlainFriction,
    /// Other friction.
    Friction,
    /// A function of the joint's position.
    Spring,
    /// Rotor and gear.
    Transmission,
    /// Inertia of links and of what they carry.
    Body,
    /// How the arm stands.
    Mounting,
    /// Forces from outside.
    Contact,
    /// What the drive or its sensor reports.
    Recording,
    /// No name fits.
    Unnamed,
}

/// When an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Time {
    /// All the time.
    Always,
    /// It changes once in a session.
    Step,
    /// For an interval of every recording.
    EveryRecording,
    /// For an interval of the session.
    Once,
}

/// The motion that shows an effect, those that tell it from the most others last.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Excitation {
    /// Every speed in both directions, from creeping on.
    Speeds,
    /// The whole range of the joint, slowly.
    WholeRange,
    /// Gravity from all sides, and effort of all sizes.
    Poses,
    /// Fast reversals.
    Fast,
}

impl Excitation {
    /// The motion that tells an effect from another.
    #[must_use]
    pub fn between(self, other: Self) -> Self {
        // What every pose or fast reversals show is told from all else by them; a function of position is told from friction by speeds.
        match self.max(other) {
            most @ (Self::Poses | Self::Fast) => most,
            _ => self.min(other),
        }
    }
}

/// A simpler effect that one contains: it has a single number.
#[derive(Debug, Clone, Copy)]
pub struct Simpler {
    /// The simpler one.
    pub effect: &'static Effect,
    /// The parameters that grow as its number does. Of one that changes once, what it is afterwards comes first.
    pub numbers: &'static [&'static str],
}

/// How a simulated arm suffers an effect.
#[derive(Debug, Clone, Copy)]
pub enum Simulated {
    /// Its bodies or gravity are others: [`Term::alter`].
    Model,
    /// It carries the body of the first ten coordinates between the times of the last two.
    CarriedForAWhile,
    /// A force from outside, where the links are.
    Load,
    /// Beside the effort in the joint, on the motor's side.
    Joint,
    /// What comes through between rotor and link, given coordinates and the inertia that the joint moves \[kg m²\]; the
    /// second parameter is the rotor's inertia.
    Transmission(fn(&[f64], f64) -> Compliance),
    /// In what is recorded.
    Record,
    /// Not at all, and why.
    No(&'static str),
}

/// What is between the rotor and the link of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compliance {
    /// \[N m/rad\]
    pub stiffness: f64,
    /// \[N m s/rad\]
    pub damping: f64,
    /// Half the width of the play between them \[rad\]. With play a contact pushes and never pulls.
    pub half_gap: Option<f64>,
}

/// What is true of a few effects only.
#[derive(Debug, Clone, Copy)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a fact of its own, told by name in the few files that give it"
)]
pub struct Traits {
    /// How many of it there may be at one place.
    pub most_at_one_place: usize,
    /// Where two at one place are said as one finding: the names of the second one's parameters.
    pub second: &'static [&'static str],
    /// It depends on what the gear transmits.
    pub needs_load: bool,
    /// It happens within the fastest of the motion, around reversals or in the spring of a gear, which smoothing blurs.
    pub is_fast: bool,
    /// A term of [`Layer::Record`] that only adds.
    pub only_adds: bool,
    /// It is plain dry friction with the opposite sign.
    pub negates_friction: bool,
    /// It only shifts effort or position in time.
    pub shifts_time: bool,
    /// It cuts the effort off at a limit, of a sensor or of a drive: a finding says of which.
    pub cuts_off: bool,
    /// It multiplies all effort of a joint: where nobody knows the joint's scale, it says nothing.
    pub is_scale: bool,
    /// It describes what has no name.
    pub describes_only: bool,
    /// It has a law and a name here, but the list of names that reports may use lacks it. A finding is an `unknown` whose
    /// parameter `kind` is this name, so that who reads reports by that list sees an honest `unknown` with numbers.
    pub is_off_list: bool,
    /// The number of its simpler effect, from its coordinates and a time of the session \[s\], if that changes all the time.
    /// Its coordinates are that number at the start of the session and its growth.
    pub drifts: Option<fn(&[f64], f64) -> f64>,
    /// Its effort is linear in its factors to first order only, so it is computed anew for each of their values.
    pub bends: bool,
    /// It acts through the whole of one recording: its two times are those of a recording's ends.
    pub fills_recording: bool,
    /// It acts from the start of the session to some time, or from some time to its end, in several recordings perhaps.
    pub in_session: bool,
    /// Robot files and twins hold it, and perhaps too much of it.
    pub may_be_overstated: bool,
    /// It is estimated every night, whether it is there or not, and followed over weeks.
    pub is_followed: bool,
    /// What the smallest size that would have been found is told as: its first factor. `None` if that does not make it.
    pub smallest_told_as: Option<&'static str>,
}

impl Traits {
    /// Nothing of all that.
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
        bends: false,
        fills_recording: false,
        in_session: false,
        may_be_overstated: false,
        is_followed: false,
        smallest_told_as: None,
    };
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
