//! One effect of an explanation: its kind, its place and its parameters.

use tauscope_dynamics::terms::{
    Against, Coordinate, CoordinateKind, Effect, Family, Layer, PlaceKind, Table, Term, table,
};
use tauscope_dynamics::{Inertia, Model};

pub use tauscope_dynamics::terms::Time as TimeKind;

pub use crate::physics::whereabouts::Whereabouts;

/// Number of inertial parameters of a body.
/// Physical: a mass, three first moments of mass, and six elements of the inertia tensor.
pub const BODY: usize = 10;

/// The scale between a joint's torque and its recorded effort, see `torque_scale.rs`.
pub const TORQUE_SCALE: &str = "torque_scale";

/// An effect at a place, without parameters.
#[derive(Debug, Clone, Copy)]
pub struct Hypothesis {
    /// The kind of effect.
    pub effect: &'static Effect,
    /// Its place.
    pub place: Whereabouts,
}

impl PartialEq for Hypothesis {
    fn eq(&self, other: &Self) -> bool {
        self.effect == other.effect && self.place == other.place
    }
}

impl Hypothesis {
    /// Returns the effect with these coordinates.
    pub fn with(self, coordinates: Vec<f64>) -> Active {
        Active {
            hypothesis: self,
            coordinates,
            curve: None,
        }
    }

    /// Returns the only joint whose effort it changes, if there is just one.
    pub fn only_joint(&self) -> Option<usize> {
        let at_joint = matches!(self.effect.place, PlaceKind::Joint | PlaceKind::TwoJoints);
        (at_joint && (self.effect.layer != Layer::Body || self.is_torque_scale()))
            .then_some(self.place.joint)
    }

    /// Whether it depends on the effort that the gear transmits.
    pub fn needs_load(&self) -> bool {
        self.effect.traits.needs_load
    }

    /// Whether its first ten coordinates are those of a body, see [`Inertia::parameters`].
    pub fn is_body(&self) -> bool {
        self.effect.place == PlaceKind::Tool && self.effect.coordinates.len() >= BODY
    }

    /// Whether it is the scale between a joint's torque and its recorded effort.
    pub fn is_torque_scale(&self) -> bool {
        self.effect.name == TORQUE_SCALE
    }

    /// Whether it couples the effort of one joint into the recording of another.
    pub fn is_coupling(&self) -> bool {
        self.effect.place == PlaceKind::TwoJoints
    }

    /// Whether it splits a joint into rotor and link. Such effects are slow to evaluate.
    pub fn has_rotor(&self) -> bool {
        self.effect.splits_joint()
    }

    /// Whether it is Coulomb or viscous friction.
    pub fn is_plain_friction(&self) -> bool {
        self.effect.is_plain_friction()
    }

    /// Whether every joint with a gear has it: plain friction or a rotor.
    pub fn is_ordinary(&self) -> bool {
        let is_rotor = self.effect.family == Family::Transmission && self.is_linear();
        self.is_plain_friction() || is_rotor && self.only_joint() == Some(self.place.joint)
    }

    /// Whether it shifts efforts or positions in time.
    pub fn is_of_timing(&self) -> bool {
        self.effect.traits.shifts_time
    }

    /// Returns its dependence on time.
    pub fn time_kind(&self) -> TimeKind {
        self.effect.time()
    }

    /// Whether it is a lasting property of the arm, not a temporary event.
    pub fn lasts(&self) -> bool {
        self.effect.lasts()
    }

    /// Returns its name in reports; `unknown` for an effect that only describes.
    pub fn said(&self) -> &'static str {
        self.effect.said()
    }

    /// Whether it describes an error of a link's inertial parameters without naming its cause.
    pub fn is_unnamed_body(&self) -> bool {
        self.effect.traits.describes_only && self.effect.family == Family::Body
    }

    /// Whether all its coordinates are linear coefficients.
    pub fn is_linear(&self) -> bool {
        self.factors().len() == self.effect.coordinates.len()
    }

    /// Returns the indices of the coordinates that are linear coefficients.
    pub fn factors(&self) -> Vec<usize> {
        let is_factor = |c: &Coordinate| matches!(c.kind, CoordinateKind::Factor { .. });
        let coordinates = self.effect.coordinates.iter().enumerate();
        coordinates
            .filter(|(_, c)| is_factor(c))
            .map(|(i, _)| i)
            .collect()
    }
}

/// An effect at a place with its parameters.
#[derive(Debug, Clone)]
pub struct Active {
    /// The effect and its place.
    pub hypothesis: Hypothesis,
    /// Values of the effect's coordinates. For a curve: its values at the knots that are not held at zero.
    pub coordinates: Vec<f64>,
    /// The curve of an `unknown` effect: its knots and its argument. Its own values are not used.
    pub curve: Option<Table>,
}

impl Active {
    /// Builds the term for a robot.
    pub fn term(&self, model: &Model) -> Box<dyn Term> {
        let site = self.hypothesis.place.site(model);
        let curve = self.curve.as_ref().and_then(|curve| {
            let values = self.values_at_knots(curve);
            table(
                &site,
                Table {
                    values,
                    ..curve.clone()
                },
            )
            .ok()
        });
        curve.unwrap_or_else(|| (self.hypothesis.effect.build)(&site, &self.coordinates))
    }

    /// Returns the values of its curve at all knots.
    pub fn values_at_knots(&self, curve: &Table) -> Vec<f64> {
        let held = held_knots(curve, self.hypothesis.place.joint);
        let mut free = self.coordinates.iter();
        let mut value = |k: usize| {
            let value = (!held.contains(&k)).then(|| free.next().copied());
            value.flatten().unwrap_or(0.0)
        };
        (0..curve.knots.len()).map(&mut value).collect()
    }

    /// Whether it depends on the effort that the gear transmits.
    pub fn needs_load(&self) -> bool {
        match &self.curve {
            Some(curve) => curve.against.is_of_load(),
            None => self.hypothesis.needs_load(),
        }
    }

    /// Whether it acts on the recorded effort: see [`Layer::Record`].
    pub fn is_of_record(&self) -> bool {
        self.hypothesis.effect.layer == Layer::Record
    }

    /// Whether it couples the effort of one joint into another's recording.
    pub fn is_coupling(&self) -> bool {
        self.hypothesis.is_coupling()
    }

    /// Returns its coordinates with all linear coefficients at zero: the nonlinear parameters.
    pub fn shape(&self) -> Vec<f64> {
        let mut shape = self.coordinates.clone();
        for i in self.hypothesis.factors() {
            shape[i] = 0.0;
        }
        shape
    }

    /// Returns the kind of a coordinate.
    pub fn kind(&self, coordinate: usize) -> CoordinateKind {
        let of_effect = self.hypothesis.effect.coordinates.get(coordinate);
        of_effect.map_or(Coordinate::factor("value_nm").kind, |c| c.kind)
    }

    /// Returns the body that it adds or changes, if any, and the URDF's body of that link.
    pub fn body(&self, model: &Model) -> Option<(Inertia, Option<Inertia>)> {
        let ten = Inertia::from_parameters(*self.coordinates.first_chunk::<BODY>()?);
        if self.hypothesis.is_unnamed_body() {
            let link = model.links()[self.hypothesis.place.link].inertia;
            return Some((link + ten, Some(link)));
        }
        self.hypothesis.is_body().then_some((ten, None))
    }

    /// Whether it is a curve over the time since a start, which another run does not share.
    pub fn is_curve_over_time(&self) -> bool {
        matches!(&self.curve, Some(curve) if curve.against.is_of_start())
    }

    /// Returns its parameters as they appear in reports.
    pub fn parameters(&self) -> Vec<f64> {
        (self.hypothesis.effect.to_parameters)(&self.coordinates)
    }
}

/// Whether a coupling adds this joint's effort to another joint's recording.
pub fn feeds(actives: &[Active], joint: usize) -> bool {
    let couplings = actives.iter().filter(|active| active.is_coupling());
    couplings
        .map(|active| active.hypothesis.place.source)
        .any(|source| source == joint)
}

/// Returns the effects in the order in which they act within their layer: torque scales last.
pub fn in_order(actives: &[Active]) -> Vec<&Active> {
    let mut all: Vec<&Active> = actives.iter().collect();
    all.sort_by_key(|active| active.hypothesis.is_torque_scale());
    all
}

/// Returns the knots of a joint's curve that are held at zero, because friction or an offset already describes that
/// part.
///
/// A curve over the joint's own velocity is the remaining friction after Coulomb and viscous friction. These two are
/// a straight line in each direction, so the slowest and the fastest knot of each direction are held at zero. Held
/// knots of other curves: no load, the middle of a hysteresis, long after a standstill, and far from a reversal.
pub fn held_knots(curve: &Table, joint: usize) -> Vec<usize> {
    let last = curve.knots.len() - 1;
    match curve.against {
        Against::DrivenLoad => {
            let zero = curve.knots.iter().position(|knot| knot.abs() <= 0.0);
            return zero.into_iter().collect();
        }
        Against::LoadTurned => return vec![last / 2],
        Against::SinceRest | Against::SinceTurn => return vec![last],
        _ => {}
    }
    if !curve.is_friction_of(joint) {
        return Vec::new();
    }
    let middle = curve.knots.partition_point(|knot| *knot < 0.0);
    let directions = [0..middle, middle..curve.knots.len()];
    directions
        .into_iter()
        .filter(|knots| knots.len() >= 2)
        .flat_map(|knots| [knots.start, knots.end - 1])
        .collect()
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;

    #[test]
    fn a_curve_of_friction_is_what_lines_through_its_ends_leave() {
        let curve = Table {
            against: Against::Velocity,
            of_joint: 2,
            by_direction: true,
            period: None,
            knots: vec![-1.0, -0.5, -0.1, 0.1, 0.4, 0.9],
            values: vec![0.0; 6],
        };
        let active = Active {
            hypothesis: Hypothesis {
                effect: effect("unknown").unwrap(),
                place: Whereabouts {
                    joint: 2,
                    ..Whereabouts::default()
                },
            },
            coordinates: vec![3.0, 4.0],
            curve: Some(curve.clone()),
        };
        assert!(curve.is_friction_of(2));
        let values = active.values_at_knots(&curve);
        assert_eq!(values, [0.0, 3.0, 0.0, 0.0, 4.0, 0.0]);
        let of_another = Table {
            of_joint: 1,
            ..curve
        };
        assert!(held_knots(&of_another, 2).is_empty());
    }
}
