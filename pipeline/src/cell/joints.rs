//! Joints that a recording contains, and fixing of the robot's other joints.

use std::path::Path;

use tauscope_dynamics::{Model, fix_joints};
use tauscope_session::{Joints, Look, SessionError};

use crate::report::{Problem, Report};
use crate::suggest;

/// Returns the joint names on the topic, in the order of the messages.
///
/// # Errors
/// If the recording cannot be read or has no joint states on the topic.
pub fn recorded_joint_names(path: &Path, topic: &str) -> Result<Vec<String>, Report> {
    let wrong = |error: SessionError| Report::from(Problem::new(error.to_string()));
    let archive = tauscope_session::open(path).map_err(|error| wrong(error.into()))?;
    let look = Look::at(&archive, Some(topic), Joints::default()).map_err(wrong)?;
    Ok(look.recorded())
}

/// A robot whose unrecorded joints are fixed.
#[derive(Debug)]
pub struct Fixed {
    /// Its URDF.
    pub urdf: String,
    /// The robot.
    pub model: Model,
    /// The fixed joints.
    pub joints: Vec<String>,
}

impl Fixed {
    /// Fixes the joints of the robot `model` of `urdf` that are not `recorded`, such as those of a gripper. `None` if
    /// all are recorded, if they may have been recorded under other names, or if they carry a recorded joint.
    pub fn unrecorded(urdf: &str, model: &Model, recorded: &[String]) -> Option<Self> {
        let is_recorded = |name: &str| recorded.iter().any(|other| other == name);
        let unrecorded: Vec<&str> = model
            .joint_names()
            .filter(|name| !is_recorded(name))
            .collect();
        let follows = |name: &str| model.followers().iter().any(|one| one.name == name);
        let are_known = recorded
            .iter()
            .all(|name| model.joint_index(name).is_some() || follows(name));
        if unrecorded.is_empty() || recorded.is_empty() || !are_known {
            return None;
        }
        let carries_one = (0..model.dof())
            .filter(|&joint| is_recorded(&model.joints()[joint].name))
            .any(|joint| {
                let before = std::iter::successors(Some(joint), |&at| {
                    model.links()[model.joints()[at].parent_link].joint
                });
                before
                    .skip(1)
                    .any(|at| !is_recorded(&model.joints()[at].name))
            });
        if carries_one {
            return None;
        }
        let urdf = fix_joints(urdf, &unrecorded).ok()?;
        let model = Model::from_urdf(&urdf).ok()?;
        let joints = unrecorded.into_iter().map(str::to_owned).collect();
        Some(Self {
            urdf,
            model,
            joints,
        })
    }

    /// Note about the fixed joints.
    pub fn note(&self) -> String {
        let joints: Vec<&str> = self.joints.iter().map(String::as_str).collect();
        format!(
            "No recording names {} of the robot. Unrecorded joints are fixed at position zero, or at the nearest position within the limits. If such \
             a joint moves, the twin's efforts are wrong. A joint that others move, such as one that a parallelogram keeps level, \
             needs a <mimic> in the URDF.",
            suggest::some(&joints)
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    const INERTIAL: &str = "<inertial><mass value='1'/>\
        <inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";

    /// A chain of shoulder, elbow and finger, with a thumb that mimics the finger.
    fn fixed(recorded: &[&str]) -> Option<Fixed> {
        let links = ["upper", "lower", "finger", "thumb"]
            .map(|name| format!("<link name='{name}'>{INERTIAL}</link>"));
        let joint = |name, parent, child, rest| {
            format!(
                "<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>{rest}</joint>"
            )
        };
        let urdf = format!(
            "<robot name='r'><link name='base'/>{}{}{}{}{}</robot>",
            links.concat(),
            joint(
                "shoulder",
                "base",
                "upper",
                "<limit lower='-1' upper='1' effort='1' velocity='1'/>"
            ),
            joint(
                "elbow",
                "upper",
                "lower",
                "<limit lower='-1' upper='1' effort='1' velocity='1'/>"
            ),
            joint(
                "finger",
                "lower",
                "finger",
                "<limit lower='0' upper='1' effort='1' velocity='1'/>"
            ),
            joint(
                "thumb",
                "lower",
                "thumb",
                "<limit lower='0' upper='1' effort='1' velocity='1'/><mimic joint='finger'/>"
            ),
        );
        let model = Model::from_urdf(&urdf).unwrap();
        let recorded: Vec<String> = recorded.iter().map(|&name| name.to_owned()).collect();
        Fixed::unrecorded(&urdf, &model, &recorded)
    }

    #[test]
    fn a_gripper_that_nobody_records_is_fixed() {
        let fixed = fixed(&["elbow", "shoulder"]).unwrap();
        assert_eq!(fixed.joints, ["finger"]);
        assert!(
            fixed.model.followers().is_empty(),
            "the thumb is fixed, too"
        );
        assert!(fixed.model.joint_names().eq(["shoulder", "elbow"]));
        // The mass of the fixed links is kept.
        assert!((fixed.model.body_parameters(1)[0] - 3.0).abs() < 1e-12);
        assert!(fixed.note().contains("finger"), "{}", fixed.note());
    }

    #[test]
    fn a_robot_that_is_recorded_whole_stays_as_it_is() {
        assert!(fixed(&["shoulder", "elbow", "finger", "thumb"]).is_none());
    }

    #[test]
    fn what_carries_a_recorded_joint_or_may_have_another_name_is_not_fixed() {
        assert!(fixed(&["elbow", "finger", "thumb"]).is_none());
        assert!(fixed(&["shoulder", "elbow", "gripper"]).is_none());
        assert!(fixed(&[]).is_none());
    }
}
