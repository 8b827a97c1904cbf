//! `control_msgs/msg/DynamicJointState`, and what of it is a joint state.

use serde::{Deserialize, Serialize};

use super::header::{HEADER, Header, TIME};
use super::{DecodeError, JointState, Message};

/// Names of `ros2_control`'s state interfaces that a joint state has a field for, in the order of its fields.
const INTERFACES: [&str; 3] = ["position", "velocity", "effort"];

/// `control_msgs/msg/InterfaceValue`: the interfaces of one joint, sensor or input.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct InterfaceValue {
    /// Names of the interfaces.
    pub interface_names: Vec<String>,
    /// Their values, in the same order. Entries may be NaN.
    pub values: Vec<f64>,
}

impl InterfaceValue {
    fn value(&self, interface: &str) -> Option<f64> {
        let at = self
            .interface_names
            .iter()
            .position(|name| name == interface)?;
        self.values.get(at).copied()
    }
}

/// `control_msgs/msg/DynamicJointState`: all state interfaces of `ros2_control` by joint, as its
/// `joint_state_broadcaster` publishes them on `/dynamic_joint_states`. Sensors and inputs are among the joints.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct DynamicJointState {
    /// Time of the measurement.
    pub header: Header,
    /// Names of the joints.
    pub joint_names: Vec<String>,
    /// Their interfaces, in the same order.
    pub interface_values: Vec<InterfaceValue>,
}

impl Message for DynamicJointState {
    const TYPE: &'static str = "control_msgs/msg/DynamicJointState";
    const TEXT: &'static str =
        "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[
        HEADER,
        TIME,
        (
            "control_msgs/InterfaceValue",
            "string[] interface_names\nfloat64[] values\n",
        ),
    ];
    const TYPE_HASH: &'static str =
        "RIHS01_18024c98a62697680f581108eeed40b28fb4542fa0ac5a8e36f56c62b6813d26";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()?;
        let fits = |array, len, names: &[String]| {
            if len == names.len() {
                return Ok(());
            }
            Err(DecodeError::array_length(array, len, names))
        };
        let joints = &self.joint_names;
        fits("interface_values", self.interface_values.len(), joints)?;
        for joint in &self.interface_values {
            fits("values", joint.values.len(), &joint.interface_names)?;
        }
        Ok(())
    }
}

impl DynamicJointState {
    /// Writes its positions, velocities and efforts over `state`. Entries with none of the three, such as sensors, are
    /// left out. A joint that lacks an interface which another joint has gets NaN there.
    pub fn write_to(&self, state: &mut JointState) {
        state.header.clone_from(&self.header);
        state.name.clear();
        let fields = [&mut state.position, &mut state.velocity, &mut state.effort];
        let mut given = [false; INTERFACES.len()];
        for values in fields {
            values.clear();
        }
        for (name, interfaces) in self.joint_names.iter().zip(&self.interface_values) {
            let found = INTERFACES.map(|interface| interfaces.value(interface));
            if found.iter().all(Option::is_none) {
                continue;
            }
            state.name.push(name.clone());
            let fields = [&mut state.position, &mut state.velocity, &mut state.effort];
            for ((values, value), given) in fields.into_iter().zip(found).zip(&mut given) {
                *given |= value.is_some();
                values.push(value.unwrap_or(f64::NAN));
            }
        }
        let fields = [&mut state.position, &mut state.velocity, &mut state.effort];
        for (values, given) in fields.into_iter().zip(given) {
            if !given {
                values.clear();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "what is copied comes out as it went in")]

    use super::*;

    fn interfaces(named: &[(&str, f64)]) -> InterfaceValue {
        InterfaceValue {
            interface_names: named.iter().map(|(name, _)| (*name).to_owned()).collect(),
            values: named.iter().map(|(_, value)| *value).collect(),
        }
    }

    #[test]
    fn values_are_taken_by_the_names_of_their_interfaces() {
        let message = DynamicJointState {
            header: Header::new(5, "base"),
            joint_names: ["a", "lamp", "b"].map(str::to_owned).to_vec(),
            interface_values: vec![
                interfaces(&[("effort", 3.0), ("position", 1.0), ("temperature", 40.0)]),
                interfaces(&[("voltage", 24.0)]),
                interfaces(&[("position", 2.0)]),
            ],
        };
        let mut state = JointState {
            velocity: vec![7.0],
            ..JointState::default()
        };
        message.write_to(&mut state);
        assert_eq!(state.header.stamp.ns(), 5);
        assert_eq!(state.name, ["a", "b"]);
        assert_eq!(state.position, [1.0, 2.0]);
        assert!(state.velocity.is_empty());
        assert_eq!(state.effort[0], 3.0);
        assert!(state.effort[1].is_nan());
    }

    #[test]
    fn values_without_a_name_are_refused() {
        let mut message = DynamicJointState {
            joint_names: vec!["a".to_owned()],
            ..DynamicJointState::default()
        };
        let words = |message: &DynamicJointState| message.check().map_err(|e| e.to_string());
        assert_eq!(
            words(&message),
            Err(
                "`interface_values` has 0 entries for 1 name (a): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again"
                    .to_owned()
            )
        );
        message.interface_values = vec![interfaces(&[("position", 1.0)])];
        assert_eq!(words(&message), Ok(()));
        message.interface_values[0].values.push(2.0);
        assert_eq!(
            words(&message),
            Err(
                "`values` has 2 entries for 1 name (position): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again".to_owned()
            )
        );
    }
}
