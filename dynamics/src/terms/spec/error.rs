//! Errors of building a term from a spec.

/// Reason why a term cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TermError {
    /// The effect does not exist.
    #[error("there is no effect `{effect}`; known are: {known}")]
    UnknownEffect {
        /// The name given.
        effect: String,
        /// The existing names.
        known: String,
    },
    /// The robot has no such joint.
    #[error("`{effect}` names joint `{joint}`, which the robot does not have; its joints: {known}")]
    UnknownJoint {
        /// The effect.
        effect: &'static str,
        /// The name given.
        joint: String,
        /// The robot's joints.
        known: String,
    },
    /// The robot has no such link.
    #[error("`{effect}` names link `{link}`, which the robot does not have; its links: {known}")]
    UnknownLink {
        /// The effect.
        effect: &'static str,
        /// The name given.
        link: String,
        /// The robot's links.
        known: String,
    },
    /// The place of the effect is missing.
    #[error("`{effect}` needs the key `{key}`")]
    MissingPlace {
        /// The effect.
        effect: &'static str,
        /// `joint`, `source_joint` or `link`.
        key: &'static str,
    },
    /// The effect has no such parameter.
    #[error("`{effect}` has no parameter `{parameter}`; it has: {known}")]
    UnknownParameter {
        /// The effect.
        effect: &'static str,
        /// The name given.
        parameter: String,
        /// The existing names.
        known: String,
    },
    /// A parameter is not given.
    #[error("`{effect}` needs the parameter `{parameter}`")]
    MissingParameter {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        parameter: &'static str,
    },
    /// A value that is impossible.
    #[error("`{parameter}` of `{effect}` is {value}, it must be {expected}")]
    OutOfRange {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The value given.
        value: f64,
        /// Possible values.
        expected: String,
    },
    /// An effect with parameters has a table.
    #[error("`{effect}` has no table")]
    NoTable {
        /// The effect.
        effect: &'static str,
    },
    /// An `unknown` effect has no table.
    #[error("`{effect}` needs a table")]
    MissingTable {
        /// The effect.
        effect: &'static str,
    },
    /// The table is not a valid curve.
    #[error("the table's {reason}")]
    Table {
        /// The fault of the table.
        reason: &'static str,
    },
}
