//! Fixing joints in the text of a URDF, for example those of a gripper that are not recorded.

use std::ops::Range;

use super::ModelError;
use super::document::{elements, parse};
use super::urdf::{Movable, RawJoint, read};

/// Returns the URDF `xml` with the movable joints of these names made fixed, each at the position within its limits
/// that is nearest to zero. Joints that follow them are fixed at the corresponding positions. All other text stays as
/// it is. Names without a movable joint are ignored.
///
/// # Errors
/// If the text or its elements are invalid.
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
        let position = position_at_rest(joint, movable, joints, &robot.joints)?;
        let (Some(position), Some(kind)) = (position, kind) else {
            continue;
        };
        edits.push((kind.range_value(), "fixed".to_owned()));
        let origin = elements(node).find(|node| node.has_tag_name("origin"));
        if position == 0.0 {
            continue;
        }
        let text = origin_at(joint, movable, position);
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

/// Position at which a joint is fixed \[rad or m\], if it is one of `fixed` or follows one.
fn position_at_rest(
    joint: &RawJoint,
    movable: &Movable,
    fixed: &[&str],
    all: &[RawJoint],
) -> Result<Option<f64>, ModelError> {
    let nearest = |movable: &Movable| {
        0.0_f64
            .max(movable.limits.lower.unwrap_or(f64::NEG_INFINITY))
            .min(movable.limits.upper.unwrap_or(f64::INFINITY))
    };
    if fixed.contains(&joint.name.as_str()) {
        return Ok(Some(nearest(movable)));
    }
    let leader = joint.leader(all)?;
    let leader = leader.filter(|leader| fixed.contains(&all[leader.joint].name.as_str()));
    Ok(leader.and_then(|leader| {
        let movable = all[leader.joint].movable.as_ref()?;
        Some(leader.ratio * nearest(movable) + leader.offset)
    }))
}

/// The `<origin>` of the joint after it is fixed at a position.
fn origin_at(joint: &RawJoint, movable: &Movable, position: f64) -> String {
    let pose = joint.origin * movable.moved(position);
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let [x, y, z] = pose.translation.vector.into();
    format!(r#"<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} {yaw}"/>"#)
}
