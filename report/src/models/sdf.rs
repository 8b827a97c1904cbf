//! Corrections in an SDF model.

use roxmltree::{Document, Node};

use super::corrections::{Corrections, JointCorrections};
use super::edits::{Edits, child, digits, indent_of};
use super::urdf::{parse, refuse_no_body};
use super::{ModelError, Target};

/// Writes corrections into an SDF, whose links and joints have the names and frames of the URDF.
///
/// # Errors
/// If the file is not an SDF, lacks a joint or a link, or a link would not be a rigid body.
pub fn corrected(sdf: &str, corrections: &Corrections) -> Result<String, ModelError> {
    let document = parse(sdf, Target::Sdf)?;
    let mut edits = Edits::of(sdf);
    for (link, body) in &corrections.bodies {
        refuse_no_body("link", link, body)?;
        let node = part(&document, "link", link)?;
        let inner = format!("{}  ", indent_of(sdf, node.range().start));
        let [x, y, z] = body.com_m().map(digits);
        let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
        let inertia = names.iter().zip(body.inertia_about_com_kgm2());
        let inertia = inertia.map(|(name, x)| format!("<{name}>{}</{name}>", digits(x)));
        let text = format!(
            "<inertial>\n{inner}  <pose>{x} {y} {z} 0 0 0</pose>\n{inner}  <mass>{}</mass>\n{inner}  <inertia>{}</inertia>\n{inner}</inertial>",
            digits(body.mass_kg()),
            inertia.collect::<String>()
        );
        match child(node, "inertial") {
            Some(old) => edits.replace(old.range(), text),
            None => edits.insert(node, &text),
        }
    }
    for (joint, own) in &corrections.joints {
        let node = part(&document, "joint", joint)?;
        let axis = child(node, "axis").ok_or_else(|| ModelError::Missing {
            kind: "axis of joint",
            name: joint.clone(),
        })?;
        of_axis(axis, own, &mut edits);
    }
    Ok(edits.done())
}

/// The link or joint of that name, in any model of the file.
fn part<'a, 'i>(
    document: &'a Document<'i>,
    kind: &'static str,
    name: &str,
) -> Result<Node<'a, 'i>, ModelError> {
    let mut all = document.descendants();
    let found = all.find(|node| node.has_tag_name(kind) && node.attribute("name") == Some(name));
    found.ok_or_else(|| ModelError::Missing {
        kind,
        name: name.to_owned(),
    })
}

fn of_axis(axis: Node<'_, '_>, own: &JointCorrections, edits: &mut Edits<'_>) {
    let values = [
        ("damping", own.damping),
        ("friction", own.friction),
        ("spring_stiffness", own.spring.map(|[k, _]| k)),
        ("spring_reference", own.spring.map(|[_, rest]| rest)),
    ];
    let values = values.into_iter().filter_map(|(name, x)| Some((name, x?)));
    let elements: Vec<(&str, String)> = values
        .map(|(name, x)| (name, format!("<{name}>{}</{name}>", digits(x))))
        .collect();
    match child(axis, "dynamics") {
        Some(dynamics) => {
            for (name, element) in elements {
                match child(dynamics, name) {
                    Some(old) => edits.replace(old.range(), element),
                    None => edits.insert(dynamics, &element),
                }
            }
        }
        None if !elements.is_empty() => {
            let all: String = elements.into_iter().map(|(_, element)| element).collect();
            edits.insert(axis, &format!("<dynamics>{all}</dynamics>"));
        }
        None => {}
    }
}
