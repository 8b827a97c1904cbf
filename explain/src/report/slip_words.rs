//! Texts for faults of recordings.

/// Texts for a kind of fault.
#[derive(Debug, Clone, Copy)]
pub struct SlipWords {
    /// Heading.
    pub title: &'static str,
    /// Meaning of the fault.
    pub meaning: &'static str,
    /// Instruction; `{place}` and `{source}` are filled in.
    pub look_at: &'static str,
}

/// Returns the kinds of faults of recordings that `explain` reports.
pub fn recording_faults() -> impl Iterator<Item = &'static str> {
    KINDS.iter().map(|(kind, _)| *kind)
}

/// All kinds of faults, by the `kind` of their findings.
static KINDS: [(&str, SlipWords); 13] = [
    (
        "efforts_swapped",
        SlipWords {
            title: "Efforts swapped",
            meaning: "Each of two joints has the effort of the other.",
            look_at: "Joints {place} and {source}: exchange their efforts in the driver, or the connectors of their sensors.",
        },
    ),
    (
        "names_swapped",
        SlipWords {
            title: "Names swapped",
            meaning: "Each of two joints has the name of the other.",
            look_at: "Joints {place} and {source}: exchange their names in the driver, or in the URDF.",
        },
    ),
    (
        "effort_constant",
        SlipWords {
            title: "Effort that never changes",
            meaning: "The effort of a joint is one number while the joint moves: it is no measurement.",
            look_at: "Joint {place}: its torque sensor, or what the driver fills in where it measures nothing.",
        },
    ),
    (
        "effort_dropout",
        SlipWords {
            title: "Effort that drops out",
            meaning: "The effort of a joint is exactly zero for moments while its neighbours in time are not: it is not measured then.",
            look_at: "Joint {place}: the plug and the cable of its sensor.",
        },
    ),
    (
        "effort_sign",
        SlipWords {
            title: "Effort of the other sign",
            meaning: "The effort falls where the motion needs more of it.",
            look_at: "Joint {place}: turn the sign of its effort in the driver.",
        },
    ),
    (
        "effort_without_sign",
        SlipWords {
            title: "Effort without its sign",
            meaning: "The effort is a magnitude: it is never below zero, though the motion requires torques of both signs.",
            look_at: "Joint {place}: let its driver publish the effort, or the current, with its sign.",
        },
    ),
    (
        "position_sign",
        SlipWords {
            title: "Position of the other sign",
            meaning: "The position falls where the joint goes forward.",
            look_at: "Joint {place}: turn the sign of its position in the driver.",
        },
    ),
    (
        "joint_sign",
        SlipWords {
            title: "Joint that counts the other way",
            meaning: "Position and effort have another sign than in the URDF.",
            look_at: "Joint {place}: turn its axis in the URDF, or its position and effort in the driver.",
        },
    ),
    (
        "degrees",
        SlipWords {
            title: "Positions in degrees",
            meaning: "Positions are recorded in degrees in place of rad.",
            look_at: "The driver: convert its positions from degrees to rad.",
        },
    ),
    (
        "gravity_subtracted",
        SlipWords {
            title: "Gravity subtracted",
            meaning: "The controller has subtracted the torque of gravity from the effort.",
            look_at: "The driver: let it publish the measured effort, gravity included.",
        },
    ),
    (
        "effort_unit",
        SlipWords {
            title: "Effort in another unit",
            meaning: "The effort is not in the unit that was given.",
            look_at: "The unit of the effort: give the right one (--effort-unit), or convert it in the driver.",
        },
    ),
    (
        "torque_constant",
        SlipWords {
            title: "Wrong torque constants",
            meaning: "The torque constants that were given do not turn these currents into the torques of this robot.",
            look_at: "The torque constants: are they at the joint, with the gear, in N m/A?",
        },
    ),
    (
        "velocity_scale",
        SlipWords {
            title: "Velocity that is no change of position",
            meaning: "The recorded velocity is not the change of the recorded position.",
            look_at: "The driver: its velocity must be that of the joint, in rad/s.",
        },
    ),
];

/// Returns the texts for a kind of fault, if it is one.
pub fn words(kind: &str) -> Option<&'static SlipWords> {
    let found = KINDS.iter().find(|(name, _)| *name == kind);
    found.map(|(_, words)| words)
}
