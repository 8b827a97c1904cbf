//! The arm as a tree of links and joints, independent of the order of the joints in the URDF.

use std::collections::BTreeSet;

use crate::{Data, JointKind, Model, forward_kinematics, link_pose};

/// Joints that carry a link.
pub fn bearing(model: &Model, link: usize) -> BTreeSet<usize> {
    let links = std::iter::successors(Some(link), |&link| model.links()[link].parent);
    links.filter_map(|link| model.links()[link].joint).collect()
}

/// Link moved by the last joint before `link`: `link` itself or the link it is fixed to.
pub fn moving_link(model: &Model, link: usize) -> usize {
    let slot = model.frames[link].slot;
    if slot == 0 {
        return link;
    }
    let before = |at: &usize| model.links()[*at].parent;
    let on_it = |at: &usize| model.frames[*at].slot == slot;
    let chain = std::iter::successors(Some(link), before).take_while(on_it);
    chain.last().unwrap_or(link)
}

/// Upper bound on the distance of a link's frame from the base link's frame \[m\]: the sum of the distances between
/// the frames along the chain, which revolute joints do not change, and of the travel of sliding joints. Infinite if
/// a sliding joint has no limits.
pub fn reach_m(model: &Model, link: usize) -> f64 {
    let mut data = Data::new(model);
    forward_kinematics(model, &mut data, &vec![0.0; model.dof()]);
    let place = |link: usize| link_pose(model, &data, link).translation.vector;
    let mut reach_m = 0.0;
    let mut at = link;
    while let Some(joint) = model.links()[at].joint.map(|joint| &model.joints()[joint]) {
        reach_m += (place(at) - place(joint.child_link)).norm();
        reach_m += (place(joint.child_link) - place(joint.parent_link)).norm();
        if joint.kind == JointKind::Prismatic {
            let limits = [joint.limits.lower, joint.limits.upper];
            let slides_m = limits.map(|limit| limit.map_or(f64::INFINITY, f64::abs));
            reach_m += slides_m[0].max(slides_m[1]);
        }
        at = joint.parent_link;
    }
    reach_m + (place(at) - place(model.base_link())).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> Model {
        Model::from_urdf(include_str!("../../tests/data/demo_arm.urdf")).unwrap()
    }

    #[test]
    fn no_pose_brings_the_tool_beyond_its_reach_and_a_stretched_chain_comes_near() {
        let model = model();
        let reach_m = reach_m(&model, model.tool_link());
        let mut data = Data::new(&model);
        let mut farthest_m = 0.0_f64;
        for k in 0..4000_u32 {
            // A low-discrepancy walk through all poses.
            let q: Vec<f64> = (0..model.dof())
                .map(|j| 3.0 * (f64::from(k) * (2.0 + j as f64).sqrt()).sin())
                .collect();
            forward_kinematics(&model, &mut data, &q);
            let at = link_pose(&model, &data, model.tool_link())
                .translation
                .vector;
            farthest_m = farthest_m.max(at.norm());
        }
        assert!(
            farthest_m <= reach_m + 1e-9,
            "{farthest_m} m beyond {reach_m} m"
        );
        assert!(farthest_m > 0.6 * reach_m, "{farthest_m} m of {reach_m} m");
    }

    #[test]
    fn a_base_moves_with_itself() {
        let model = model();
        assert_eq!(moving_link(&model, model.base_link()), model.base_link());
    }
}
