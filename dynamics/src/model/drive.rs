//! Friction, rotors and springs of joints in a robot file.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::document::elements;

/// Namespace of the attributes of a MuJoCo model's joint that a URDF lacks.
pub const MUJOCO: &str = "http://www.mujoco.org";
/// Namespace of Drake's elements.
const DRAKE: &str = "http://drake.mit.edu";

/// Friction, rotor and spring of a joint; zero if the file has none. A URDF's `<dynamics>` is ignored, because
/// exporters write placeholders there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drive {
    /// Viscous friction \[N m s/rad or N s/m\].
    pub damping: f64,
    /// Coulomb friction \[N m or N\].
    pub friction: f64,
    /// Inertia of the rotor, seen at the joint \[kg m² or kg\].
    pub rotor_inertia: f64,
    /// Stiffness of a spring \[N m/rad or N/m\].
    pub stiffness: f64,
    /// Position at which the spring has no force \[rad or m\].
    pub rest: f64,
}

/// The drives of a document by the joint's name: elements `joint` of the namespace [`MUJOCO`] in the joints, and Drake's
/// `rotor_inertia` and `gear_ratio` in the actuators of transmissions.
pub(super) fn drives(document: &Document<'_>) -> BTreeMap<String, Drive> {
    let mut all: BTreeMap<String, Drive> = BTreeMap::new();
    let root = document.root_element();
    for part in elements(root) {
        let is_joint = part.has_tag_name("joint");
        let own = elements(part).find(|node| node.has_tag_name((MUJOCO, "joint")));
        if let (true, Some(own), Some(name)) = (is_joint, own, part.attribute("name")) {
            let drive = all.entry(name.to_owned()).or_default();
            drive.damping = number(own.attribute("damping"));
            drive.friction = number(own.attribute("frictionloss"));
            drive.rotor_inertia = number(own.attribute("armature"));
            drive.stiffness = number(own.attribute("stiffness"));
            drive.rest = number(own.attribute("springref"));
        }
        let joint = elements(part).find(|node| node.has_tag_name("joint"));
        let joint = joint.and_then(|joint| joint.attribute("name"));
        let actuator = elements(part).find(|node| node.has_tag_name("actuator"));
        if let (true, Some(joint), Some(actuator)) =
            (part.has_tag_name("transmission"), joint, actuator)
        {
            let value = |name: &str| {
                let own = elements(actuator).find(|node: &Node| node.has_tag_name((DRAKE, name)));
                own.map(|own| number(own.attribute("value")))
            };
            let ratio = value("gear_ratio").unwrap_or(1.0);
            let inertia = value("rotor_inertia").unwrap_or(0.0) * ratio * ratio;
            if inertia > 0.0 {
                all.entry(joint.to_owned()).or_default().rotor_inertia = inertia;
            }
        }
    }
    all
}

/// Parses a number; zero without one.
fn number(text: Option<&str>) -> f64 {
    let number = text.and_then(|text| text.trim().parse::<f64>().ok());
    number.filter(|x| x.is_finite()).unwrap_or(0.0)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn rotors_of_drake_are_seen_through_the_gear_and_dynamics_do_not_count() {
        let urdf = r#"<robot name="one" xmlns:drake="http://drake.mit.edu">
          <joint name="turn" type="continuous"><dynamics damping="1" friction="1"/></joint>
          <transmission name="drive">
            <joint name="turn"/>
            <actuator name="motor"><drake:rotor_inertia value="2e-5"/><drake:gear_ratio value="100"/></actuator>
          </transmission>
        </robot>"#;
        let document = Document::parse(urdf).unwrap();
        let expected = Drive {
            rotor_inertia: 0.2,
            ..Drive::default()
        };
        let found = drives(&document)["turn"];
        assert!((found.rotor_inertia - expected.rotor_inertia).abs() < 1e-12);
        assert_eq!(
            Drive {
                rotor_inertia: 0.2,
                ..found
            },
            expected
        );
    }
}
