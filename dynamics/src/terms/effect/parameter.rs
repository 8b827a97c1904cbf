//! Parameters of an effect, for files and reports, and coordinates, for a fit.

use crate::terms::words::unit;

/// A parameter of an effect in files.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Canonical name, with its unit.
    pub name: &'static str,
    /// Unit; empty for a pure number.
    pub unit: &'static str,
    /// Smallest physically possible value.
    pub minimum: f64,
    /// Value if a file does not give it; `None` if it must be given.
    pub default: Option<f64>,
}

/// A coordinate that a fit searches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinate {
    /// Name for messages and tests.
    pub name: &'static str,
    /// Role in the effort.
    pub kind: CoordinateKind,
}

impl Parameter {
    /// A mandatory parameter. Its name must end in its unit; a parameter without unit is a [`Parameter::ratio`].
    ///
    /// # Panics
    /// At compile time, if the name does not end in a unit.
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

    /// A mandatory pure number.
    pub const fn ratio(name: &'static str, minimum: f64) -> Self {
        Self {
            name,
            unit: "",
            minimum,
            default: None,
        }
    }

    /// A mandatory parameter of any value.
    pub const fn any(name: &'static str) -> Self {
        Self::at_least(name, f64::NEG_INFINITY)
    }

    /// Makes the parameter optional, with this default.
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

/// Role of a coordinate in the effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CoordinateKind {
    /// Linear factor, exactly or to first order about 0: with all factors 0 (and some shape) the term has no effect,
    /// or only that of its shape. `step` is small enough for a difference quotient (1 if the effort is exactly
    /// linear); the fitted value may not be below `minimum`.
    Factor {
        /// Step of the difference quotient.
        step: f64,
        /// Smallest physically possible value.
        minimum: f64,
    },
    /// Nonlinear shape, searched between `lower` and `upper`.
    Shape {
        /// Lowest value of the search.
        lower: f64,
        /// Highest value of the search.
        upper: f64,
        /// Number of values of the initial grid.
        steps: usize,
        /// Spacing of the grid.
        scale: Scale,
    },
    /// A time within each recording \[s from its start\].
    RecordingTime,
    /// A time within the session \[s from the start of its first recording\].
    SessionTime,
}

/// Spacing of the grid of a shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Even.
    Linear,
    /// Even, as waves over a turn of the joint: no more than its positions resolve.
    Waves,
    /// By a constant ratio.
    Log,
    /// As shares of the largest effort of the joint.
    OfEffort,
}
