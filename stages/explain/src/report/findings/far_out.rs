//! Centres of mass where no body is: what looks like a body there is the geometry.

use nalgebra::Vector3;
use serde_json::Value;
use tauscope_dynamics::{Data, Model, forward_kinematics, link_pose};

use crate::report::schema::Finding;

/// The centre of what is at the tool is no further out \[m\].
/// Physical: grippers and spindles are shorter.
const FURTHEST_M: f64 = 0.5;
/// A link's centre is no further from its frame than this many times the next joint.
/// Physical: motors stand out beyond a joint by a little.
const BEYOND: f64 = 1.1;

/// Why the centre of mass of a finding cannot be where it says, if so.
pub(super) fn far_out(finding: &Finding, model: &Model) -> Option<&'static str> {
    let vector = |prefix: &str| {
        let of = |axis| {
            finding
                .parameters
                .get(&format!("{prefix}_{axis}_m"))
                .and_then(Value::as_f64)
        };
        Some(Vector3::new(of("x")?, of("y")?, of("z")?))
    };
    if vector("com").is_some_and(|com| com.norm() > FURTHEST_M) {
        return Some(
            " So far out is no body: the tool is rather turned, or mounted elsewhere than the URDF says.",
        );
    }
    let link = model.link_index(finding.link.as_deref()?)?;
    let of_urdf = Vector3::from(model.links()[link].com_m());
    let end_m = BEYOND * next_joint_m(model, link)?;
    // A wrist's centre may be beyond its next joint in the URDF already.
    let leaves = of_urdf.norm() < end_m && (of_urdf + vector("delta_com")?).norm() > end_m;
    leaves.then_some(
        " That is beyond the next joint, where the link ends: check whether the URDF has the lengths of this arm.",
    )
}

/// How far the nearest joint that hangs on a link is from the link's frame \[m\]; none at the end of an arm.
fn next_joint_m(model: &Model, link: usize) -> Option<f64> {
    let mut data = Data::new(model);
    forward_kinematics(model, &mut data, &vec![0.0; model.dof()]);
    let at = |link: usize| link_pose(model, &data, link).translation.vector;
    let hangs = model.joints().iter().filter(|joint| {
        let carrier = model.links()[joint.parent_link].joint;
        carrier.is_some_and(|carrier| model.joints()[carrier].child_link == link)
    });
    let distances = hangs.map(|joint| (at(joint.child_link) - at(link)).norm());
    distances
        .min_by(f64::total_cmp)
        .filter(|distance| *distance > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn the_next_joint_is_where_the_next_link_begins_and_the_last_link_has_none() {
        let model = fixture::model();
        let first = model.joints()[0].child_link;
        let second = model.joints()[1].child_link;
        assert!(next_joint_m(&model, first).is_some_and(|distance| distance > 0.1));
        assert!(next_joint_m(&model, second).is_none());
    }
}
