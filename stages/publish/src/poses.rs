//! Poses of the links at a sample, for the conversion of a force to the frame of the touched link.

use std::collections::VecDeque;

use nalgebra::Vector3;
use tauscope_bus::{Detection, JointArray};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_pose};

/// Number of positions kept; a detection lags behind the motion by at most this many samples.
const REMEMBERED: usize = 64;

/// Force and moment in a link's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkWrench {
    /// Force \[N\].
    pub force_n: [f64; 3],
    /// Moment about the link's origin \[N m\].
    pub moment_nm: [f64; 3],
}

/// The arm's positions over the last samples.
pub struct Poses {
    model: Model,
    data: Data,
    positions: VecDeque<(i64, JointArray)>,
}

impl Poses {
    /// Creates the poses of this robot.
    pub fn new(model: Model) -> Self {
        Self {
            data: Data::new(&model),
            model,
            positions: VecDeque::with_capacity(REMEMBERED),
        }
    }

    /// Returns the index of the link in the order of the URDF, from 0.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.model.link_index(name)
    }

    /// Returns the name of the root link, whose frame is the world's.
    pub fn root(&self) -> Option<&str> {
        let links = self.model.links();
        let root = links.iter().find(|link| link.parent.is_none())?;
        Some(&root.name)
    }

    /// Takes the positions of a sample.
    pub fn push(&mut self, stamp_ns: i64, position: &JointArray) {
        if self.positions.len() == REMEMBERED {
            self.positions.pop_front();
        }
        self.positions.push_back((stamp_ns, *position));
    }

    /// Returns the force of a detection in the frame of the link that it names; `None` if link or position are
    /// unknown.
    pub fn at_link(&mut self, detection: &Detection) -> Option<LinkWrench> {
        let link = self.link(detection.link.as_str())?;
        let stamp_ns = detection.header.stamp_ns;
        let nearest = self
            .positions
            .iter()
            .min_by_key(|(at, _)| at.abs_diff(stamp_ns))?;
        forward_kinematics(&self.model, &mut self.data, &nearest.1[..self.model.dof()]);
        let pose = link_pose(&self.model, &self.data, link);
        let force = Vector3::from(detection.force_n);
        let lever = Vector3::from(detection.point_m) - pose.translation.vector;
        let to_link = pose.rotation.inverse();
        Some(LinkWrench {
            force_n: (to_link * force).into(),
            moment_nm: (to_link * lever.cross(&force)).into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDULUM: &str = r#"<robot name="pendulum"><link name="base"/>
      <link name="rod"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
      <joint name="hinge" type="revolute"><origin xyz="0 0 1"/><parent link="base"/><child link="rod"/>
        <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="50"/></joint></robot>"#;

    #[test]
    fn a_force_is_turned_into_the_link_and_has_a_moment_about_its_origin() {
        let mut poses = Poses::new(Model::from_urdf(PENDULUM).unwrap());
        let mut position = [0.0; 16];
        poses.push(1, &position);
        position[0] = std::f64::consts::FRAC_PI_2;
        poses.push(2, &position);
        let mut detection = Detection {
            link: "rod".into(),
            force_n: [0.0, 3.0, 0.0],
            // Half a metre out along the rod, which points to the world's y.
            point_m: [0.0, 0.5, 1.0],
            ..Detection::default()
        };
        detection.header.stamp_ns = 2;
        let wrench = poses.at_link(&detection).unwrap();
        let near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(wrench.force_n, [3.0, 0.0, 0.0]), "{wrench:?}");
        assert!(near(wrench.moment_nm, [0.0; 3]), "{wrench:?}");
        detection.force_n = [2.0, 0.0, 0.0];
        let wrench = poses.at_link(&detection).unwrap();
        assert!(near(wrench.moment_nm, [0.0, 0.0, -1.0]), "{wrench:?}");
        detection.link = "nowhere".into();
        assert_eq!(poses.at_link(&detection), None);
    }
}
