//! Elements of fixed joints that have no meaning.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use tauscope_dynamics::Model;

/// A joint and a fixed joint behind it that has `rest` in addition.
fn robot(rest: &str) -> String {
    format!(
        "<robot name='r'><link name='base'/>\n<link name='arm'><inertial><mass value='2'/>\
         <inertia ixx='0.1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial></link>\n\
         <joint name='weld' type='fixed'><parent link='arm'/><child link='hand'/><origin xyz='0.5 0 0'/>{rest}</joint>\n\
         <joint name='hinge' type='continuous'><parent link='base'/><child link='arm'/><axis xyz='0 0 1'/></joint>\n\
         <link name='hand'/>\n</robot>"
    )
}

#[test]
fn a_fixed_joint_may_have_any_axis_and_limits() {
    let plain = Model::from_urdf(&robot("")).unwrap();
    for rest in [
        "<axis xyz='0 0 0'/>",
        "<axis xyz='0 0'/>",
        "<axis xyz=''/>",
        "<axis/>",
        "<axis xyz='a b c'/><limit lower='-' upper='none' effort='' velocity='NaN'/>",
        "<limit/>\n<mimic joint='nothing' multiplier='x'/>",
        "<dynamics damping='?'/><calibration rising='?'/><safety_controller k_velocity='?'/>",
    ] {
        let model = Model::from_urdf(&robot(rest));
        let model = model.unwrap_or_else(|error| panic!("{rest}: {error}"));
        assert_eq!(model.links(), plain.links(), "{rest}");
        assert_eq!(model.joints(), plain.joints(), "{rest}");
    }
}

#[test]
fn errors_behind_such_an_element_keep_their_line() {
    let xml = robot("<limit\nlower='-'/>").replace("<link name='hand'/>", "<link/>");
    let error = Model::from_urdf(&xml).unwrap_err().to_string();
    assert!(error.starts_with("line 6: link ``"), "{error}");
    // A movable joint's axis is checked.
    let xml = robot("<axis xyz='0 0'/>").replace("'0 0 1'", "'0 0 one'");
    let error = Model::from_urdf(&xml).unwrap_err().to_string();
    assert!(
        error.starts_with("line 4: <axis> of joint `hinge`"),
        "{error}"
    );
}
