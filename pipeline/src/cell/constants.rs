//! Torque constants: a common check for files and arguments.

use std::collections::BTreeMap;

use super::EffortUnit;
use crate::report::{Problem, Report};
use crate::suggest;
use crate::yaml::{Located, Place};

/// Location of an error in torque constants.
#[derive(Debug, Clone, Copy)]
pub enum ConstantSpot<'a> {
    /// The whole table.
    All,
    /// A joint's name.
    Joint(&'a str),
    /// The constant of a joint.
    Value(&'a str),
}

impl ConstantSpot<'_> {
    /// Problem at this location of the `torque_constants_nm_per_a` in `file` under `around`.
    pub fn problem<T>(self, file: &Located<T>, around: &Place, title: String) -> Problem {
        let place = around.key("torque_constants_nm_per_a");
        match self {
            Self::All => file.at_key(&place, title),
            Self::Joint(joint) => file.at_key(&place.key(joint), title),
            Self::Value(joint) => file.at(&place.key(joint), title),
        }
    }
}

/// Returns the constants in the order of `joints` \[N m/A\]; `None` if one is missing. Errors are added to `report`;
/// `problem` formats one at its location.
pub fn torque_constants(
    constants: &BTreeMap<String, f64>,
    joints: &[String],
    unit: EffortUnit,
    problem: &dyn Fn(ConstantSpot<'_>, String) -> Problem,
    report: &mut Report,
) -> Option<Vec<f64>> {
    if unit == EffortUnit::Nm {
        let title = "torque constants, but the effort is in Nm".to_owned();
        let help = "say that the effort unit is A, or leave them out";
        report.push(problem(ConstantSpot::All, title).help(help));
    }
    for (joint, constant) in constants {
        if !joints.contains(joint) && !joints.is_empty() {
            let names = joints.iter().map(String::as_str);
            let help = suggest::help(joint, "the joints are", names);
            let title = format!("the robot has no joint `{joint}`");
            report.push(problem(ConstantSpot::Joint(joint), title).maybe_help(help));
        }
        if !(constant.is_finite() && *constant > 0.0) {
            let title = format!("a torque constant is more than 0, found {constant}");
            report.push(problem(ConstantSpot::Value(joint), title));
        }
    }
    let missing: Vec<&str> = (joints.iter())
        .filter(|joint| !constants.contains_key(*joint))
        .map(String::as_str)
        .collect();
    if !missing.is_empty() {
        let title = format!("no torque constant for {}", suggest::list(missing));
        let help = "give torque constants for all joints or for none";
        report.push(problem(ConstantSpot::All, title).help(help));
    }
    joints
        .iter()
        .map(|joint| constants.get(joint).copied())
        .collect()
}
