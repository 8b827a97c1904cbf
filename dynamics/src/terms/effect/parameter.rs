//! The numbers of an effect: parameters, as files and reports hold them, and coordinates, which a fit searches.

use crate::terms::words::unit;

/// A parameter of an effect, as files hold it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Canonical name, with its unit.
    pub name: &'static str,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
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
    /// A parameter that a file must give. Its name must end in its unit: what does not is a [`Parameter::ratio`].
    ///
    /// # Panics
    /// If the name does not end in a unit: when a constant is compiled, not later.
    pub const fn at_least(name: &'static str, minimum: f64) -> Self {
        let Some((_, unit)) = unit(name) else {
            panic!("the name of a parameter ends in its unit");
        };
        Self {
            name,
            unit,
            minimum,
            default: None,
        }
    }

    /// A pure number that a file must give.
    pub const fn ratio(name: &'static str, minimum: f64) -> Self {
        Self {
            name,
            unit: "",
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

    /// A factor of any sign whose effort is linear for small values only: an angle or a length \[rad or m\].
    pub const fn bending_factor(name: &'static str) -> Self {
        Self {
            name,
            kind: CoordinateKind::Factor {
                step: 1e-3,
                minimum: f64::NEG_INFINITY,
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
    /// Evenly, as waves over a turn of the joint: no more than its positions resolve.
    Waves,
    /// By a constant ratio.
    Log,
    /// As shares of the largest effort of the joint.
    OfEffort,
}
