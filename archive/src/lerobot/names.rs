//! What the names of features and of their elements tell.

/// Features that hold positions, and perhaps velocities and efforts beside them; the first one that is there counts.
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
/// Features that hold efforts: those of ALOHA and of its relatives.
pub(super) const EFFORT: [&str; 4] = [
    "observation.effort",
    "observations.effort",
    "observation.torque",
    "observation.joint_efforts",
];

/// What an element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Position,
    Velocity,
    Effort,
    /// What a controller takes for the effort of the surroundings: the expected effort is subtracted already.
    External,
}

/// How names end, behind a point or an underscore. Longer ones come before those that they end in.
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

/// The joint of an element, and what it is of it if the name tells: `joint_1.torque` in OpenArm's sets.
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
