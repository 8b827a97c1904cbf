//! Checks of a scenario's numbers against each other and against the robot.

use super::error::ScenarioError;
use super::trajectory::JointRange;

/// Checks that a position is within the robot's limits.
pub(super) fn position(
    what: &'static str,
    values: &[f64],
    joints: &[JointRange],
) -> Result<(), ScenarioError> {
    if values.len() != joints.len() {
        return Err(ScenarioError::JointCount {
            what,
            found: values.len(),
            expected: joints.len(),
        });
    }
    for (&value, joint) in values.iter().zip(joints) {
        if !(joint.lower..=joint.upper).contains(&value) {
            return Err(ScenarioError::OutsideLimits {
                what,
                joint: joint.name.clone(),
                value,
                lower: joint.lower,
                upper: joint.upper,
            });
        }
    }
    Ok(())
}

/// Checks that a range of non-negative numbers is in order.
pub(super) fn order(what: &'static str, [least, most]: [f64; 2]) -> Result<(), ScenarioError> {
    if 0.0 <= least && least <= most && most.is_finite() {
        return Ok(());
    }
    Err(ScenarioError::Range {
        what,
        reason: format!("[{least}, {most}] is not a range from the smaller to the larger number"),
    })
}
