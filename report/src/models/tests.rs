//! Models of all kinds, corrected: what is written, and that the rest of a file stays as it was.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::TermSpec;
use tauscope_explain::report::Finding;

use super::*;

const ROBOT: &str = r#"<?xml version="1.0"?>
<!-- kept -->
<robot name="two">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0.1 0 0" rpy="0 0 0.5"/>
      <mass value="2"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/>
    </inertial>
  </link>
  <link name="tool"/>
  <joint name="turn" type="continuous">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="mount" type="fixed">
    <parent link="arm"/><child link="tool"/><origin xyz="0.3 0 0"/>
  </joint>
</robot>
"#;

const MJCF: &str = r#"<mujoco model="two">
  <!-- kept -->
  <default><default class="gear"><joint damping="0.5"/></default></default>
  <worldbody>
    <body name="arm">
      <inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.03"/>
      <joint class="gear" name="turn" axis="0 1 0" range="-90 90"/>
      <body name="tool" pos="0.3 0 0"/>
    </body>
  </worldbody>
</mujoco>
"#;

const SDF: &str = r#"<sdf version="1.9">
  <model name="two">
    <link name="arm"><inertial><mass>2</mass></inertial></link>
    <joint name="turn" type="revolute"><axis><xyz>0 1 0</xyz><dynamics><damping>0.5</damping></dynamics></axis></joint>
  </model>
</sdf>
"#;

fn corrections(json: &str) -> Corrections {
    let terms: Vec<TermSpec> = serde_json::from_str(json).unwrap();
    // A body counts where a finding names it.
    let finding = |spec: &TermSpec| {
        let at_link = spec.joint.is_none();
        let link = spec.link.clone().or(at_link.then(|| "tool".to_owned()));
        let parameters = serde_json::to_value(&spec.parameters).unwrap();
        Finding {
            joint: spec.joint.clone(),
            link,
            parameters: serde_json::from_value(parameters).unwrap(),
            ..crate::tests::finding(&spec.effect, "")
        }
    };
    let findings: Vec<Finding> = terms.iter().map(finding).collect();
    Corrections::of(&Model::from_urdf(ROBOT).unwrap(), &terms, &findings)
}

const OF_JOINT: &str = r#"[
    {"effect": "viscous_friction", "joint": "turn", "parameters": {"viscous_nms_per_rad": 1.25}},
    {"effect": "stribeck_friction", "joint": "turn",
     "parameters": {"coulomb_nm": 0.75, "static_nm": 1.0, "stribeck_velocity_rad_s": 0.05}},
    {"effect": "rotor_inertia", "joint": "turn", "parameters": {"inertia_kgm2": 0.125}},
    {"effect": "cable_spring", "joint": "turn", "parameters": {"stiffness_nm_per_rad": 3.0, "rest_angle_rad": 1.5707963267948966}},
    {"effect": "torque_gain", "joint": "turn", "parameters": {"gain": 0.9}}]"#;

const OF_BODIES: &str = r#"[
    {"effect": "payload", "parameters": {"mass_kg": 1.0, "com_x_m": 0.0, "com_y_m": 0.0, "com_z_m": 0.1,
     "ixx_kgm2": 0.002, "iyy_kgm2": 0.002, "izz_kgm2": 0.002}},
    {"effect": "link_mass", "link": "arm", "parameters": {"delta_mass_kg": -0.5}}]"#;

/// The lines of a text that the other lacks.
fn new_lines<'a>(before: &str, after: &'a str) -> Vec<&'a str> {
    let after = after
        .split("-->\n")
        .skip(usize::from(after.contains("Corrected by")))
        .collect::<Vec<_>>();
    let lines = after.into_iter().flat_map(str::lines);
    lines
        .filter(|line| !before.contains(line.trim()))
        .map(str::trim)
        .collect()
}

#[test]
fn a_mujoco_model_gets_attributes_at_their_places() {
    let written = write(Target::Mjcf, MJCF, ROBOT, &corrections(OF_JOINT)).unwrap();
    let lines = new_lines(MJCF, &written.text);
    assert_eq!(
        lines,
        [
            "<joint damping=\"1.25\" frictionloss=\"0.75\" armature=\"0.125\" stiffness=\"3\" springref=\"90\" class=\"gear\" \
             name=\"turn\" axis=\"0 1 0\" range=\"-90 90\"/>"
        ]
    );
    assert_eq!(written.written.len(), 4, "{:?}", written.written);
    assert!(
        written
            .lost
            .iter()
            .any(|line| line.starts_with("torque_gain at turn"))
    );
    assert!(
        written
            .lost
            .iter()
            .any(|line| line.contains("friction at rest"))
    );
}

#[test]
fn bodies_are_what_the_terms_say_in_every_format() {
    let all = corrections(OF_BODIES);
    let urdf = write(Target::Urdf, ROBOT, ROBOT, &all).unwrap();
    assert!(
        urdf.text
            .contains("<!-- kept -->\n<robot name=\"two\">\n  <link name=\"base\"/>")
    );
    let new = Model::from_urdf(&urdf.text).unwrap();
    // The effort is that of the terms.
    let mut altered = Model::from_urdf(ROBOT).unwrap();
    let terms: Vec<TermSpec> = serde_json::from_str(OF_BODIES).unwrap();
    for term in &terms {
        assert!(term.build(&altered.clone()).unwrap().alter(&mut altered));
    }
    let (expected, found) = (altered.body_parameters(0), new.body_parameters(0));
    for (expected, found) in expected.iter().zip(found) {
        assert!((expected - found).abs() < 1e-8, "{expected} {found}");
    }
    let mjcf = write(Target::Mjcf, MJCF, ROBOT, &all).unwrap();
    assert!(
        mjcf.text.contains("pos=\"0.1 0 0\" mass=\"1.5\""),
        "{}",
        mjcf.text
    );
    assert!(
        mjcf.text.contains("<body name=\"tool\" pos=\"0.3 0 0\">"),
        "{}",
        mjcf.text
    );
    assert!(
        mjcf.text.contains("<inertial pos=\"0 0 0.1\" mass=\"1\""),
        "{}",
        mjcf.text
    );
    let sdf = write(Target::Sdf, SDF, ROBOT, &corrections(OF_JOINT)).unwrap();
    assert!(sdf.text.contains("<damping>1.25</damping>"), "{}", sdf.text);
    assert!(
        sdf.text
            .contains("<spring_reference>1.57079632679</spring_reference>"),
        "{}",
        sdf.text
    );
}

#[test]
fn drake_reads_the_rotor_and_isaac_lab_the_friction_at_rest() {
    let all = corrections(OF_JOINT);
    let drake = write(Target::Drake, ROBOT, ROBOT, &all).unwrap();
    let model = Model::from_urdf(&drake.text).unwrap();
    assert!((model.joints()[0].drive.rotor_inertia - 0.125).abs() < 1e-12);
    let isaac = write(Target::IsaacLab, "", ROBOT, &all).unwrap();
    for line in [
        "armature=0.125,",
        "friction=1,",
        "dynamic_friction=0.75,",
        "viscous_friction=1.25,",
    ] {
        assert!(isaac.text.contains(line), "{}", isaac.text);
    }
}

#[test]
fn a_zero_is_moved_as_the_joint_turns() {
    let all = corrections(
        r#"[{"effect": "joint_zero_offset", "joint": "turn", "parameters": {"offset_rad": 0.2}}]"#,
    );
    let new = Model::from_urdf(&write(Target::Urdf, ROBOT, ROBOT, &all).unwrap().text).unwrap();
    let mut shifted = Model::from_urdf(ROBOT).unwrap();
    shifted.shift_zero(0, 0.2);
    let effort = |model: &Model| {
        tauscope_dynamics::rnea(
            model,
            &mut tauscope_dynamics::Data::new(model),
            &[0.5],
            &[0.0],
            &[0.0],
        )[0]
    };
    assert!((effort(&new) - effort(&shifted)).abs() < 1e-6);
    let mjcf = write(Target::Mjcf, MJCF, ROBOT, &all).unwrap();
    assert!(
        mjcf.text.contains("<joint ref=\"-11.4591559026"),
        "{}",
        mjcf.text
    );
}

#[test]
fn a_file_of_another_kind_and_a_body_that_is_none_are_refused() {
    let error = write(Target::Mjcf, ROBOT, ROBOT, &corrections(OF_JOINT)).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("is a <robot>, and mjcf needs a <mujoco>"),
        "{error}"
    );
    let nothing =
        r#"[{"effect": "link_mass", "link": "arm", "parameters": {"delta_mass_kg": -3.0}}]"#;
    let error = write(Target::Urdf, ROBOT, ROBOT, &corrections(nothing)).unwrap_err();
    assert!(matches!(error, ModelError::NoBody { name, .. } if name == "arm"));
    let error = write(Target::Sdf, "<sdf/>", ROBOT, &corrections(OF_JOINT)).unwrap_err();
    assert!(error.to_string().contains("no joint `turn`"), "{error}");
}

/// Guards against silence: MuJoCo fuses links without joints, so that a model may lack the link that a finding names.
#[test]
fn a_body_that_the_model_lacks_is_listed() {
    let all = corrections(
        r#"[{"effect": "link_mass", "link": "flange", "parameters": {"delta_mass_kg": 0.5}}]"#,
    );
    assert!(all.bodies.is_empty());
    assert!(all.lost[0].contains("flange"), "{:?}", all.lost);
}
