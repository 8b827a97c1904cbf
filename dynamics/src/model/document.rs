//! The URDF as XML: places of elements and attributes as written, which the URDF reader does not return.
//!
//! `urdf-rs` gives no line numbers, reads missing limits as zero, skips words in a vector that are not numbers, and
//! reads an unexpanded xacro as a robot without links. So the XML is inspected first.

use std::borrow::Cow;
use std::ops::Range;

use roxmltree::{Document, Error, Node, ParsingOptions};

use super::ModelError;

/// Longest text \[bytes\].
/// Resolution: bounds memory and time.
const MAX_BYTES: usize = 16 << 20;
/// Most elements, attributes and texts.
/// Resolution: bounds memory and time.
const MAX_NODES: u32 = 200_000;
/// Most links and joints together: ten times those of a humanoid with hands.
/// Resolution: bounds time.
const MAX_PARTS: usize = 2000;
/// Greatest depth of nested elements.
/// Resolution: bounds the stack.
const MAX_DEPTH: usize = 64;

/// Lines of the links and joints and the limits that are given, each in document order.
#[derive(Debug)]
pub(super) struct Marks {
    pub link_lines: Vec<u32>,
    pub joints: Vec<JointMarks>,
}

#[derive(Debug)]
#[expect(clippy::struct_excessive_bools, reason = "one per attribute")]
pub(super) struct JointMarks {
    pub line: u32,
    pub lower: bool,
    pub upper: bool,
    pub velocity: bool,
    pub effort: bool,
}

/// Inspects the XML.
///
/// # Errors
/// If it is not XML, not a URDF, a xacro, or contains an invalid number.
pub(super) fn inspect(xml: &str) -> Result<Marks, ModelError> {
    let document = parse(xml)?;
    let root = document.root_element();
    refuse_xacro(&document)?;
    if root.tag_name().name() != "robot" {
        let found = root.tag_name().name().to_owned();
        return Err(ModelError::NotARobot {
            line: line(root),
            found,
        });
    }
    bound(&document)?;
    for part in elements(root).filter(|node| is_any(*node, &["link", "joint"])) {
        check_numbers(part)?;
    }
    let named = |name| elements(root).filter(move |node| node.has_tag_name(name));
    Ok(Marks {
        link_lines: named("link").map(line).collect(),
        joints: named("joint").map(joint_marks).collect(),
    })
}

/// Parses the document, unless it is larger than any robot's.
pub(super) fn parse(xml: &str) -> Result<Document<'_>, ModelError> {
    if xml.len() > MAX_BYTES {
        return Err(ModelError::TooLarge {
            what: "bytes",
            found: xml.len(),
            limit: MAX_BYTES,
        });
    }
    let options = ParsingOptions {
        nodes_limit: MAX_NODES,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(xml, options).map_err(|error| match error {
        Error::NodesLimitReached => ModelError::TooLarge {
            what: "elements, attributes and texts",
            found: MAX_NODES as usize + 1,
            limit: MAX_NODES as usize,
        },
        // The parser reports the place of the first letter.
        Error::UnexpectedEndOfStream => {
            let last = xml.lines().last().unwrap_or_default();
            ModelError::Xml {
                line: xml.lines().count().max(1) as u32,
                column: last.chars().count() as u32 + 1,
                reason: "the file ends in the middle of it".to_owned(),
            }
        }
        error => not_xml(&error),
    })
}

/// Refuses documents that would take minutes: many links, or deeply nested elements.
fn bound(document: &Document) -> Result<(), ModelError> {
    let links = elements(document.root_element())
        .filter(|node| is_any(*node, &["link", "joint"]))
        .count();
    let mut depths: Vec<usize> = Vec::new();
    let mut deepest = 0;
    // In document order: a parent comes before its children.
    for node in document.root().descendants() {
        let above = node
            .parent()
            .and_then(|parent| depths.get(parent.id().get_usize()));
        let depth = above.map_or(0, |above| above + 1);
        depths.push(depth);
        deepest = deepest.max(depth);
    }
    for (what, found, limit) in [
        ("links and joints", links, MAX_PARTS),
        ("elements within one another", deepest, MAX_DEPTH),
    ] {
        if found > limit {
            return Err(ModelError::TooLarge { what, found, limit });
        }
    }
    Ok(())
}

/// Error with the link or joint that the URDF reader failed at. The reader does not name it, so each is read alone.
pub(super) fn blame(xml: &str, error: &urdf_rs::UrdfError) -> ModelError {
    let document = match parse(xml) {
        Ok(document) => document,
        Err(error) => return error,
    };
    let root = document.root_element();
    let version = root.attribute("version").unwrap_or("1.0");
    for part in elements(root).filter(|node| is_any(*node, &["link", "joint"])) {
        let text = &xml[part.range()];
        let alone = format!("<robot name=\"\" version=\"{version}\">{text}</robot>");
        if let Err(error) = urdf_rs::read_from_string(&alone) {
            return invalid(part, &error);
        }
    }
    invalid(root, error)
}

fn invalid(node: Node, error: &urdf_rs::UrdfError) -> ModelError {
    let name = node.attribute("name").unwrap_or("");
    ModelError::Urdf {
        line: line(node),
        element: format!("{} `{name}`", node.tag_name().name()),
        reason: error.to_string().trim_start_matches("custom: ").to_owned(),
    }
}

fn not_xml(error: &Error) -> ModelError {
    let at = error.pos();
    if let Error::UnknownNamespace(prefix, _) = error
        && prefix == "xacro"
    {
        return ModelError::Xacro {
            line: at.row,
            found: "xacro:".to_owned(),
        };
    }
    ModelError::Xml {
        line: at.row,
        column: at.col,
        reason: error.to_string(),
    }
}

/// Refuses an unexpanded xacro. A `xmlns:xacro` alone is harmless: it remains in every expanded file.
fn refuse_xacro(document: &Document) -> Result<(), ModelError> {
    for node in document.descendants().filter(Node::is_element) {
        let name = node.tag_name();
        if name.namespace().is_some_and(|uri| uri.contains("xacro")) {
            let found = format!("<xacro:{}>", name.name());
            return Err(ModelError::Xacro {
                line: line(node),
                found,
            });
        }
        for attribute in node.attributes() {
            if attribute.value().contains("${") || attribute.value().contains("$(") {
                let found = attribute.value().to_owned();
                return Err(ModelError::Xacro {
                    line: line(node),
                    found,
                });
            }
        }
    }
    Ok(())
}

/// Attributes with numbers, and the count of numbers; limits may be infinite.
const NUMBERS: &[(&str, &[&str], usize)] = &[
    ("origin", &["xyz", "rpy"], 3),
    ("axis", &["xyz"], 3),
    ("mass", &["value"], 1),
    ("inertia", &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"], 1),
    ("mimic", &["multiplier", "offset"], 1),
    ("limit", &["lower", "upper", "velocity", "effort"], 1),
];

/// Elements of a joint that describe its motion. A fixed joint has no motion, so their content is ignored there:
/// exporters leave a zero or an empty axis behind.
const OF_MOTION: &[&str] = &[
    "axis",
    "limit",
    "mimic",
    "dynamics",
    "calibration",
    "safety_controller",
];

/// Whether `node` is an element without effect, because its joint is fixed.
fn is_unused(node: Node) -> bool {
    let is_fixed = |joint: Node| {
        joint.has_tag_name("joint") && joint.attribute("type").map(str::trim) == Some("fixed")
    };
    is_any(node, OF_MOTION) && node.parent().is_some_and(is_fixed)
}

/// The text with the axes, limits and the like of fixed joints blanked out, for the URDF reader, which refuses a limit
/// that is not a number. Lines stay where they are.
///
/// # Errors
/// If the text is not XML, or larger than any robot.
pub(super) fn without_unused(xml: &str) -> Result<Cow<'_, str>, ModelError> {
    let document = parse(xml)?;
    let joints = elements(document.root_element()).filter(|node| node.has_tag_name("joint"));
    let unused: Vec<Range<usize>> = joints
        .flat_map(elements)
        .filter(|node| is_unused(*node))
        .map(|node| node.range())
        .collect();
    if unused.is_empty() {
        return Ok(Cow::Borrowed(xml));
    }
    let mut text = xml.to_owned();
    for place in unused {
        let blank: String = xml[place.clone()]
            .bytes()
            .map(|byte| if byte == b'\n' { '\n' } else { ' ' })
            .collect();
        text.replace_range(place, &blank);
    }
    Ok(Cow::Owned(text))
}

/// Checks the numbers of a link or joint.
fn check_numbers(part: Node) -> Result<(), ModelError> {
    let used = |node: &Node| node.is_element() && !is_unused(*node);
    for node in part.descendants().filter(used) {
        let tag = node.tag_name().name();
        let Some((_, attributes, count)) = NUMBERS.iter().find(|(name, ..)| *name == tag) else {
            continue;
        };
        for attribute in *attributes {
            let Some(text) = node.attribute(*attribute) else {
                continue;
            };
            let numbers: Vec<Option<f64>> = text
                .split_whitespace()
                .map(|word| word.parse().ok())
                .collect();
            let infinite_allowed = tag == "limit";
            let good = |x: &Option<f64>| {
                x.is_some_and(|x| x.is_finite() || (infinite_allowed && x.is_infinite()))
            };
            if numbers.len() != *count || !numbers.iter().all(good) {
                return Err(ModelError::Number {
                    line: line(node),
                    element: describe(node, part),
                    attribute: (*attribute).to_owned(),
                    text: text.to_owned(),
                    expected: if *count == 1 {
                        "a number"
                    } else {
                        "three numbers"
                    },
                });
            }
        }
    }
    Ok(())
}

fn describe(node: Node, part: Node) -> String {
    let name = part.attribute("name").unwrap_or("");
    format!(
        "<{}> of {} `{name}`",
        node.tag_name().name(),
        part.tag_name().name()
    )
}

fn joint_marks(joint: Node) -> JointMarks {
    let limit = elements(joint).find(|node| node.has_tag_name("limit"));
    let given = |name| limit.is_some_and(|limit| limit.has_attribute(name));
    JointMarks {
        line: line(joint),
        lower: given("lower"),
        upper: given("upper"),
        velocity: given("velocity"),
        effort: given("effort"),
    }
}

pub(super) fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(Node::is_element)
}

fn is_any(node: Node, names: &[&str]) -> bool {
    names.iter().any(|name| node.has_tag_name(*name))
}

/// Line of an element, from 1.
pub(super) fn line(node: Node) -> u32 {
    node.document().text_pos_at(node.range().start).row
}
