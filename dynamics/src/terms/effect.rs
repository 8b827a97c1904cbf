//! What there is to know of a term without its numbers.

use super::{Site, Term};

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
