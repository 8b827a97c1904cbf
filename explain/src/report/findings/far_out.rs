//! Implausible centres of mass: an error of the geometry looks like a body there.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde_json::Value;
use tauscope_dynamics::{Data, Model, forward_kinematics, link_pose};

use crate::report::schema::Finding;

/// Largest distance of the centre of mass at the tool from the flange \[m\].
/// Physical: grippers and spindles are shorter.
const FURTHEST_M: f64 = 0.5;
/// Distance above which a coordinate of a centre of mass is not determined \[m\].
/// Physical: longer than any arm; determined coordinates are smaller.
const NOWHERE_M: f64 = 10.0;
/// Largest distance of a link's centre from its frame, relative to that of the next joint.
/// Physical: motors extend slightly beyond a joint.
const BEYOND: f64 = 1.1;
/// Smallest share of a centre's displacement towards the next joint if the cause is another length of the link.
/// Physical: links are straight, and bodies vary little across them.
const STRAIGHT: f64 = 0.95;

/// Returns the reason why the centre of mass of a finding is implausible, if it is.
pub(super) fn far_out(finding: &Finding, model: &Model) -> Option<&'static str> {
    if vector(finding, "com", least).is_some_and(|com| com.norm() > FURTHEST_M) {
        return Some(
            " No body lies that far from the flange; more likely the tool is mounted with another orientation or at another place.",
        );
    }
    let link = model.link_index(finding.link.as_deref()?)?;
    let delta = vector(finding, "delta_com", |value, _| value)?;
    let next = next_joint(model, link)?;
    let (along, end_m) = (next.normalize(), BEYOND * next.norm());
    let of_urdf = Vector3::from(model.links()[link].com_m()).dot(&along);
    let moves = delta.dot(&along);
    // A wrist's centre may already be beyond its next joint in the URDF.
    let leaves = of_urdf < end_m && of_urdf + moves > end_m && moves > STRAIGHT * delta.norm();
    leaves.then_some(
        " That is beyond the next joint, where the link ends: check whether the URDF has the lengths of this arm.",
    )
}

/// Removes the coordinates of a centre of mass that the motion does not determine: their estimates are arbitrary.
pub(super) fn drop_nowhere(
    parameters: &mut BTreeMap<String, Value>,
    intervals: &mut BTreeMap<String, [f64; 2]>,
) {
    let is_nowhere = |(name, value): (&String, &Value)| {
        name.starts_with("com_") && value.as_f64().is_some_and(|x| x.abs() > NOWHERE_M)
    };
    let nowhere: Vec<String> = (parameters.iter().filter(|one| is_nowhere(*one)))
        .map(|(name, _)| name.clone())
        .collect();
    for name in nowhere {
        parameters.remove(&name);
        intervals.remove(&name);
    }
}

/// Returns the three parameters of a finding with this prefix \[m\], each as `of` its value and its interval.
fn vector(
    finding: &Finding,
    prefix: &str,
    of: fn(f64, Option<&[f64; 2]>) -> f64,
) -> Option<Vector3<f64>> {
    let axis = |axis: &str| {
        let name = format!("{prefix}_{axis}_m");
        let value = finding.parameters.get(&name).and_then(Value::as_f64)?;
        Some(of(value, finding.intervals_95.get(&name)))
    };
    // Parameters that the recordings do not determine are absent.
    let axes = ["x", "y", "z"].map(axis);
    let any = axes.iter().any(Option::is_some);
    any.then(|| axes.map(Option::unwrap_or_default).into())
}

/// Returns the value in an interval that is nearest to zero; zero where the motion does not determine it.
fn least(_: f64, interval: Option<&[f64; 2]>) -> f64 {
    interval.map_or(0.0, |[low, high]| {
        0.0_f64.clamp(low.min(*high), high.max(*low))
    })
}

/// Returns the position of the nearest joint that is mounted on a link, in the link's frame \[m\]; `None` at the end
/// of an arm.
fn next_joint(model: &Model, link: usize) -> Option<Vector3<f64>> {
    let mut data = Data::new(model);
    forward_kinematics(model, &mut data, &vec![0.0; model.dof()]);
    let own = link_pose(model, &data, link).inverse();
    let hangs = model.joints().iter().filter(|joint| {
        let carrier = model.links()[joint.parent_link].joint;
        carrier.is_some_and(|carrier| model.body_link(carrier) == link)
    });
    let places = hangs.map(|joint| {
        (own * link_pose(model, &data, joint.child_link))
            .translation
            .vector
    });
    let nearest = places.min_by(|a, b| a.norm().total_cmp(&b.norm()));
    nearest.filter(|place| place.norm() > 0.0)
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
        let next = next_joint(&model, first).unwrap();
        assert!(
            (next - Vector3::new(0.0, 0.0, 0.4)).norm() < 1e-12,
            "{next}"
        );
        assert!(next_joint(&model, second).is_none());
    }

    #[test]
    fn an_axis_that_the_motion_does_not_tell_is_not_told() {
        let all = [("com_x_m", 0.02), ("com_z_m", -3.7e7), ("mass_kg", 1.9)];
        let mut parameters = all
            .map(|(name, x)| (name.to_owned(), Value::from(x)))
            .into();
        let mut intervals = all.map(|(name, x)| (name.to_owned(), [x, x])).into();
        drop_nowhere(&mut parameters, &mut intervals);
        assert!(parameters.keys().eq(["com_x_m", "mass_kg"]));
        assert!(intervals.keys().eq(["com_x_m", "mass_kg"]));
    }

    #[test]
    fn what_the_motion_does_not_determine_is_nowhere() {
        assert!(least(-4e7, Some(&[-9e7, 3e7])).abs() < 1e-12);
        assert!((least(0.6, Some(&[0.55, 0.65])) - 0.55).abs() < 1e-12);
        assert!(least(-4e7, None).abs() < 1e-12);
    }
}
