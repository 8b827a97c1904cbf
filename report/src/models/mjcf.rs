//! Corrections in a MuJoCo model.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use roxmltree::{Document, Node};
use tauscope_dynamics::{Inertia, MUJOCO, Model};

use super::corrections::{Corrections, JointCorrections};
use super::edits::{Edits, child, digits};
use super::urdf::{parse, refuse_no_body};
use super::{ModelError, Target};

/// Attributes of `<inertial>` that give the moments of inertia and their axes.
const OF_INERTIA: [&str; 7] = [
    "diaginertia",
    "fullinertia",
    "quat",
    "axisangle",
    "xyaxes",
    "zaxis",
    "euler",
];

/// Writes corrections into an MJCF. `urdf` is the robot as the twin reads it, with the poses of the body frames in
/// the link frames.
///
/// # Errors
/// If the file is not an MJCF, lacks a joint or a body, or a body would not be rigid.
pub fn corrected(mjcf: &str, urdf: &str, corrections: &Corrections) -> Result<String, ModelError> {
    let document = parse(mjcf, Target::Mjcf)?;
    let robot = Document::parse(urdf)?;
    let stated = Model::from_urdf(urdf).ok();
    let (bodies, joints) = named_parts(&document);
    let mut edits = Edits::of(mjcf);
    for (name, body) in &corrections.bodies {
        refuse_no_body("body", name, body)?;
        let node = *bodies.get(name).ok_or_else(|| ModelError::Missing {
            kind: "body",
            name: name.clone(),
        })?;
        of_body(node, body, &frame(&robot, name), &mut edits);
    }
    let is_degree = angles_in_degrees(&document);
    for (name, own) in &corrections.joints {
        let node = *joints.get(name).ok_or_else(|| ModelError::Missing {
            kind: "joint",
            name: name.clone(),
        })?;
        let model = stated.as_ref();
        let joint = model.and_then(|model| Some(&model.joints()[model.joint_index(name)?]));
        let slides = joint.is_some_and(tauscope_dynamics::Joint::slides);
        let unit = if is_degree && !slides {
            1_f64.to_degrees()
        } else {
            1.0
        };
        of_joint(node, own, unit, &mut edits);
    }
    if let Some([x, y, z]) = corrections.gravity {
        let value = [x, y, z].map(digits).join(" ");
        let root = document.root_element();
        match child(root, "option") {
            Some(option) => edits.set(option, "gravity", &value),
            None => edits.insert(root, &format!("<option gravity=\"{value}\"/>")),
        }
    }
    Ok(edits.done())
}

/// Bodies and joints by name; unnamed ones have the numbered names that the model reader gives them.
fn named_parts<'a, 'i>(
    document: &'a Document<'i>,
) -> (
    BTreeMap<String, Node<'a, 'i>>,
    BTreeMap<String, Node<'a, 'i>>,
) {
    let (mut bodies, mut joints) = (BTreeMap::new(), BTreeMap::new());
    let (mut body_count, mut joint_count) = (0, 0);
    let root = document.root_element();
    let worlds = root
        .children()
        .filter(|node| node.has_tag_name("worldbody"));
    for node in worlds.flat_map(|world| world.descendants()) {
        if !node.has_tag_name("body") {
            continue;
        }
        body_count += 1;
        let own = node.attribute("name").map(str::to_owned);
        bodies.insert(own.unwrap_or_else(|| format!("body_{body_count}")), node);
        for joint in node.children() {
            if !joint.has_tag_name("joint") && !joint.has_tag_name("freejoint") {
                continue;
            }
            let own = joint.attribute("name").map(str::to_owned);
            joints.insert(own.unwrap_or_else(|| format!("joint_{joint_count}")), joint);
            joint_count += 1;
        }
    }
    (bodies, joints)
}

/// Whether angles of the file are in degrees, which is the default.
fn angles_in_degrees(document: &Document<'_>) -> bool {
    let all = document.root_element().children();
    let compilers = all.filter(|node| node.has_tag_name("compiler"));
    let angle = compilers
        .filter_map(|node| node.attribute("angle"))
        .next_back();
    angle != Some("radian")
}

/// Pose of a body's frame in its link.
fn frame(robot: &Document<'_>, link: &str) -> Isometry3<f64> {
    let node = super::edits::named(robot, "link", link);
    let own = node.and_then(|node| {
        let mut all = node.children();
        all.find(|child| child.has_tag_name((MUJOCO, "body")))
    });
    let numbers = own.and_then(|own| own.attribute("pos")).unwrap_or_default();
    let numbers: Vec<f64> = numbers
        .split_whitespace()
        .filter_map(|x| x.parse().ok())
        .collect();
    match numbers[..] {
        [x, y, z] => Isometry3::translation(x, y, z),
        _ => Isometry3::identity(),
    }
}

fn of_body(node: Node<'_, '_>, body: &Inertia, frame: &Isometry3<f64>, edits: &mut Edits<'_>) {
    let own = body.transformed(&frame.inverse());
    let mass = digits(own.mass_kg());
    let com = own.com_m().map(digits).join(" ");
    let [xx, xy, xz, yy, yz, zz] = own.inertia_about_com_kgm2();
    let full = [xx, yy, zz, xy, xz, yz].map(digits).join(" ");
    let Some(inertial) = child(node, "inertial") else {
        let element = format!("<inertial pos=\"{com}\" mass=\"{mass}\" fullinertia=\"{full}\"/>");
        edits.insert(node, &element);
        return;
    };
    for name in OF_INERTIA.into_iter().filter(|name| *name != "fullinertia") {
        edits.remove(inertial, name);
    }
    edits.set(inertial, "pos", &com);
    edits.set(inertial, "mass", &mass);
    edits.set(inertial, "fullinertia", &full);
}

/// `unit` is the file's angle unit per radian.
fn of_joint(node: Node<'_, '_>, own: &JointCorrections, unit: f64, edits: &mut Edits<'_>) {
    let values = [
        ("damping", own.damping),
        ("frictionloss", own.friction),
        ("armature", own.armature),
        ("stiffness", own.spring.map(|[k, _]| k)),
        ("springref", own.spring.map(|[_, rest]| unit * rest)),
    ];
    for (name, value) in values {
        if let Some(value) = value {
            edits.set(node, name, &digits(value));
        }
    }
    if let Some(zero) = own.zero {
        let reference = node
            .attribute("ref")
            .and_then(|text| text.trim().parse::<f64>().ok());
        // The joint turns by its position minus the reference.
        let value = reference.unwrap_or(0.0) - unit * zero;
        edits.set(node, "ref", &digits(value));
    }
}
