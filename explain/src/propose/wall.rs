//! Proposed walls: from the force at the end of the arm that explains the residual.

use nalgebra::{Matrix3, Point3, Vector3};
use tauscope_dynamics::kinematic_tree::moving_link;
use tauscope_dynamics::{Data, forward_kinematics, link_jacobian, link_pose};

use crate::data::problem::Problem;
use crate::fit::fitted::{Fit, LEAST_VARIANCE};
use crate::physics::active::Hypothesis;

/// Smallest reduction of the sum of squares over the variance by the best force at a contact sample.
/// Statistical: white noise exceeds it in one of 700 000 samples (chi-square, three degrees of freedom).
const EVIDENT: f64 = 30.0;
/// Quantiles of the depth of the contact samples at which the wall's surface is tried.
/// Resolution: the surface is refined afterwards.
const SURFACES: [f64; 3] = [0.0, 0.1, 0.4];
/// Ridge added to the diagonal of a sample's normal equations, relative to their trace: some directions of a force
/// cause no joint torque.
/// Resolution: far below the observable directions.
const RIDGE: f64 = 1e-3;
/// Smallest sum of forces with a direction \[N\].
/// Resolution: guards a division by zero; far below any measured force.
const LEAST_FORCE_N: f64 = 1e-9;

/// Returns the walls to try, with zero stiffness: the normal is the direction of the force, the surface is where it
/// begins.
///
/// Contact samples are found in two ways. Forces above the residual indicate a wall that the arm touches now and
/// then. Forces above the white noise indicate a wall in nearly permanent contact.
pub fn shapes(problem: &Problem, fit: &Fit, hypothesis: Hypothesis) -> Vec<Vec<f64>> {
    let noise = problem.white_noise.iter();
    let noise: Vec<f64> = noise
        .map(|sigma| (sigma * sigma).max(LEAST_VARIANCE))
        .collect();
    let link = moving_link(&problem.model, hypothesis.place.link);
    let of = |variance: &Vec<f64>| walls(&contacts(problem, fit, link, variance));
    [&fit.variance, &noise].into_iter().flat_map(of).collect()
}

/// Returns the walls at the contact samples of one link.
fn walls(contacts: &[(Point3<f64>, Vector3<f64>)]) -> Vec<Vec<f64>> {
    let along = |total: Vector3<f64>| Some(-total.try_normalize(LEAST_FORCE_N)?);
    let Some(mean) = along(contacts.iter().map(|(_, force)| force).sum()) else {
        return Vec::new();
    };
    // Forces are uncertain in directions without joint torque, so those towards the wall are ignored.
    let agreeing = contacts.iter().filter(|(_, force)| force.dot(&mean) < 0.0);
    let Some(direction) = along(agreeing.map(|(_, force)| force).sum()) else {
        return Vec::new();
    };
    let depth = |(point, _): &(Point3<f64>, Vector3<f64>)| direction.dot(&point.coords);
    let mut depths: Vec<f64> = contacts.iter().map(depth).collect();
    depths.sort_by(f64::total_cmp);
    let azimuth = direction.y.atan2(direction.x);
    let elevation = direction.z.clamp(-1.0, 1.0).asin();
    let surface = |quantile: f64| depths[(quantile * (depths.len() - 1) as f64) as usize];
    SURFACES
        .map(|quantile| vec![0.0, azimuth, elevation, surface(quantile)])
        .into()
}

/// Returns the samples with a significant force on a link, given `variance`: position of the link's frame \[m\] and
/// force \[N\].
fn contacts(
    problem: &Problem,
    fit: &Fit,
    link: usize,
    variance: &[f64],
) -> Vec<(Point3<f64>, Vector3<f64>)> {
    let n = problem.joints;
    let mut data = Data::new(&problem.model);
    let mut found = Vec::new();
    for track in &problem.tracks {
        for (row, &k) in track.rows().zip(&track.compared) {
            let position = &track.track.position[k * n..(k + 1) * n];
            forward_kinematics(&problem.model, &mut data, position);
            let point = link_pose(&problem.model, &data, link).translation.vector;
            let jacobian = link_jacobian(&problem.model, &mut data, link);
            let mut normal = Matrix3::zeros();
            let mut right = Vector3::zeros();
            for j in 0..n {
                let at = j * problem.rows + row;
                let weight = 1.0 / variance[j];
                let column = Vector3::new(jacobian[(0, j)], jacobian[(1, j)], jacobian[(2, j)]);
                normal += weight * column * column.transpose();
                right -= weight * fit.residual[at] * column;
            }
            let ridge = RIDGE * normal.trace();
            let Some(factor) = (normal + Matrix3::identity() * ridge).cholesky() else {
                continue;
            };
            let force: Vector3<f64> = factor.solve(&right);
            if right.dot(&force) > EVIDENT {
                found.push((Point3::from(point), force));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::Model;
    use tauscope_dynamics::terms::effect;

    use crate::fixture::{URDF, problem, recording};
    use crate::inference::estimated;
    use crate::physics::active::{Hypothesis, Whereabouts};
    use tauscope_dynamics::kinematic_tree::{bearing, moving_link, reach_m};

    /// Returns stiffness \[N/m\] and offset \[m\] of the estimated wall for an arm that presses on a floor of 800 N/m
    /// at -0.62 m.
    fn found(urdf: &str) -> (f64, f64) {
        let model = Model::from_urdf(urdf).unwrap();
        let place = Whereabouts {
            link: model.link_index("lower").unwrap(),
            ..Whereabouts::default()
        };
        let wall = Hypothesis {
            effect: effect("contact_wall").unwrap(),
            place,
        };
        let truth = wall.with((wall.effect.to_coordinates)(&[
            800.0, 0.0, 0.0, -1.0, -0.62,
        ]));
        let mut term = truth.term(&model);
        let zero = vec![0.0; model.dof()];
        let press = |q: &[f64], qd: &[f64], effort: &mut [f64]| {
            let at = tauscope_dynamics::terms::MotionSample {
                dt_s: 0.01,
                recording_s: 0.0,
                session_s: 0.0,
                position: q,
                velocity: qd,
                acceleration: &zero,
                transmitted: &zero,
            };
            term.act(&at, effort);
        };
        let data = problem(&model, &[recording(&model, 3, press)]);
        let found = estimated(&data, Vec::new(), &[wall], true);
        let parameters = found.fit.actives[0].parameters();
        (parameters[0], parameters[4])
    }

    /// Returns the robot of [`URDF`] with its joints in another order and two sliding fingers on its last link.
    fn shuffled_with_a_gripper() -> String {
        let start = URDF.find("  <joint name=\"shoulder\"").unwrap();
        let middle = URDF.find("  <joint name=\"elbow\"").unwrap();
        let end = URDF.find("</robot>").unwrap();
        let finger = |name: &str, y: f64| {
            format!(
                r#"<link name="{name}_pad"><inertial><mass value="1e-6"/><inertia ixx="1e-12" ixy="0" ixz="0" iyy="1e-12"
                iyz="0" izz="1e-12"/></inertial></link><joint name="{name}" type="prismatic"><parent link="lower"/><child link="{name}_pad"/>
                <origin xyz="0 {y} 0.3"/><axis xyz="0 1 0"/><limit lower="0" upper="0.04" velocity="1" effort="20"/></joint>"#
            )
        };
        [
            &URDF[..start],
            &finger("left", 0.02),
            &URDF[middle..end],
            &URDF[start..middle],
            &finger("right", -0.02),
            "</robot>",
        ]
        .concat()
    }

    #[test]
    fn the_order_of_joints_in_the_urdf_and_a_gripper_change_nothing() {
        let ((stiffness, offset), (other_stiffness, other_offset)) =
            (found(URDF), found(&shuffled_with_a_gripper()));
        assert!((stiffness / 800.0 - 1.0).abs() < 0.1, "{stiffness} N/m");
        assert!((offset + 0.62).abs() < 0.02, "{offset} m");
        assert!((stiffness / other_stiffness - 1.0).abs() < 1e-3);
        assert!((offset - other_offset).abs() < 1e-3);
        let names = |urdf: &str| {
            let model = Model::from_urdf(urdf).unwrap();
            let link = model.link_index("lower").unwrap();
            let joints = bearing(&model, link).into_iter();
            let mut names: Vec<String> = joints
                .map(|joint| model.joints()[joint].name.clone())
                .collect();
            names.sort();
            let reach_mm = (1e3 * reach_m(&model, link)).round() as i64;
            (names, reach_mm, moving_link(&model, link) == link)
        };
        assert_eq!(names(URDF), names(&shuffled_with_a_gripper()));
    }
}
