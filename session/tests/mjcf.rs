//! MuJoCo models as robots: efforts are those that MuJoCo computes (`tests/simulators/reference.py`).

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::PathBuf;

use tauscope_dynamics::{Data, Model, rnea};
use tauscope_session::robot;

fn models() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/simulators/models")
}

/// The robot of a text, as the file `model.xml`.
fn read(text: &str) -> Result<robot::Robot, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.xml");
    std::fs::write(&path, text).unwrap();
    robot::read(&path).map_err(|error| error.to_string())
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    let all = value.as_array().unwrap().iter();
    all.map(|x| x.as_f64().unwrap()).collect()
}

/// Largest difference between two efforts, as a share of the largest.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(1e-3_f64, |most, x| most.max(x.abs()));
    let pairs = a.iter().zip(b);
    pairs.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / largest
}

#[test]
fn efforts_are_those_of_mujoco() {
    let text = std::fs::read_to_string(models().join("reference.json")).unwrap();
    let reference: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (name, expected) in reference.as_object().unwrap() {
        let robot = robot::read(&models().join(format!("{name}.xml"))).unwrap();
        let model = &robot.model;
        let joints = expected["joints"].as_array().unwrap();
        assert_eq!(model.dof(), joints.len(), "{name}");
        // MuJoCo gives no name to a joint that has none.
        let order: Vec<usize> = joints
            .iter()
            .map(|joint| match joint.as_str().unwrap() {
                "" => model.joint_index("joint_4").unwrap(),
                joint => model.joint_index(joint).unwrap(),
            })
            .collect();
        let mut data = Data::new(model);
        for state in expected["states"].as_array().unwrap() {
            let by_joint = |key: &str| {
                let mut values = vec![0.0; model.dof()];
                for (at, value) in order.iter().zip(numbers(&state[key])) {
                    values[*at] = value;
                }
                values
            };
            let (q, qd, qdd) = (
                by_joint("position"),
                by_joint("velocity"),
                by_joint("acceleration"),
            );
            let found = rnea(model, &mut data, &q, &qd, &qdd).to_vec();
            let off = difference(&found, &by_joint("bodies"));
            assert!(
                off < 1e-5,
                "{name}: {off}\n{found:?}\n{:?}",
                by_joint("bodies")
            );
        }
    }
}

#[test]
fn a_free_body_is_left_out_and_a_floating_base_refused() {
    let hand = robot::read(&models().join("hand.xml")).unwrap();
    assert!(
        hand.findings.iter().any(|f| f.contains("block")),
        "{:?}",
        hand.findings
    );
    let floating = r#"<mujoco><worldbody><body name="trunk"><freejoint/>
        <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
        <body name="leg"><joint name="hip" axis="0 1 0"/><inertial pos="0 0 -0.1" mass="1" diaginertia="0.1 0.1 0.1"/></body>
        </body></worldbody></mujoco>"#;
    let error = read(floating).unwrap_err();
    assert!(error.contains("`trunk` floats freely"), "{error}");
}

#[test]
fn a_mass_that_is_not_in_the_file_is_asked_for_with_the_command_that_saves_it() {
    let mesh = r#"<mujoco><asset><mesh name="arm" file="arm.stl"/></asset><worldbody><body name="arm">
        <joint name="turn" axis="0 1 0"/><geom type="mesh" mesh="arm"/></body></worldbody></mujoco>"#;
    let error = read(mesh).unwrap_err();
    assert!(
        error.contains("mass of body `arm`") && error.contains("s.compiler.saveinertial = True"),
        "{error}"
    );
}

#[test]
fn what_is_no_model_is_refused_with_its_reason() {
    for (text, reason) in [
        ("<mujoco><worldbody><body name=\"a\"", "XML"),
        ("<mujoco><include file=\"none.xml\"/></mujoco>", "none.xml"),
        ("<mujoco/>", "no movable joint"),
        (
            "<mujoco><worldbody><body name=\"a\"><joint type=\"ball\" name=\"b\"/><geom size=\"1\"/></body></worldbody></mujoco>",
            "`b` is a ball joint",
        ),
    ] {
        let error = read(text).unwrap_err();
        assert!(
            error.to_lowercase().contains(&reason.to_lowercase()),
            "{text}: {error}"
        );
    }
}

/// Guards the rotation of a body that points straight along an axis: there roll and yaw are one.
#[test]
fn a_body_that_stands_upright_keeps_its_rotation() {
    let at = |quat: &str| {
        let text = format!(
            "<mujoco><worldbody><body name=\"a\" quat=\"{quat}\"><joint name=\"j\" axis=\"0 0 1\"/>\
             <inertial pos=\"0.1 0.2 0.3\" mass=\"1\" diaginertia=\"0.1 0.2 0.25\"/></body></worldbody></mujoco>"
        );
        read(&text).unwrap().model
    };
    let effort = |model: &Model| rnea(model, &mut Data::new(model), &[0.4], &[0.0], &[0.0])[0];
    let (near, upright) = (at("1 0 0.9999 0"), at("1 0 1 0"));
    assert!((effort(&near) - effort(&upright)).abs() < 1e-3);
    assert!(effort(&upright).abs() > 0.1);
}

#[test]
fn a_mesh_that_stands_still_needs_no_mass() {
    let text = r#"<mujoco><asset><mesh name="base" file="base.stl"/></asset><worldbody><body name="stand">
        <geom type="mesh" mesh="base"/><body name="arm"><joint name="turn" axis="0 1 0"/>
        <inertial pos="0.1 0 0" mass="1" diaginertia="0.1 0.1 0.1"/></body></body></worldbody></mujoco>"#;
    assert_eq!(read(text).unwrap().model.dof(), 1);
}

/// Guards against locked slides: other readers take a slide without limits for one that stands at zero, and refuse `inf`.
#[test]
fn a_urdf_for_other_readers_has_finite_limits_and_no_elements_of_mujoco() {
    let slide = r#"<mujoco><option gravity="0 0 9.81"/><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0"/><joint name="turn"/>
        <inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body></worldbody></mujoco>"#;
    let robot = read(slide).unwrap();
    let (urdf, model) = robot::plain_urdf(&robot.urdf).unwrap();
    assert!(!urdf.contains("mujoco") && !urdf.contains("inf"), "{urdf}");
    assert!(urdf.contains("lower=\"-1e9\" upper=\"1e9\""), "{urdf}");
    // The root is a world that stands, though gravity is turned in MuJoCo's.
    assert!(urdf.contains("<parent link=\"world\"/>"), "{urdf}");
    // The link between the two joints has a mass that changes nothing.
    assert!(urdf.contains("<mass value=\"1e-9\"/>"), "{urdf}");
    assert_eq!(model.dof(), 2);
}

#[test]
fn a_moving_body_without_mass_is_refused_but_one_whose_fixed_child_has_a_mass_is_not() {
    let arm = |inner: &str| {
        format!(
            r#"<mujoco><worldbody><body name="arm"><joint name="turn" axis="0 1 0"/>{inner}</body></worldbody></mujoco>"#
        )
    };
    let error = read(&arm("")).unwrap_err();
    assert!(error.contains("mass of body `arm`, which moves"), "{error}");
    let carried =
        r#"<body name="lump"><inertial mass="1" pos="0 0 0.1" diaginertia="1 1 1"/></body>"#;
    assert!(read(&arm(carried)).is_ok());
}
