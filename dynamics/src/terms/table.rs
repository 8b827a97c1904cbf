//! A residual that no effect of the library explains, as a measured curve.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::gauge::Gauge;
use super::words::number;
use super::{
    Effect, Excitation, Family, Layer, MotionSample, PlaceKind, Simulated, Site, Term, TermError,
    Traits, Words, sign,
};
use crate::Model;

/// An effect without a name: its only parameter is a [`Table`].
pub static EFFECT: Effect = Effect {
    name: "unknown",
    words: Words::new(
        "Unknown",
        "something that no name fits",
        "An effort that no effect of the library explains; the correction only describes it.",
        "Joint {place}: look at it, and at its sensor, while it moves as in the recordings.",
        "Joint {place} has an effort that no effect of the library explains.",
    ),
    family: Family::Unnamed,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.0,
    parameters: &[],
    coordinates: &[],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No("a curve has no attribute; an unknown body is written"),
    simulated: Simulated::Joint,
    concealed: None,
    traits: Traits {
        describes_only: true,
        ..Traits::NONE
    },
    // The default curve is zero.
    build: |site, _| {
        let table = Table {
            against: Against::Position,
            of_joint: site.joint,
            by_direction: false,
            period: None,
            knots: vec![0.0],
            values: vec![0.0],
        };
        Box::new(Curve {
            joint: site.joint,
            gauge: table.gauge(),
            table,
        })
    },
};

/// Argument of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// Position of a joint \[rad or m\].
    Position,
    /// Velocity of a joint \[rad/s or m/s\].
    Velocity,
    /// Velocity of a joint minus that of the next one in the URDF: the relative velocity of parts that rub
    /// \[rad/s or m/s\].
    VelocityDifference,
    /// Sum of these two velocities, for axes that point in opposite directions \[rad/s or m/s\].
    VelocitySum,
    /// Acceleration of a joint \[rad/s² or m/s²\].
    Acceleration,
    /// Effort that a joint's gear transmits \[N m or N\].
    Load,
    /// Transmitted effort times the direction of motion: positive if the joint drives the load, negative if the load
    /// drives the joint \[N m or N\].
    DrivenLoad,
    /// Change of a joint's load since its last reversal, limited to the outer knots \[N m or N\].
    LoadTurned,
    /// Time since a joint was last at rest \[s\].
    SinceRest,
    /// Distance that a joint has moved since its last reversal \[rad or m\].
    SinceTurn,
    /// Time since the start of the recording \[s\].
    RecordingTime,
    /// Time since the start of the session \[s\].
    SessionTime,
}

/// A piecewise linear curve, constant beyond its knots or periodic.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Argument of the curve.
    pub against: Against,
    /// Joint whose position, velocity, acceleration or load is the argument.
    pub of_joint: usize,
    /// Whether the effort changes its sign with the joint's direction of motion, like friction.
    pub by_direction: bool,
    /// Period of the argument, if the curve is periodic: longer than the span of the knots.
    pub period: Option<f64>,
    /// Knots, in increasing order.
    pub knots: Vec<f64>,
    /// Effort at the knots \[N m or N\].
    pub values: Vec<f64>,
}

/// A [`Table`] in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableSpec {
    /// Argument of the curve.
    pub against: Against,
    /// Joint whose position, velocity, acceleration or load is the argument; the effect's own by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of_joint: Option<String>,
    /// Whether the effort changes its sign with the joint's direction of motion, like friction.
    #[serde(default)]
    pub by_direction: bool,
    /// Period of the argument, if the curve is periodic: longer than the span of the knots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<f64>,
    /// Knots, in increasing order.
    pub knots: Vec<f64>,
    /// Effort at the knots \[N m or N\].
    pub values: Vec<f64>,
}

impl Table {
    /// Whether it is a curve over the velocity of its own joint, that is, friction of any shape.
    pub fn is_friction_of(&self, joint: usize) -> bool {
        self.against == Against::Velocity && self.of_joint == joint
    }

    /// Sentence of a finding in the joint of index `joint`, named `place`; `joints` are the names of all. `peak` is
    /// the largest effort \[N m or N\] and its argument.
    pub fn sentence(
        &self,
        joint: usize,
        place: &str,
        joints: &[String],
        peak: Option<(f64, f64)>,
    ) -> String {
        let peak = peak.map_or_else(String::new, |(most, at)| {
            format!("; it is largest, {} N m, at {}", number(most), number(at))
        });
        if self.is_friction_of(joint) {
            return format!(
                "The friction of joint {place} is not a sum of Coulomb and viscous friction, and no effect of the library has its shape{peak} rad/s."
            );
        }
        let on = self.depends_on(joint, joints);
        format!(
            "Joint {place} has an effort that no effect of the library explains: it depends on {on}{peak}."
        )
    }

    /// Argument of a curve in the joint of index `joint`, in words; `joints` are the names of all.
    pub fn depends_on(&self, joint: usize, joints: &[String]) -> String {
        let of = if self.of_joint == joint {
            "its own".to_owned()
        } else {
            format!("joint {}'s", joints[self.of_joint])
        };
        let which = format!("joint {}", joints[self.of_joint]);
        let against = match self.against {
            Against::Position => format!("{of} position"),
            Against::Velocity => format!("{of} velocity"),
            Against::VelocityDifference => self.of_two("difference", joints),
            Against::VelocitySum => self.of_two("sum", joints),
            Against::Acceleration => format!("{of} acceleration"),
            Against::Load if self.of_joint == joint => "its load".to_owned(),
            Against::Load => format!("{of} load"),
            Against::DrivenLoad => {
                "its load, and on whether the joint drives the load or is driven by it".to_owned()
            }
            Against::LoadTurned => {
                "the change of its load since the load's last reversal (hysteresis)".to_owned()
            }
            Against::SinceRest => format!("the time since {which} was last at rest"),
            Against::SinceTurn => {
                format!("the distance that {which} has moved since its last reversal")
            }
            Against::RecordingTime => "the time since the start of the recording".to_owned(),
            Against::SessionTime => "the time since the start of the session".to_owned(),
        };
        let direction = if self.by_direction {
            ", and changes its sign with the direction of motion, like friction"
        } else {
            ""
        };
        let repeated = self.period.map_or_else(String::new, |period_s| {
            let (period, rate) = (number(period_s), number(1.0 / period_s));
            format!(", and repeats every {period} s ({rate} Hz)")
        });
        format!("{against}{direction}{repeated}")
    }
}

impl Table {
    /// Combination of two velocities, in words.
    fn of_two(&self, how: &str, joints: &[String]) -> String {
        let (one, next) = (self.of_joint, self.of_joint + 1);
        let next = joints.get(next).map_or("none", String::as_str);
        format!(
            "the {how} of the velocities of joints {} and {next}",
            joints[one]
        )
    }
}

impl TableSpec {
    pub(super) fn of(table: &Table, model: &Model) -> Self {
        Self {
            against: table.against,
            of_joint: Some(model.joints()[table.of_joint].name.clone()),
            by_direction: table.by_direction,
            period: table.period,
            knots: table.knots.clone(),
            values: table.values.clone(),
        }
    }

    pub(super) fn table(&self, of_joint: usize) -> Table {
        Table {
            against: self.against,
            of_joint,
            by_direction: self.by_direction,
            period: self.period,
            knots: self.knots.clone(),
            values: self.values.clone(),
        }
    }
}

/// Creates an `unknown` effect with the curve `table` in the joint of `site`.
///
/// # Errors
/// If there are no knots, not one value per knot, the knots do not increase, the period is not longer than their
/// span, or a number is not finite.
pub fn table(site: &Site<'_>, table: Table) -> Result<Box<dyn Term>, TermError> {
    let wrong = |reason| Err(TermError::Table { reason });
    if table.knots.is_empty() {
        return wrong("`knots` are missing");
    }
    if table.knots.len() != table.values.len() {
        return wrong("`values` are not one per knot");
    }
    let mut numbers = table.knots.iter().chain(&table.values);
    if !numbers.all(|x| x.is_finite()) {
        return wrong("numbers are not all finite");
    }
    if table.knots.windows(2).any(|pair| pair[0] >= pair[1]) {
        return wrong("`knots` do not rise");
    }
    let span = table.knots[table.knots.len() - 1] - table.knots[0];
    if table
        .period
        .is_some_and(|period| !period.is_finite() || period <= span)
    {
        return wrong("`period` is not longer than the span of the knots");
    }
    Ok(Box::new(Curve {
        joint: site.joint,
        gauge: table.gauge(),
        table,
    }))
}

#[derive(Debug)]
struct Curve {
    joint: usize,
    gauge: Gauge,
    table: Table,
}

impl Table {
    /// Creates the gauge of the curve's argument.
    pub fn gauge(&self) -> Gauge {
        let band = self.knots.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        Gauge::new(self.against, self.of_joint, band)
    }

    /// The curve at `x`.
    fn at(&self, x: f64) -> f64 {
        let first = self.knots[0];
        let x = match self.period {
            Some(period) => first + (x - first).rem_euclid(period),
            None => x,
        };
        let next = self.knots.partition_point(|&knot| knot <= x);
        let last = self.knots.len() - 1;
        if next == 0 {
            return self.values[0];
        }
        let (x0, y0) = (self.knots[next - 1], self.values[next - 1]);
        let (x1, y1) = match self.period {
            _ if next <= last => (self.knots[next], self.values[next]),
            Some(period) => (first + period, self.values[0]),
            None => return self.values[last],
        };
        y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    }
}

impl Term for Curve {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &[]
    }

    fn reset(&mut self) {
        self.gauge.reset();
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let value = self.table.at(self.gauge.read(at));
        let direction = if self.table.by_direction {
            sign(at.velocity[self.joint])
        } else {
            1.0
        };
        effort[self.joint] += value * direction;
    }

    fn table(&self) -> Option<&Table> {
        Some(&self.table)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, push};
    use super::*;

    fn curve() -> Table {
        Table {
            against: Against::Position,
            of_joint: 1,
            by_direction: true,
            period: None,
            knots: vec![0.0, 1.0, 3.0],
            values: vec![2.0, 4.0, 0.0],
        }
    }

    #[test]
    fn straight_between_knots_and_held_at_the_ends() {
        let robot = TwoJoints::new();
        let mut term = table(&robot.site(), curve()).unwrap();
        for (q, expected) in [(-1.0, 2.0), (0.0, 2.0), (0.5, 3.0), (2.0, 2.0), (7.0, 0.0)] {
            let effort = push(&mut *term, [0.0, q], [-0.5, 0.0], [0.0; 2]);
            assert_eq!(effort, [-expected, 0.0], "at {q}");
        }
    }

    #[test]
    fn with_a_period_it_repeats_and_closes() {
        let robot = TwoJoints::new();
        let repeated = Table {
            period: Some(4.0),
            by_direction: false,
            ..curve()
        };
        let mut term = table(&robot.site(), repeated).unwrap();
        for (q, expected) in [(0.5, 3.0), (3.5, 1.0), (4.5, 3.0), (-0.5, 1.0), (-4.0, 2.0)] {
            let effort = push(&mut *term, [0.0, q], [0.0; 2], [0.0; 2]);
            assert_eq!(effort, [expected, 0.0], "at {q}");
        }
    }

    #[test]
    fn a_spec_and_back() {
        let robot = TwoJoints::new();
        let term = table(&robot.site(), curve()).unwrap();
        let spec = crate::terms::TermSpec::of(&*term, &robot.site());
        let again = spec.build(&robot.model).unwrap();
        assert_eq!(again.table(), Some(&curve()));
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        let robot = TwoJoints::new();
        let refused = |change: fn(&mut Table)| {
            let mut wrong = curve();
            change(&mut wrong);
            table(&robot.site(), wrong).is_err()
        };
        assert!(refused(|t| t.knots.clear()));
        assert!(refused(|t| t.values.truncate(1)));
        assert!(refused(|t| t.knots.reverse()));
        assert!(refused(|t| t.values[0] = f64::NAN));
        assert!(refused(|t| t.period = Some(3.0)));
    }
}
