//! `robot.urdf`: the corrected twin as a robot, where a robot description can hold it.

use std::collections::BTreeMap;
use std::ops::Range;

use tauscope_dynamics::terms::TermSpec;
use tauscope_dynamics::{Inertia, Model};

/// A triangle inequality may be missed by this share: a thin rod stands on its edge, and numbers are rounded.
const TOLERANCE: f64 = 1e-6;

/// Why a corrected robot cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum RobotError {
    /// The URDF no longer parses, which had been excluded.
    #[error("the URDF cannot be edited: {0}")]
    Xml(#[from] roxmltree::Error),
    /// The URDF has no such link, which had been excluded.
    #[error("the URDF has no link `{0}`")]
    NoLink(String),
    /// A link would have no mass, or an inertia that no body has.
    #[error(
        "link `{0}` would get a mass or an inertia that no rigid body has: this data tells some of its numbers too badly"
    )]
    NoBody(String),
}

/// The URDF with `terms` in it: text for text the old one, but for the `<inertial>` of the links concerned.
/// `None` if one of them is not a body that stays, or there is none.
///
/// # Errors
/// If a link would not be a rigid body.
pub fn corrected(
    urdf: &str,
    model: &Model,
    terms: &[TermSpec],
) -> Result<Option<String>, RobotError> {
    let mut changes: BTreeMap<usize, Inertia> = BTreeMap::new();
    for spec in terms {
        let Ok(term) = spec.build(model) else {
            return Ok(None);
        };
        let Some((link, inertia)) = term.inertia() else {
            return Ok(None);
        };
        *changes.entry(link).or_insert_with(Inertia::zero) += inertia;
    }
    if changes.is_empty() {
        return Ok(None);
    }
    let document = roxmltree::Document::parse(urdf)?;
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    for (link, change) in changes {
        let link = &model.links()[link];
        let body = link.inertia + change;
        if !is_body(&body) {
            return Err(RobotError::NoBody(link.name.clone()));
        }
        edits.push(edit(&document, urdf, &link.name, &body)?);
    }
    edits.sort_by_key(|(range, _)| range.start);
    let mut text = urdf.to_owned();
    for (range, new) in edits.into_iter().rev() {
        text.replace_range(range, &new);
    }
    Ok(Some(text))
}

/// Whether a rigid body can have these ten parameters: a mass, and second moments that are not negative.
fn is_body(inertia: &Inertia) -> bool {
    let [xx, xy, xz, yy, yz, zz] = inertia.inertia_about_com_kgm2();
    // The second moments: trace/2 on the diagonal less the inertia. Positive semidefinite if all
    // principal minors are.
    let half = 0.5 * (xx + yy + zz);
    let (a, b, c) = (half - xx, half - yy, half - zz);
    let (d, e, f) = (-xy, -xz, -yz);
    let scale = half.abs().max(f64::MIN_POSITIVE);
    let lower = |order: i32| -TOLERANCE * scale.powi(order);
    let determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e);
    inertia.mass_kg() > 0.0
        && [a, b, c].iter().all(|moment| *moment >= lower(1))
        && [a * b - d * d, a * c - e * e, b * c - f * f]
            .iter()
            .all(|minor| *minor >= lower(2))
        && determinant >= lower(3)
}

/// What to put where, so that the link has this inertia.
fn edit(
    document: &roxmltree::Document<'_>,
    urdf: &str,
    link: &str,
    body: &Inertia,
) -> Result<(Range<usize>, String), RobotError> {
    let is_link = |node: &roxmltree::Node<'_, '_>| {
        node.has_tag_name("link") && node.attribute("name") == Some(link)
    };
    let node = document
        .root_element()
        .children()
        .find(is_link)
        .ok_or_else(|| RobotError::NoLink(link.to_owned()))?;
    if let Some(old) = node.children().find(|child| child.has_tag_name("inertial")) {
        let text = inertial(body, &indent_of(urdf, old.range().start));
        return Ok((old.range(), text));
    }
    let start = node.range().start;
    let outer = indent_of(urdf, start);
    let inner = format!("{outer}  ");
    let text = inertial(body, &inner);
    let whole = &urdf[node.range()];
    if let Some(first) = node.first_child() {
        let at = first.range().start;
        return Ok((at..at, format!("\n{inner}{text}")));
    }
    // `<link name="tool"/>` or `<link name="tool"></link>`.
    if let Some(head) = whole.strip_suffix("/>") {
        let head = head.trim_end();
        let text = format!("{head}>\n{inner}{text}\n{outer}</link>");
        return Ok((node.range(), text));
    }
    let close = whole.rfind("</").unwrap_or(whole.len());
    let at = start + close;
    Ok((at..at, format!("\n{inner}{text}\n{outer}")))
}

/// The blanks between the start of a line and what stands in it.
fn indent_of(text: &str, at: usize) -> String {
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let before = &text[line..at];
    let blanks = before.len() - before.trim_start().len();
    before[..blanks].to_owned()
}

/// An `<inertial>` element along the link's axes. Rust writes as many digits as a number needs.
fn inertial(body: &Inertia, indent: &str) -> String {
    let mass = body.mass_kg();
    let [x, y, z] = body.com_m();
    let [xx, xy, xz, yy, yz, zz] = body.inertia_about_com_kgm2();
    format!(
        "<inertial>\n\
         {indent}  <origin xyz=\"{x} {y} {z}\" rpy=\"0 0 0\"/>\n\
         {indent}  <mass value=\"{mass}\"/>\n\
         {indent}  <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n\
         {indent}</inertial>"
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
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

    fn terms(json: &str) -> Vec<TermSpec> {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn a_payload_and_a_heavier_link_are_in_the_robot_and_the_rest_is_as_it_was() {
        let model = Model::from_urdf(ROBOT).unwrap();
        let terms = terms(
            r#"[{"effect": "payload", "parameters": {"mass_kg": 1.0, "com_x_m": 0.0, "com_y_m": 0.0, "com_z_m": 0.1,
                 "ixx_kgm2": 0.002, "iyy_kgm2": 0.002, "izz_kgm2": 0.002}},
                {"effect": "link_mass", "link": "arm", "parameters": {"delta_mass_kg": -0.5}}]"#,
        );
        let text = corrected(ROBOT, &model, &terms).unwrap().unwrap();
        assert!(text.contains("<!-- kept -->\n<robot name=\"two\">\n  <link name=\"base\"/>"));
        let new = Model::from_urdf(&text).unwrap();
        let link = |name: &str| {
            let model = &new;
            &model.links()[model.link_index(name).unwrap()]
        };
        assert!((link("arm").mass_kg() - 1.5).abs() < 1e-12);
        assert!((link("tool").mass_kg() - 1.0).abs() < 1e-12);
        // What the robot feels is what the terms say.
        let mut altered = model.clone();
        for term in &terms {
            assert!(term.build(&model).unwrap().alter(&mut altered));
        }
        let (expected, found) = (altered.body_parameters(0), new.body_parameters(0));
        for (expected, found) in expected.iter().zip(found) {
            assert!((expected - found).abs() < 1e-12, "{expected} {found}");
        }
    }

    #[test]
    fn friction_is_not_for_a_robot_and_no_body_is_refused() {
        let model = Model::from_urdf(ROBOT).unwrap();
        let friction = terms(
            r#"[{"effect": "coulomb_friction", "joint": "turn", "parameters": {"coulomb_nm": 1.0}}]"#,
        );
        assert!(corrected(ROBOT, &model, &friction).unwrap().is_none());
        assert!(corrected(ROBOT, &model, &[]).unwrap().is_none());
        let nothing = terms(
            r#"[{"effect": "link_mass", "link": "arm", "parameters": {"delta_mass_kg": -3.0}}]"#,
        );
        assert!(matches!(
            corrected(ROBOT, &model, &nothing),
            Err(RobotError::NoBody(link)) if link == "arm"
        ));
    }
}
