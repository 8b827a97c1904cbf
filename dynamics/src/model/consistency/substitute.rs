//! Numbers instead of impossible ones, and their place in the text of the URDF.

use std::collections::BTreeMap;
use std::ops::Range;

use roxmltree::Node;

use super::super::ModelError;
use super::super::document::{elements, parse};
use super::bodies::{Body, NUMBERS, child};
use super::finding::{BodyFinding, Substitute};
use super::moments::Cylinder;

/// Digits of a cylinder's inertia, relative to its largest moment.
/// Chosen: far more than the cylinder is accurate to, few enough to read.
const CYLINDER_DIGITS: i32 = 4;

/// A uniform cylinder of the body's mass along the link.
pub fn cylinder(body: &Body) -> Substitute {
    let far = body.is_centre_far();
    let along = if far {
        body.along_m * 0.0
    } else {
        body.along_m
    };
    let cylinder = Cylinder::of(body.mass_kg, along.norm());
    let axis = along
        .try_normalize(0.0)
        .unwrap_or_else(nalgebra::Vector3::z);
    let moments = cylinder.moments();
    let unit = 10_f64.powi(moments[0].log10().floor() as i32 - CYLINDER_DIGITS);
    let rounded = |x: f64| significant((x / unit).round() * unit);
    Substitute {
        link: body.place.link.clone(),
        mass_kg: None,
        com_m: None,
        inertia_kgm2: Some(cylinder.inertia(&axis).map(rounded)),
        cylinder_kgm2: Some(moments),
    }
}

/// The body's mass and inertia as they are in `body`, which has them in SI units.
pub fn converted(body: &Body, mass: bool, inertia: bool) -> Substitute {
    Substitute {
        link: body.place.link.clone(),
        mass_kg: mass.then(|| significant(body.mass_kg)),
        com_m: None,
        inertia_kgm2: inertia.then(|| body.numbers.map(significant)),
        cylinder_kgm2: None,
    }
}

/// The body's centre of mass, read as mm.
pub fn centre_in_m(body: &Body) -> Substitute {
    Substitute {
        link: body.place.link.clone(),
        mass_kg: None,
        com_m: Some((body.com_m * 1e-3).map(significant).into()),
        inertia_kgm2: None,
        cylinder_kgm2: None,
    }
}

/// `x` without the rounding error of its last digits.
pub fn significant(x: f64) -> f64 {
    // Adding 0 makes 0 of -0.
    format!("{x:.11e}").parse().unwrap_or(x) + 0.0
}

/// The URDF `xml` with the substitutes of `findings` in place of impossible masses, centres of mass and inertias. All other
/// text stays as it is.
///
/// # Errors
/// If the text is not XML, or larger than any robot.
pub fn with_plausible_bodies(xml: &str, findings: &[BodyFinding]) -> Result<String, ModelError> {
    let document = parse(xml)?;
    let mut edits: BTreeMap<usize, (Range<usize>, String)> = BTreeMap::new();
    let mut edit = |node: Option<Node>, attribute: &str, text: String| {
        if let Some(place) = node.and_then(|node| node.attribute_node(attribute)) {
            let place = place.range_value();
            edits.insert(place.start, (place, text));
        }
    };
    let links = || elements(document.root_element()).filter(|node| node.has_tag_name("link"));
    for substitute in findings.iter().flat_map(|finding| &finding.substitutes) {
        let named = |node: &Node| node.attribute("name") == Some(&substitute.link);
        let Some(inertial) = links().find(named).and_then(|link| child(link, "inertial")) else {
            continue;
        };
        if let Some(mass_kg) = substitute.mass_kg {
            edit(child(inertial, "mass"), "value", mass_kg.to_string());
        }
        if let Some([x, y, z]) = substitute.com_m {
            edit(child(inertial, "origin"), "xyz", format!("{x} {y} {z}"));
        }
        for (attribute, value) in NUMBERS.iter().zip(substitute.inertia_kgm2.iter().flatten()) {
            edit(child(inertial, "inertia"), attribute, value.to_string());
        }
    }
    let mut text = xml.to_owned();
    for (place, new) in edits.into_values().rev() {
        text.replace_range(place, &new);
    }
    Ok(text)
}
