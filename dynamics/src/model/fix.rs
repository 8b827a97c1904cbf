//! Joints of a URDF made fixed, in its text: those of a gripper that nobody records.

use std::ops::Range;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::document::{elements, parse};
use super::urdf::{Movable, RawJoint, read};
use super::{JointKind, ModelError};

/// The URDF `xml` with the movable joints of these names made fixed, each where its position is zero, or the next to it
/// that its limits allow. All else keeps its text. Names that no movable joint has are passed over.
///
/// # Errors
/// What is wrong with the text or its elements.
pub fn fix_joints(xml: &str, joints: &[&str]) -> Result<String, ModelError> {
    let robot = read(xml)?;
    let document = parse(xml)?;
    let nodes = elements(document.root_element()).filter(|node| node.has_tag_name("joint"));
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    for (node, joint) in nodes.zip(&robot.joints) {
        let Some(movable) = &joint.movable else {
            continue;
        };
        let kind = node.attribute_node("type");
        let (true, Some(kind)) = (joints.contains(&joint.name.as_str()), kind) else {
            continue;
        };
        edits.push((kind.range_value(), "fixed".to_owned()));
        let origin = elements(node).find(|node| node.has_tag_name("origin"));
        let Some(text) = origin_at_rest(joint, movable) else {
            continue;
        };
        let first = elements(node).next().map(|first| first.range().start);
        let place = origin.map(|origin| origin.range());
        let place = place.or(first.map(|at| at..at));
        edits.extend(place.map(|place| (place, text)));
    }
    let mut fixed = xml.to_owned();
    for (place, text) in edits.into_iter().rev() {
        fixed.replace_range(place, &text);
    }
    Ok(fixed)
}

/// The `<origin>` of the joint once it is fixed; none where that is the one it has.
fn origin_at_rest(joint: &RawJoint, movable: &Movable) -> Option<String> {
    let position = 0.0_f64
        .max(movable.limits.lower.unwrap_or(f64::NEG_INFINITY))
        .min(movable.limits.upper.unwrap_or(f64::INFINITY));
    if position == 0.0 {
        return None;
    }
    let along = movable.axis * position;
    let moved = match movable.kind {
        JointKind::Prismatic => {
            Isometry3::from_parts(Translation3::from(along), UnitQuaternion::identity())
        }
        JointKind::Revolute | JointKind::Continuous => Isometry3::rotation(along),
    };
    let pose = joint.origin * moved;
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let [x, y, z] = pose.translation.vector.into();
    Some(format!(
        r#"<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/>"#
    ))
}
