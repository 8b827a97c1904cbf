//! Parsing of URDFs, and the messages for invalid ones.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(clippy::float_cmp, reason = "numbers are read as they are written")]

use tauscope_dynamics::{
    Data, Follower, Geometry, JointKind, Limits, Model, fix_joints, forward_kinematics, link_pose,
    mass_matrix,
};

const INERTIAL: &str = "<inertial><origin xyz='0 0 0.1'/><mass value='2'/>\
    <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial>";

/// Two arms on a column, with all elements that are read or ignored.
fn robot() -> String {
    format!(
        r#"<?xml version="1.0"?>
<robot name="two_arms" xmlns:xacro="http://ros.org/wiki/xacro">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <gazebo reference="left"><selfCollide>true</selfCollide></gazebo>
  <joint name="left_arm" type="revolute">
    <parent link="column"/>
    <child link="left"/>
    <origin xyz="0 1 0" rpy="0 0 1.5707963267948966"/>
    <axis xyz="0 0 2"/>
    <limit lower="-1" upper="1.5" velocity="3" effort="40"/>
  </joint>
  <joint name="weld" type="fixed"><parent link="left"/><child link="hand"/><origin xyz="0.5 0 0"/></joint>
  <joint name="hoist" type="prismatic">
    <parent link="base"/>
    <child link="column"/>
    <axis xyz="0 0 1"/>
    <limit lower="0" upper="0.6" velocity="0.2" effort="INF"/>
  </joint>
  <joint name="right_arm" type="continuous">
    <parent link="column"/>
    <child link="right"/>
    <limit velocity="2" effort="10"/>
  </joint>
  <link name="base"><visual><geometry><mesh filename="package://x/base.stl" scale="1 1 2"/></geometry></visual></link>
  <link name="column">{INERTIAL}
    <visual><origin xyz="0 0 0.3"/><geometry><box size="0.1 0.2 0.6"/></geometry><material name="grey"/></visual>
    <visual><geometry><sphere radius="0.1"/></geometry></visual>
  </link>
  <link name="left"><visual><geometry><cylinder radius="0.05" length="0.4"/></geometry></visual></link>
  <link name="hand">{INERTIAL}</link>
  <link name="right">{INERTIAL}</link>
  <transmission name="t"><type>x</type><joint name="left_arm"/></transmission>
  <ros2_control name="c" type="system"><joint name="left_arm"/></ros2_control>
</robot>
"#
    )
}

fn refusal(xml: &str) -> String {
    Model::from_urdf(xml).unwrap_err().to_string()
}

#[test]
fn limits_that_leave_no_room_count_as_none_and_are_told() {
    let with = |limit: &str| {
        Model::from_urdf(&format!(
            "<robot name='a'><link name='base'/><link name='tip'><inertial><mass value='1'/>\
             <inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>\
             <joint name='j' type='revolute'><parent link='base'/><child link='tip'/>\
             <limit effort='1' velocity='1' {limit}/></joint></robot>"
        ))
        .unwrap()
        .joints()[0]
            .clone()
    };
    for limit in [
        "lower='1.5' upper='-1.5'",
        "lower='0' upper='0'",
        "lower='1'",
    ] {
        let joint = with(limit);
        assert_eq!((joint.limits.lower, joint.limits.upper), (None, None));
        let remark = joint.remark().unwrap();
        assert!(remark.contains("`j` counts as unlimited"), "{remark}");
    }
    assert_eq!(with("").remark(), None, "none are given");
    assert_eq!(with("lower='-1' upper='1'").remark(), None);
}

#[test]
fn joints_links_limits_and_shapes_are_as_written() {
    let model = Model::from_urdf(&robot()).unwrap();
    assert_eq!(model.name(), "two_arms");
    assert!(model.joint_names().eq(["left_arm", "hoist", "right_arm"]));
    let kinds: Vec<_> = model.joints().iter().map(|joint| joint.kind).collect();
    assert_eq!(
        kinds,
        [
            JointKind::Revolute,
            JointKind::Prismatic,
            JointKind::Continuous
        ]
    );
    let [left, hoist, right] = [0, 1, 2].map(|j| &model.joints()[j]);
    assert_eq!(
        left.limits,
        Limits {
            lower: Some(-1.0),
            upper: Some(1.5),
            velocity: Some(3.0),
            effort: Some(40.0),
            ignored: None,
        }
    );
    assert_eq!(hoist.limits.effort, None, "infinite is none");
    assert_eq!(hoist.limits.lower, Some(0.0));
    assert_eq!((right.limits.lower, right.limits.upper), (None, None));
    assert_eq!(left.axis, [0.0, 0.0, 1.0], "of length 1");
    assert_eq!(right.axis, [1.0, 0.0, 0.0], "URDF's default");

    let names: Vec<_> = model
        .links()
        .iter()
        .map(|link| link.name.as_str())
        .collect();
    assert_eq!(names, ["base", "column", "left", "hand", "right"]);
    let [base, column, left, hand, right] = [0, 1, 2, 3, 4].map(|l| &model.links()[l]);
    assert_eq!(
        [
            base.joint,
            column.joint,
            left.joint,
            hand.joint,
            right.joint
        ],
        [None, Some(1), Some(0), Some(0), Some(2)]
    );
    assert_eq!(
        [
            base.parent,
            column.parent,
            left.parent,
            hand.parent,
            right.parent
        ],
        [None, Some(0), Some(1), Some(2), Some(1)]
    );
    assert_eq!(
        (left.mass_kg(), hand.mass_kg(), hand.com_m()),
        (0.0, 2.0, [0.0, 0.0, 0.1])
    );
    assert_eq!(
        base.shapes[0].geometry,
        Geometry::Mesh {
            filename: "package://x/base.stl".to_owned(),
            scale: [1.0, 1.0, 2.0]
        }
    );
    assert_eq!(
        column.shapes[0].geometry,
        Geometry::Box {
            size_m: [0.1, 0.2, 0.6]
        }
    );
    assert_eq!(column.shapes[0].origin.translation.z, 0.3);
    assert_eq!(
        column.shapes[1].geometry,
        Geometry::Sphere { radius_m: 0.1 }
    );
    assert_eq!(
        left.shapes[0].geometry,
        Geometry::Cylinder {
            radius_m: 0.05,
            length_m: 0.4
        }
    );
}

#[test]
fn a_link_behind_a_fixed_joint_is_lumped_and_stays_a_frame() {
    let model = Model::from_urdf(&robot()).unwrap();
    let moved = model.body_parameters(0);
    let expected = [2.0, 1.0, 0.0, 0.2];
    for (found, expected) in moved.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-15, "{moved:?}");
    }
    let mut data = Data::new(&model);
    forward_kinematics(&model, &mut data, &[std::f64::consts::FRAC_PI_2, 0.25, 0.0]);
    let hand = link_pose(&model, &data, model.link_index("hand").unwrap());
    let expected = nalgebra::Vector3::new(-0.5, 1.0, 0.25);
    assert!((hand.translation.vector - expected).norm() < 1e-15);
}

#[test]
fn what_is_no_urdf_is_told_apart() {
    assert_eq!(
        refusal("<robot name='r'>\n  <link name='a'>\n</robot>"),
        "not well-formed XML at line 3, column 1: expected 'link' tag, not 'robot' at 3:1"
    );
    // A file that was copied incompletely.
    assert_eq!(
        refusal("<robot name='r'>\n  <link name='a"),
        "not well-formed XML at line 2, column 16: the file ends in the middle of it"
    );
    assert_eq!(
        refusal("<?xml version='1.0'?>\n<sdf version='1.9'/>"),
        "line 2: the document is a <sdf>, a URDF is a <robot>; SDF is not read: give the URDF or xacro file that the \
         model was made from (`gz sdf -p` only converts URDF to SDF)"
    );
    assert_eq!(
        refusal("<mujoco model='arm'>\n<worldbody/></mujoco>"),
        "line 1: the document is a <mujoco>, a URDF is a <robot>; MJCF must be converted first: `pip install \
         mjcf-urdf-simple-converter`, then `python3 -c 'from mjcf_urdf_simple_converter import convert; \
         convert(\"FILE.xml\", \"FILE.urdf\")'` (hinge joints only)"
    );
    assert_eq!(
        refusal("<html/>"),
        "line 1: the document is a <html>, a URDF is a <robot>"
    );
    let xacro =
        "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'>\n<xacro:arm/></robot>";
    assert_eq!(
        refusal(xacro),
        "line 2: `<xacro:arm>` is xacro, not URDF; expand it first: `xacro FILE.xacro > FILE.urdf` (with ROS 2: \
         `ros2 run xacro xacro FILE.xacro > FILE.urdf`)"
    );
    assert!(refusal("<robot name='r'>\n<xacro:arm/></robot>").starts_with("line 2: `xacro:` is"));
    let expression = robot().replace("velocity=\"3\"", "velocity=\"${pi}\"");
    assert!(refusal(&expression).starts_with("line 10: `${pi}` is xacro"));
    assert_eq!(
        refusal("<robot name='post'><link name='a'/></robot>"),
        "the robot `post` has no movable joint"
    );
}

#[test]
fn each_fault_is_refused_by_name_and_line() {
    for (from, to, expected) in [
        (
            "type=\"continuous\"",
            "type=\"floating\"",
            "line 19: joint `right_arm` is floating; revolute, continuous, prismatic and fixed joints are supported",
        ),
        (
            "type=\"continuous\"",
            "type=\"planar\"",
            "line 19: joint `right_arm` is planar; revolute, continuous, prismatic and fixed joints are supported",
        ),
        (
            "<axis xyz=\"0 0 2\"/>",
            "<axis xyz=\"0 0 0\"/>",
            "line 5: the axis of joint `left_arm` is zero",
        ),
        (
            "<link name=\"right\">",
            "<link name=\"left\">",
            "line 31: a second link `left`; the first is on line 29",
        ),
        (
            "name=\"right_arm\"",
            "name=\"weld\"",
            "line 19: a second joint `weld`; the first is on line 12",
        ),
        (
            "<child link=\"right\"/>",
            "<child link=\"wrong\"/>",
            "line 19: joint `right_arm` names the child link `wrong`, which is not there",
        ),
        (
            "<child link=\"right\"/>",
            "<child link=\"hand\"/>",
            "line 19: link `hand` is the child of both `weld` and `right_arm`",
        ),
        (
            "<link name=\"base\">",
            "<link name=\"world\"/><link name=\"base\">",
            "2 links have no parent joint: `world`, `base`. A robot has one root: connect them to one link by fixed joints, or use one URDF for each arm",
        ),
        (
            "<parent link=\"base\"/>",
            "<parent link=\"hand\"/>",
            "the joints form a cycle: `left_arm`, `weld`, `hoist`",
        ),
        (
            "<axis xyz=\"0 0 2\"/>",
            "<axis xyz=\"0 0 one\"/>",
            "line 9: <axis> of joint `left_arm` has xyz=\"0 0 one\": not three numbers",
        ),
        (
            "upper=\"1.5\"",
            "upper=\"NaN\"",
            "line 10: <limit> of joint `left_arm` has upper=\"NaN\": not a number",
        ),
        (
            "<link name=\"left\">",
            "<link>",
            "line 29: link `` is not valid URDF: missing field `name`",
        ),
        (
            "type=\"continuous\"",
            "type=\"ball\"",
            "line 19: joint `right_arm` is not valid URDF: unknown variant `ball`, expected one of",
        ),
        (
            "<mass value='2'/>",
            "",
            "line 25: link `column` is not valid URDF: missing field `mass`",
        ),
        (
            "<color rgba=\"0.5 0.5 0.5 1\"/>",
            "<color/>",
            "line 2: robot `two_arms` is not valid URDF: missing field `rgba`",
        ),
    ] {
        let xml = robot();
        assert!(xml.contains(from), "{from}");
        let found = refusal(&xml.replacen(from, to, 1));
        assert!(found.starts_with(expected), "{found}\nis not\n{expected}");
    }
}

#[test]
fn masses_must_be_there_and_not_below_zero() {
    let xml = robot();
    let (head, tail) = xml.split_once("<link name=\"hand\">").unwrap();
    let with = |inertial: &str| {
        format!(
            "{head}<link name=\"hand\">{}",
            tail.replacen(INERTIAL, inertial, 1)
        )
    };
    assert_eq!(
        refusal(&with("")),
        "line 5: joint `left_arm` moves no mass: links `left`, `hand` are without a mass in <inertial>"
    );
    // The virtual joint of a gripper has no mass of its own, and fingers that follow it.
    let limit = "<limit velocity=\"2\" effort=\"10\"/>";
    let gripper = with("").replace(limit, "<mimic joint=\"left_arm\"/>");
    let model = Model::from_urdf(&gripper).unwrap();
    let mass = mass_matrix(&model, &mut Data::new(&model), &vec![0.3; model.dof()]).clone();
    assert!(mass.diagonal().min() > 0.0, "{mass}");
    assert_eq!(
        refusal(&with(&INERTIAL.replace("'2'", "'-2'"))),
        "line 30: the mass of link `hand` is -2 kg"
    );
    assert_eq!(
        refusal(&with(&INERTIAL.replace("'2'", "'inf'"))),
        "line 30: <mass> of link `hand` has value=\"inf\": not a number"
    );
}

#[test]
fn a_joint_that_mimics_another_is_none_of_its_own_and_goes_where_that_puts_it() {
    let limit = "<limit velocity=\"2\" effort=\"10\"/>";
    let with = |mimic: &str| robot().replace(limit, mimic);
    let mimic = with("<mimic joint=\"left_arm\" multiplier=\"-2\" offset=\"0.1\"/>");
    let mut model = Model::from_urdf(&mimic).unwrap();
    let name = Model::from_urdf(&robot()).unwrap().joints()[2].name.clone();
    let follower = Follower {
        name,
        joint: model.joint_index("left_arm").unwrap(),
        ratio: -2.0,
        offset: 0.1,
    };
    assert_eq!(model.dof(), 2);
    assert_eq!(model.followers(), [follower]);
    // Shifting the zero of the joint that it follows moves both.
    let moved = pose_of(&model, "right", &[0.3, 0.4]);
    model.shift_zero(0, 0.25);
    let shifted = pose_of(&model, "right", &[0.05, 0.4]);
    for (a, b) in moved.iter().zip(&shifted) {
        assert!((a - b).abs() < 1e-12, "{moved:?} {shifted:?}");
    }
    assert_eq!(
        refusal(&with("<mimic joint=\"nobody\"/>")),
        "line 19: joint `right_arm` mimics joint `nobody`, which the robot does not have"
    );
    assert_eq!(
        refusal(&with("<mimic joint=\"right_arm\"/>")),
        "line 19: joint `right_arm` mimics itself, over others or not: no joint moves it"
    );
}

#[test]
fn what_follows_a_fixed_joint_is_fixed_where_that_puts_it() {
    let limit = "<limit velocity=\"2\" effort=\"10\"/>";
    let mimic = robot().replace(
        limit,
        "<mimic joint=\"left_arm\" multiplier=\"-2\" offset=\"0.1\"/>",
    );
    let low = mimic.replace("lower=\"-1\" upper=\"1.5\"", "lower=\"0.4\" upper=\"1.5\"");
    let whole = Model::from_urdf(&robot()).unwrap();
    let fixed = Model::from_urdf(&fix_joints(&low, &["left_arm"]).unwrap()).unwrap();
    assert!(fixed.followers().is_empty());
    for link in ["left", "hand", "right"] {
        let stands = pose_of(&fixed, link, &vec![0.0; fixed.dof()]);
        let mut positions = vec![0.0; whole.dof()];
        positions[whole.joint_index("left_arm").unwrap()] = 0.4;
        positions[whole.joint_index("right_arm").unwrap()] = -0.7;
        for (a, b) in stands.iter().zip(pose_of(&whole, link, &positions)) {
            assert!((a - b).abs() < 1e-9, "{link}");
        }
    }
}

/// The pose of `link` at these positions of all joints.
fn pose_of(model: &Model, link: &str, positions: &[f64]) -> [f64; 12] {
    let mut data = Data::new(model);
    forward_kinematics(model, &mut data, positions);
    let pose = link_pose(model, &data, model.link_index(link).unwrap());
    let matrix = pose.to_matrix();
    std::array::from_fn(|at| matrix[(at % 3, at / 3)])
}

#[test]
fn fixed_joints_stand_where_they_stood_and_the_others_stay() {
    // Limits keep two joints from zero.
    let xml = robot()
        .replace("lower=\"-1\" upper=\"1.5\"", "lower=\"0.4\" upper=\"1.5\"")
        .replace("lower=\"0\" upper=\"0.6\"", "lower=\"-0.6\" upper=\"-0.2\"");
    let whole = Model::from_urdf(&xml).unwrap();
    let fixed = fix_joints(&xml, &["left_arm", "hoist", "weld", "nobody"]).unwrap();
    let fixed = Model::from_urdf(&fixed).unwrap();
    assert!(fixed.joint_names().eq(["right_arm"]));
    for link in ["column", "left", "hand", "right"] {
        let before = pose_of(&whole, link, &[0.4, -0.2, 1.1]);
        let after = pose_of(&fixed, link, &[1.1]);
        for (a, b) in before.iter().zip(after) {
            assert!((a - b).abs() < 1e-12, "{link}: {before:?} {after:?}");
        }
    }
}
