//! Corrections in a URDF.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};
use tauscope_dynamics::Inertia;

use super::corrections::{Corrections, JointCorrections};
use super::edits::{Edits, child, digits, indent_of, named};
use super::{ModelError, Target};

/// Relative tolerance of the triangle inequality: a thin rod attains it with equality, and numbers are rounded.
const TOLERANCE: f64 = 1e-6;
/// Namespace of Drake's elements.
const DRAKE: &str = "http://drake.mit.edu";

/// Writes corrections into a URDF.
///
/// # Errors
/// If the file is not a URDF, lacks a joint or a link, or a link would not be a rigid body.
pub fn corrected(
    target: Target,
    urdf: &str,
    corrections: &Corrections,
) -> Result<String, ModelError> {
    let document = parse(urdf, target)?;
    let mut edits = Edits::of(urdf);
    for (link, body) in &corrections.bodies {
        refuse_no_body("link", link, body)?;
        let node = named(&document, "link", link).ok_or_else(|| ModelError::Missing {
            kind: "link",
            name: link.clone(),
        })?;
        if let Some(old) = child(node, "inertial") {
            let text = inertial(body, &indent_of(urdf, old.range().start));
            edits.replace(old.range(), text);
        } else {
            let inner = format!("{}  ", indent_of(urdf, node.range().start));
            edits.insert(node, &inertial(body, &inner));
        }
    }
    for (joint, own) in &corrections.joints {
        let node = named(&document, "joint", joint).ok_or_else(|| ModelError::Missing {
            kind: "joint",
            name: joint.clone(),
        })?;
        of_joint(target, node, own, &mut edits);
    }
    if target == Target::Drake {
        drives(&document, corrections, &mut edits);
    }
    Ok(edits.done())
}

/// Parses the file.
///
/// # Errors
/// If it is not XML or of another kind than the target.
pub fn parse(text: &str, target: Target) -> Result<Document<'_>, ModelError> {
    let document = Document::parse(text)?;
    let found = document.root_element().tag_name().name();
    match target.root().filter(|expected| *expected != found) {
        Some(expected) => Err(ModelError::OtherKind {
            found: found.to_owned(),
            target: target.name(),
            expected,
        }),
        None => Ok(document),
    }
}

fn of_joint(target: Target, node: Node<'_, '_>, own: &JointCorrections, edits: &mut Edits<'_>) {
    let friction = own.friction.filter(|_| target == Target::Urdf);
    if own.damping.is_some() || friction.is_some() {
        let values = [("damping", own.damping), ("friction", friction)];
        let values = values.map(|(name, x)| (name, x.map(digits)));
        if let Some(old) = child(node, "dynamics") {
            for (name, value) in values {
                if let Some(value) = value {
                    edits.set(old, name, &value);
                }
            }
        } else {
            let [damping, friction] = values.map(|(_, x)| x.unwrap_or_else(|| "0".to_owned()));
            let element = format!("<dynamics damping=\"{damping}\" friction=\"{friction}\"/>");
            edits.insert(node, &element);
        }
    }
    if let Some(zero) = own.zero {
        turn_zero(node, zero, edits);
    }
}

/// Moves the zero of a joint: its origin, followed by the motion by `zero` along or about its axis.
fn turn_zero(node: Node<'_, '_>, zero: f64, edits: &mut Edits<'_>) {
    let three = |element: Option<Node<'_, '_>>, name: &str, default: [f64; 3]| {
        let text = element.and_then(|element| element.attribute(name));
        let numbers = text.map(|text| text.split_whitespace().map(|x| x.parse().unwrap_or(0.0)));
        let numbers = numbers.map(Iterator::collect::<Vec<f64>>);
        numbers
            .and_then(|all| all.try_into().ok())
            .unwrap_or(default)
    };
    let origin = child(node, "origin");
    let xyz = three(origin, "xyz", [0.0; 3]);
    let [roll, pitch, yaw] = three(origin, "rpy", [0.0; 3]);
    let axis = Vector3::from(three(child(node, "axis"), "xyz", [1.0, 0.0, 0.0]));
    let along = axis.try_normalize(0.0).unwrap_or(Vector3::x()) * zero;
    let at = Isometry3::from_parts(
        Translation3::new(xyz[0], xyz[1], xyz[2]),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    );
    let moved = if node.attribute("type") == Some("prismatic") {
        at * Translation3::from(along)
    } else {
        at * UnitQuaternion::from_scaled_axis(along)
    };
    let p = moved.translation;
    let (roll, pitch, yaw) = moved.rotation.euler_angles();
    let xyz = [p.x, p.y, p.z].map(digits).join(" ");
    let rpy = [roll, pitch, yaw].map(digits).join(" ");
    match origin {
        Some(origin) => {
            edits.set(origin, "xyz", &xyz);
            edits.set(origin, "rpy", &rpy);
        }
        None => edits.insert(node, &format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")),
    }
}

/// Writes rotor inertias where Drake reads them: in the actuator of the joint's transmission.
fn drives(document: &Document<'_>, corrections: &Corrections, edits: &mut Edits<'_>) {
    let root = document.root_element();
    let has_prefix = root.namespaces().any(|own| own.uri() == DRAKE);
    let mut is_declared = has_prefix;
    for (joint, own) in &corrections.joints {
        let Some(armature) = own.armature else {
            continue;
        };
        if !is_declared {
            edits.set(root, "xmlns:drake", DRAKE);
            is_declared = true;
        }
        let drives = root
            .children()
            .filter(|node| node.has_tag_name("transmission"));
        let mut own = drives.filter(|node| {
            child(*node, "joint").and_then(|node| node.attribute("name")) == Some(joint)
        });
        let value = digits(armature);
        let inertia = format!("<drake:rotor_inertia value=\"{value}\"/>");
        let ratio = "<drake:gear_ratio value=\"1\"/>";
        if let Some(actuator) = own.next().and_then(|node| child(node, "actuator")) {
            let old = |prefixed: &str| {
                let name = prefixed.trim_start_matches("drake:");
                actuator
                    .children()
                    .find(|node| node.has_tag_name((DRAKE, name)))
            };
            let elements = [
                ("drake:rotor_inertia", inertia.as_str()),
                ("drake:gear_ratio", ratio),
            ];
            for (name, new) in elements {
                let old = old(name);
                match old {
                    Some(old) => edits.replace(old.range(), new.to_owned()),
                    None => edits.insert(actuator, new),
                }
            }
        } else {
            edits.insert(
                root,
                &format!(
                    "<transmission name=\"{joint}_drive\" type=\"SimpleTransmission\"><joint name=\"{joint}\"/>\
                     <actuator name=\"{joint}_motor\">{inertia}{ratio}</actuator></transmission>"
                ),
            );
        }
    }
}

/// Rejects inertial parameters that no rigid body has.
///
/// # Errors
/// If the mass is not positive, or a second moment is negative.
pub fn refuse_no_body(kind: &'static str, name: &str, inertia: &Inertia) -> Result<(), ModelError> {
    let [xx, xy, xz, yy, yz, zz] = inertia.inertia_about_com_kgm2();
    // The second moments: trace/2 on the diagonal less the inertia. Positive semidefinite if all
    // principal minors are.
    let half = 0.5 * (xx + yy + zz);
    let (a, b, c) = (half - xx, half - yy, half - zz);
    let (d, e, f) = (-xy, -xz, -yz);
    let scale = half.abs().max(f64::MIN_POSITIVE);
    let lower = |order: i32| -TOLERANCE * scale.powi(order);
    let determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e);
    let is_body = inertia.mass_kg() > 0.0
        && [a, b, c].iter().all(|moment| *moment >= lower(1))
        && [a * b - d * d, a * c - e * e, b * c - f * f]
            .iter()
            .all(|minor| *minor >= lower(2))
        && determinant >= lower(3);
    if is_body {
        return Ok(());
    }
    Err(ModelError::NoBody {
        kind,
        name: name.to_owned(),
    })
}

/// An `<inertial>` element along the link's axes.
fn inertial(body: &Inertia, indent: &str) -> String {
    let mass = digits(body.mass_kg());
    let [x, y, z] = body.com_m().map(digits);
    let [xx, xy, xz, yy, yz, zz] = body.inertia_about_com_kgm2().map(digits);
    format!(
        "<inertial>\n\
         {indent}  <origin xyz=\"{x} {y} {z}\" rpy=\"0 0 0\"/>\n\
         {indent}  <mass value=\"{mass}\"/>\n\
         {indent}  <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n\
         {indent}</inertial>"
    )
}
