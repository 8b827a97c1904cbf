//! Errors of reading a URDF.

/// Reason why a URDF cannot be used. Lines count from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The text is not XML.
    #[error("not well-formed XML at line {line}, column {column}: {reason}")]
    Xml {
        /// Line.
        line: u32,
        /// Column.
        column: u32,
        /// Message of the XML reader.
        reason: String,
    },
    /// The document is larger than any robot's.
    #[error("{found} {what}: more than {limit}, which is the limit for a URDF")]
    TooLarge {
        /// Kind of the excess elements.
        what: &'static str,
        /// Lower bound on their number.
        found: usize,
        /// Largest number allowed.
        limit: usize,
    },
    /// The text is a xacro template.
    #[error(
        "line {line}: `{found}` is xacro, not URDF; expand it first: `xacro FILE.xacro > FILE.urdf` (with ROS 2: \
         `ros2 run xacro xacro FILE.xacro > FILE.urdf`)"
    )]
    Xacro {
        /// Line.
        line: u32,
        /// The element or attribute value that xacro would have expanded.
        found: String,
    },
    /// The document is of another kind.
    #[error(
        "line {line}: the document is a <{found}>, a URDF is a <robot>{}",
        conversion(found)
    )]
    NotARobot {
        /// Line.
        line: u32,
        /// The document's outermost element.
        found: String,
    },
    /// A joint mimics one that does not exist.
    #[error("line {line}: joint `{joint}` mimics joint `{mimics}`, which the robot does not have")]
    UnknownMimic {
        /// Line of the joint.
        line: u32,
        /// The joint.
        joint: String,
        /// The joint in its `<mimic>`.
        mimics: String,
    },
    /// Joints mimic each other in a circle.
    #[error("line {line}: joint `{joint}` mimics itself, over others or not: no joint moves it")]
    MimicCircle {
        /// Line of the joint.
        line: u32,
        /// One of the joints.
        joint: String,
    },
    /// An attribute is not a valid number.
    #[error("line {line}: {element} has {attribute}=\"{text}\": not {expected}")]
    Number {
        /// Line.
        line: u32,
        /// The element, and the link or joint it belongs to.
        element: String,
        /// The attribute.
        attribute: String,
        /// Its text.
        text: String,
        /// Expected text.
        expected: &'static str,
    },
    /// The document breaks the URDF format in another way.
    #[error("line {line}: {element} is not valid URDF: {reason}")]
    Urdf {
        /// Line.
        line: u32,
        /// The link or joint, or else the robot.
        element: String,
        /// Message of the URDF reader.
        reason: String,
    },
    /// Two links with the same name.
    #[error("line {line}: a second link `{link}`; the first is on line {first_line}")]
    DuplicateLink {
        /// The name.
        link: String,
        /// Line of the first.
        first_line: u32,
        /// Line of the second.
        line: u32,
    },
    /// Two joints with the same name.
    #[error("line {line}: a second joint `{joint}`; the first is on line {first_line}")]
    DuplicateJoint {
        /// The name.
        joint: String,
        /// Line of the first.
        first_line: u32,
        /// Line of the second.
        line: u32,
    },
    /// A joint names a link that does not exist.
    #[error("line {line}: joint `{joint}` names the {role} link `{link}`, which is not there")]
    UnknownLink {
        /// Line.
        line: u32,
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The missing link.
        link: String,
    },
    /// A joint of an unsupported kind.
    #[error(
        "line {line}: joint `{joint}` is {kind}; revolute, continuous, prismatic and fixed joints are supported"
    )]
    UnsupportedJoint {
        /// Line.
        line: u32,
        /// The joint.
        joint: String,
        /// Its kind.
        kind: &'static str,
    },
    /// A movable joint whose axis is zero.
    #[error("line {line}: the axis of joint `{joint}` is zero")]
    ZeroAxis {
        /// Line.
        line: u32,
        /// The joint.
        joint: String,
    },
    /// A link with a negative mass.
    #[error("line {line}: the mass of link `{link}` is {mass_kg} kg")]
    NegativeMass {
        /// Line.
        line: u32,
        /// The link.
        link: String,
        /// The mass.
        mass_kg: f64,
    },
    /// A link that is the child of two joints.
    #[error("line {line}: link `{link}` is the child of both `{first}` and `{second}`")]
    TwoParents {
        /// Line of the second joint.
        line: u32,
        /// The link.
        link: String,
        /// A joint that moves it.
        first: String,
        /// The other.
        second: String,
    },
    /// The robot has several roots.
    #[error(
        "{} links have no parent joint: {}. A robot has one root: connect them to one link by fixed joints, or use one URDF for \
         each arm",
        roots.len(),
        list(roots)
    )]
    SeveralRoots {
        /// The links that are no joint's child.
        roots: Vec<String>,
    },
    /// Joints that form a cycle.
    #[error("the joints form a cycle: {}", list(joints))]
    Cycle {
        /// The joints of the cycle, in order.
        joints: Vec<String>,
    },
    /// The robot has no movable joint.
    #[error("the robot `{robot}` has no movable joint")]
    NothingMoves {
        /// The robot.
        robot: String,
    },
    /// The bodies that a joint moves have no mass: the dynamics would be meaningless.
    #[error(
        "line {line}: joint `{joint}` moves no mass: {} without a mass in <inertial>",
        bodies(links)
    )]
    NoMass {
        /// Line of the joint.
        line: u32,
        /// The joint.
        joint: String,
        /// The links it moves, up to the next movable joint.
        links: Vec<String>,
    },
}

/// Advice on converting a robot description of another format to URDF, by the document's outermost element.
fn conversion(root: &str) -> &'static str {
    match root {
        // Version 0.7.3 of the package converts hinge joints and inertias, and has no command-line program.
        "mujoco" => {
            "; MJCF must be converted first: `pip install mjcf-urdf-simple-converter`, then `python3 -c 'from \
             mjcf_urdf_simple_converter import convert; convert(\"FILE.xml\", \"FILE.urdf\")'` (hinge joints only)"
        }
        "sdf" => {
            "; SDF is not read: give the URDF or xacro file that the model was made from (`gz sdf -p` only converts \
             URDF to SDF)"
        }
        _ => "",
    }
}

fn list(names: &[String]) -> String {
    let quoted: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
    quoted.join(", ")
}

fn bodies(links: &[String]) -> String {
    match links {
        [_] => format!("link {} is", list(links)),
        _ => format!("links {} are", list(links)),
    }
}
