//! Corrections as an actuator configuration of Isaac Lab.

use std::fmt::Write as _;

use super::corrections::Corrections;
use super::edits::digits;

/// An `actuators` dictionary with one group for each joint, for the `ArticulationCfg` of the robot.
pub fn configuration(corrections: &Corrections) -> String {
    let mut text = String::from(
        "from isaaclab.actuators import ImplicitActuatorCfg\n\n\
         # For `actuators=` of the robot's ArticulationCfg. Stiffness and damping are the controller's: None keeps the asset's.\n\
         ACTUATORS = {\n",
    );
    for (joint, own) in &corrections.joints {
        let at_rest = own.static_friction.or(own.friction);
        // Friction at rest is at least the friction in motion.
        let at_rest = at_rest.map(|x| x.max(own.friction.unwrap_or(0.0)));
        let values = [
            ("armature=", own.armature),
            ("friction=", at_rest),
            ("dynamic_friction=", own.friction),
            ("viscous_friction=", own.damping),
        ];
        if values.iter().all(|(_, value)| value.is_none()) {
            continue;
        }
        let _ = writeln!(
            text,
            "    {joint:?}: ImplicitActuatorCfg(\n        joint_names_expr=[{joint:?}],\n        stiffness=None,\n        damping=None,"
        );
        for (name, value) in values {
            if let Some(value) = value {
                let _ = writeln!(text, "        {name}{},", digits(value));
            }
        }
        text.push_str("    ),\n");
    }
    text.push_str("}\n");
    text
}
