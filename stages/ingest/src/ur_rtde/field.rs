//! Outputs read from a controller. Pure.

use crate::config::UrRtdeConfig;

/// Number of joints of the arm, and length of the interface's vectors.
pub(super) const JOINTS: usize = 6;
/// RTDE outputs of the payload: its mass, its centre of mass and its inertia.
const PAYLOAD: &str = "payload payload_cog payload_inertia";

/// Quantity that a field supplies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Timestamp,
    Position,
    Velocity,
    Effort,
    TargetMoment,
    Mass,
    CentreOfMass,
    Inertia,
}

impl Part {
    const ALL: [Self; 8] = [
        Self::Timestamp,
        Self::Position,
        Self::Velocity,
        Self::Effort,
        Self::TargetMoment,
        Self::Mass,
        Self::CentreOfMass,
        Self::Inertia,
    ];

    /// Returns its type in RTDE, and the number of 64-bit values in it.
    pub fn type_name(self) -> (&'static str, usize) {
        match self {
            Self::Timestamp | Self::Mass => ("DOUBLE", 1),
            Self::CentreOfMass => ("VECTOR3D", 3),
            _ => ("VECTOR6D", JOINTS),
        }
    }

    /// Returns its range in the [`Numbers`](super::recipe::Numbers).
    pub fn place(self) -> std::ops::Range<usize> {
        let before = Self::ALL.iter().take_while(|part| **part != self);
        let from: usize = before.map(|part| part.type_name().1).sum();
        from..from + self.type_name().1
    }
}

/// A requested output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Field {
    /// Quantity that it supplies.
    pub part: Part,
    /// Its name in RTDE.
    pub name: &'static str,
}

/// Returns the outputs that these settings need; `with_inertia` is false for a controller without a payload inertia.
pub(super) fn fields(settings: &UrRtdeConfig, with_inertia: bool) -> Vec<Field> {
    let field = |part, name| Field { part, name };
    let mut fields = vec![
        field(Part::Timestamp, "timestamp"),
        field(Part::Position, "actual_q"),
        field(Part::Velocity, "actual_qd"),
        field(Part::Effort, settings.effort.field()),
    ];
    if settings.target_moment {
        fields.push(field(Part::TargetMoment, "target_moment"));
    }
    if settings.payload {
        let parts = [Part::Mass, Part::CentreOfMass, Part::Inertia];
        let all = parts.into_iter().zip(PAYLOAD.split(' '));
        let all = all.map(|(part, name)| field(part, name));
        fields.extend(all.take(if with_inertia { 3 } else { 2 }));
    }
    fields
}
