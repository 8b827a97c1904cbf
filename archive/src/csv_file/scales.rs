//! Conversion factors to rad, m, N m and A from the units in a header.

use super::mapping::Found;
use super::units::{self, Dimension, Quantity, Unit};

/// Conversion factors to the units of joint states.
#[derive(Debug, Default)]
pub(super) struct Scales {
    /// Factor of each column of a position.
    pub(super) position: Vec<f64>,
    /// Factor of each column of a velocity.
    pub(super) velocity: Vec<f64>,
    /// Factor of each column of an effort.
    pub(super) effort: Vec<f64>,
    /// Unit of the time \[ns\].
    pub(super) time_unit_ns: Option<u64>,
    /// Remarks for the user on the conversions.
    pub(super) remarks: Vec<String>,
}

impl Scales {
    /// Returns the factors for the columns `found` of a table with the names `header` (empty without one). Removes a
    /// velocity of ambiguous unit from `found`.
    ///
    /// # Errors
    /// The quantity whose units contradict each other, and the reason.
    pub(super) fn of(header: &[String], found: &mut Found) -> Result<Self, (&'static str, String)> {
        let position = Headed::of(header, &found.position, Quantity::Position)
            .map_err(|reason| ("position", reason))?;
        let mut velocity = Headed::of(header, &found.velocity, Quantity::Velocity)
            .map_err(|reason| ("velocity", reason))?;
        let effort = Headed::of(header, &found.effort, Quantity::Effort)
            .map_err(|reason| ("effort", reason))?;
        let time =
            Headed::of(header, &[found.time], Quantity::Time).map_err(|reason| ("time", reason))?;
        let mut remarks = Vec::new();
        match (position.angle, velocity.angle) {
            // Without a unit the positions may be in rad or deg, and the velocities do not determine them.
            (None, Some(unit)) if unit.name == "deg/s" && !found.position.is_empty() => {
                let reason = "the header names [deg/s] for velocities and no unit for positions: add it there, too";
                return Err(("position", reason.to_owned()));
            }
            // Without a unit the velocities may be in rad/s or deg/s. The derivative of the positions is unambiguous.
            (Some(unit), None) if unit.name == "deg" && !found.velocity.is_empty() => {
                found.velocity.clear();
                velocity = Headed::default();
                remarks.push(
                    "The header names [deg] for positions and no unit for velocities. The velocities are left out \
                     and computed from the positions."
                        .to_owned(),
                );
            }
            _ => {}
        }
        for (what, headed) in [
            ("Positions", &position),
            ("Velocities", &velocity),
            ("Efforts", &effort),
        ] {
            remarks.extend(headed.remarks(what));
        }
        Ok(Self {
            position: position.factors,
            velocity: velocity.factors,
            effort: effort.factors,
            time_unit_ns: time.units.first().map(|unit| unit.factor as u64),
            remarks,
        })
    }
}

/// Units in the header cells of one quantity.
#[derive(Default)]
struct Headed {
    factors: Vec<f64>,
    /// Distinct units of the columns.
    units: Vec<&'static Unit>,
    /// The unit of the rotary columns, if the header has one.
    angle: Option<&'static Unit>,
    /// A text in brackets that is not a unit in [`units`].
    unknown: Option<String>,
}

impl Headed {
    fn of(header: &[String], columns: &[usize], quantity: Quantity) -> Result<Self, String> {
        let mut headed = Self::default();
        let mut silent = None;
        for cell in columns.iter().filter_map(|&column| header.get(column)) {
            let (_, unit) = units::split(cell, quantity);
            headed.factors.push(unit.map_or(1.0, |unit| unit.factor));
            match unit {
                Some(unit) if !headed.units.contains(&unit) => headed.units.push(unit),
                Some(_) => {}
                None => {
                    if let Some(unit) = units::contradiction(cell, quantity) {
                        let name = unit.name;
                        return Err(format!(
                            "column {cell:?}: [{name}] is not a unit of this quantity"
                        ));
                    }
                    silent = Some(cell);
                    let unknown = units::in_last_brackets(cell);
                    headed.unknown = headed.unknown.or(unknown.map(str::to_owned));
                }
            }
        }
        for (i, unit) in headed.units.iter().enumerate() {
            let other = (headed.units[..i].iter()).find(|other| unit.contradicts(other));
            if let Some(other) = other {
                let (a, b) = (other.name, unit.name);
                return Err(format!(
                    "the header names [{a}] for some columns and [{b}] for others"
                ));
            }
        }
        let mut units = headed.units.iter();
        headed.angle = units
            .find(|unit| unit.dimension == Dimension::Angle)
            .copied();
        let converted = headed.units.iter().find(|unit| unit.target().is_some());
        if let (Some(cell), Some(unit)) = (silent, converted) {
            let name = unit.name;
            return Err(format!(
                "the header names [{name}] for some columns and no unit for {cell:?}"
            ));
        }
        Ok(headed)
    }

    fn remarks(&self, what: &str) -> impl Iterator<Item = String> {
        let units = self.units.iter().filter_map(move |unit| {
            let name = unit.name;
            match unit.target() {
                Some(target) if name == "deg" => Some(format!(
                    "{what} are in degrees, as the header says, and are converted to {target}."
                )),
                Some(target) => Some(format!(
                    "{what} are headed [{name}] and are converted to {target}."
                )),
                None if name == "A" => Some(format!("{what} are headed [A].")),
                None => None,
            }
        });
        let unknown = self.unknown.iter().map(move |unknown| {
            format!("{what} are headed [{unknown}], an unknown unit, and are not converted.")
        });
        units.chain(unknown)
    }
}
