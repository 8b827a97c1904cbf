//! Terms as files hold them.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{EFFECTS, Effect, Term, effect, get};

/// A term as a file holds it: `{effect: viscous_friction, joint: joint1, parameters:
/// {viscous_nms_per_rad: 3.0}}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TermSpec {
    /// Canonical name of the effect.
    pub effect: String,
    /// The joint it is in.
    pub joint: String,
    /// All its parameters by canonical name.
    pub parameters: BTreeMap<String, f64>,
}

/// Why a term cannot be built or changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TermError {
    /// There is no such effect.
    #[error("there is no effect `{effect}`; known are: {known}")]
    UnknownEffect {
        /// The name given.
        effect: String,
        /// The names there are.
        known: String,
    },
    /// The robot has no such joint.
    #[error("`{effect}` names joint `{joint}`, which the robot does not have; its joints: {known}")]
    UnknownJoint {
        /// The effect.
        effect: String,
        /// The name given.
        joint: String,
        /// The robot's joints.
        known: String,
    },
    /// The effect has no such parameter.
    #[error("`{effect}` has no parameter `{parameter}`; it has: {known}")]
    UnknownParameter {
        /// The effect.
        effect: &'static str,
        /// The name given.
        parameter: String,
        /// The names there are.
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
    /// A value that cannot be.
    #[error("`{parameter}` of `{effect}` is {value}, it must be a number of at least {minimum}")]
    OutOfRange {
        /// The effect.
        effect: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The value given.
        value: f64,
        /// The least that is possible.
        minimum: f64,
    },
}

impl TermSpec {
    /// The spec of a term in a robot with these joints.
    ///
    /// # Panics
    /// If the term is in a joint that is not among `joint_names`.
    pub fn of(term: &dyn Term, joint_names: &[String]) -> Self {
        let effect = term.effect();
        let value = |name: &&'static str| Some(((*name).to_owned(), get(term, name)?));
        let names: Vec<_> = effect
            .parameters
            .iter()
            .map(|parameter| parameter.name)
            .collect();
        Self {
            effect: effect.name.to_owned(),
            joint: joint_names[term.joint()].clone(),
            parameters: names.iter().filter_map(value).collect(),
        }
    }

    /// Makes the term for a robot whose joints are `joint_names`, in URDF order.
    ///
    /// # Errors
    /// If the effect, the joint or a parameter is unknown, a parameter is missing or a value impossible.
    pub fn build(&self, joint_names: &[String]) -> Result<Box<dyn Term>, TermError> {
        let Some(effect) = effect(&self.effect) else {
            return Err(TermError::UnknownEffect {
                effect: self.effect.clone(),
                known: list(EFFECTS.iter().map(|effect| effect.name)),
            });
        };
        let Some(joint) = joint_names.iter().position(|name| *name == self.joint) else {
            return Err(TermError::UnknownJoint {
                effect: self.effect.clone(),
                joint: self.joint.clone(),
                known: list(joint_names.iter().map(String::as_str)),
            });
        };
        for (parameter, &value) in &self.parameters {
            effect.check(parameter, value)?;
        }
        let value = |parameter: &super::Parameter| {
            let (effect, parameter) = (effect.name, parameter.name);
            let missing = TermError::MissingParameter { effect, parameter };
            self.parameters.get(parameter).copied().ok_or(missing)
        };
        let values = effect
            .parameters
            .iter()
            .map(value)
            .collect::<Result<Vec<_>, _>>()?;
        Ok((effect.build)(joint, &values))
    }
}

impl Effect {
    /// The index of a parameter that can have this value.
    pub(super) fn check(&self, parameter: &str, value: f64) -> Result<usize, TermError> {
        let Some(index) = self
            .parameters
            .iter()
            .position(|known| known.name == parameter)
        else {
            return Err(TermError::UnknownParameter {
                effect: self.name,
                parameter: parameter.to_owned(),
                known: list(self.parameters.iter().map(|known| known.name)),
            });
        };
        let known = &self.parameters[index];
        if !(value.is_finite() && value >= known.minimum) {
            return Err(TermError::OutOfRange {
                effect: self.name,
                parameter: known.name,
                value,
                minimum: known.minimum,
            });
        }
        Ok(index)
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints() -> Vec<String> {
        vec!["joint1".to_owned(), "joint2".to_owned()]
    }

    fn spec(json: &str) -> TermSpec {
        serde_json::from_str(json).unwrap()
    }

    const VISCOUS: &str = r#"{"effect":"viscous_friction","joint":"joint2","parameters":{"viscous_nms_per_rad":3.0}}"#;

    #[test]
    fn a_spec_becomes_a_term_and_a_spec_again() {
        let term = spec(VISCOUS).build(&joints()).unwrap();
        assert_eq!(term.joint(), 1);
        assert_eq!(
            term.sentence("joint2"),
            "Joint joint2 has viscous friction of 3 N m s/rad."
        );
        let again = TermSpec::of(&*term, &joints());
        assert_eq!(serde_json::to_string(&again).unwrap(), VISCOUS);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let message = |json: &str| spec(json).build(&joints()).unwrap_err().to_string();
        for (from, to, expected) in [
            (
                "viscous_friction",
                "viscous",
                "there is no effect `viscous`; known are: coulomb_friction, viscous_friction",
            ),
            (
                "joint2",
                "joint7",
                "`viscous_friction` names joint `joint7`, which the robot does not have; its joints: joint1, joint2",
            ),
            (
                "viscous_nms_per_rad",
                "coulomb_nm",
                "`viscous_friction` has no parameter `coulomb_nm`; it has: viscous_nms_per_rad",
            ),
            (
                "\"viscous_nms_per_rad\":3.0",
                "",
                "`viscous_friction` needs the parameter `viscous_nms_per_rad`",
            ),
            (
                "3.0",
                "-3.0",
                "`viscous_nms_per_rad` of `viscous_friction` is -3, it must be a number of at least 0",
            ),
        ] {
            assert_eq!(message(&VISCOUS.replace(from, to)), expected);
        }
    }
}
