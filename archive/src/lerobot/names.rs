//! Meaning of the names of features and of their elements.

/// Features that hold positions, and possibly velocities and efforts; the first that exists is used.
pub(super) const STATE: [&str; 4] = [
    "observation.state",
    "observation.qpos",
    "observations.qpos",
    "observation.joint_positions",
];
/// Features that hold velocities.
pub(super) const VELOCITY: [&str; 4] = [
    "observation.velocity",
    "observation.qvel",
    "observations.qvel",
    "observation.joint_velocities",
];
/// Features that hold efforts, as named for ALOHA and robots derived from it.
pub(super) const EFFORT: [&str; 4] = [
    "observation.effort",
    "observations.effort",
    "observation.torque",
    "observation.joint_efforts",
];

/// Quantity of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Position,
    Velocity,
    Effort,
    /// External effort estimated by a controller, with the expected effort already subtracted.
    External,
}

/// Suffixes of names, after a dot, an underscore or a slash. The first match is used, so a longer
/// suffix precedes those that it ends in.
const ENDINGS: [(&str, Kind); 13] = [
    ("ext_eff", Kind::External),
    ("external_effort", Kind::External),
    ("external_torque", Kind::External),
    ("pos", Kind::Position),
    ("position", Kind::Position),
    ("vel", Kind::Velocity),
    ("velocity", Kind::Velocity),
    ("eff", Kind::Effort),
    ("effort", Kind::Effort),
    ("torque", Kind::Effort),
    ("tau", Kind::Effort),
    ("current", Kind::Effort),
    ("tor", Kind::Effort),
];

/// Splits the name of an element into its joint and its quantity, if any, e.g. `joint_1.torque` in OpenArm's
/// data sets.
pub(super) fn split(name: &str) -> (&str, Option<Kind>) {
    for (ending, kind) in ENDINGS {
        let joint = name
            .strip_suffix(ending)
            .and_then(|joint| joint.strip_suffix(['.', '_', '/']));
        if let Some(joint) = joint.filter(|joint| !joint.is_empty()) {
            return (joint, Some(kind));
        }
    }
    (name, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_tell_what_an_element_is() {
        for (name, joint, kind) in [
            ("joint_1.torque", "joint_1", Some(Kind::Effort)),
            ("shoulder_pan.pos", "shoulder_pan", Some(Kind::Position)),
            ("left_joint_0_vel", "left_joint_0", Some(Kind::Velocity)),
            ("left_joint_0.ext_eff", "left_joint_0", Some(Kind::External)),
            ("left_waist", "left_waist", None),
            ("pos", "pos", None),
            ("motor", "motor", None),
        ] {
            assert_eq!(split(name), (joint, kind));
        }
    }
}
