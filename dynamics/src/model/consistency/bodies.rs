//! The moving links of a URDF that have a mass or an inertia, with the lengths that they are compared with.

use nalgebra::{Isometry3, Rotation3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::super::document::{elements, line, parse};
use super::super::places::LEAST_SHARE;
use super::super::urdf::{RawJoint, Robot, read};
use super::super::{Geometry, JointKind, ModelError, Shape, tree};
use super::finding::LinkPlace;
use super::moments::{Principal, compact_length_m, half_unit};

/// Distance of a centre of mass from its link's frame above which it is implausible, in lengths of the link and its
/// neighbours.
/// Measured: at most 1.4 for the 232 moving links of 32 URDFs of arms, 2.9 for those of 49 URDFs of the package
/// example-robot-data.
pub const FAR: f64 = 5.0;
/// Largest moment of a link below which it has no effect on the robot, relative to the moment of all masses at the reach of
/// the robot.
/// Derived: efforts are measured to a millionth of the largest at best; a thousand times less.
const NO_EFFECT: f64 = 1e-9;

/// A moving link with a mass or an inertia.
#[derive(Debug, Clone)]
pub struct Body {
    pub place: LinkPlace,
    pub mass_kg: f64,
    /// xx, xy, xz, yy, yz, zz along the axes of the `<inertial>` \[kg m²\].
    pub numbers: [f64; 6],
    pub principal: Principal,
    /// Half a unit of the last printed digit of `numbers` \[kg m²\].
    pub half_unit: f64,
    /// In the link's frame \[m\].
    pub com_m: Vector3<f64>,
    /// Longest extent of the link's rigid group and the groups next to it, from frames and shapes \[m\].
    pub extent_m: f64,
    /// Vector along the link, in the axes of the `<inertial>` \[m\]: to the farthest joint that it carries, else along the
    /// longest side of its shapes, else twice the vector to its centre of mass.
    pub along_m: Vector3<f64>,
}

impl Body {
    /// Root of the largest principal moment over the mass \[m\].
    pub fn gyration_m(&self) -> f64 {
        (self.principal.largest().max(0.0) / self.mass_kg).sqrt()
    }

    /// Length of the link and its neighbours, and at least of a compact body of its mass \[m\].
    pub fn length_m(&self) -> f64 {
        self.extent_m.max(compact_length_m(self.mass_kg))
    }

    /// The body with its mass and inertia in other units.
    pub fn scaled(&self, mass: f64, inertia: f64) -> Self {
        Self {
            mass_kg: self.mass_kg * mass,
            numbers: self.numbers.map(|x| x * inertia),
            principal: self.principal.scaled(inertia),
            half_unit: self.half_unit * inertia,
            ..self.clone()
        }
    }

    /// Whether the centre of mass is implausibly far from the link's frame.
    pub fn is_centre_far(&self) -> bool {
        self.com_m.norm() > FAR * self.length_m()
    }

    /// Length that the radius of gyration is compared with \[m\].
    pub fn size_m(&self) -> f64 {
        let length_m = self.length_m();
        if self.is_centre_far() {
            length_m
        } else {
            length_m.max(self.com_m.norm())
        }
    }
}

/// The moving links of a robot.
#[derive(Debug)]
pub struct Bodies {
    /// In the order of the document; without those that have no effect on the motion.
    pub links: Vec<Body>,
    /// Distance of the farthest point from the base with all joints straight \[m\].
    pub reach_m: f64,
}

/// A set of links that are fixed to each other.
#[derive(Debug, Default)]
struct Group {
    /// The group that carries it.
    parent: Option<usize>,
    /// Smallest and largest coordinates of its frames, of those of the joints on it, and of its shapes.
    bounds: Option<[Vector3<f64>; 2]>,
    /// Path of a prismatic joint that carries it, 0 without limits \[m\].
    stroke_m: f64,
    /// Distance of its frame from the base's, along the chain \[m\].
    distance_m: f64,
    mass_kg: f64,
    /// Sum of the absolute principal moments.
    moment_kgm2: f64,
}

impl Group {
    fn hold(&mut self, point: Vector3<f64>) {
        let [low, high] = self.bounds.unwrap_or([point; 2]);
        self.bounds = Some([low.inf(&point), high.sup(&point)]);
    }

    /// Diagonal of its bounds \[m\].
    fn length_m(&self) -> f64 {
        self.bounds.map_or(0.0, |[low, high]| (high - low).norm())
    }
}

/// Reads the moving links.
///
/// # Errors
/// If the text is no robot.
pub fn bodies(xml: &str) -> Result<Bodies, ModelError> {
    let robot = read(xml)?;
    let (groups, places) = groups(&robot)?;
    let document = parse(xml)?;
    let nodes = elements(document.root_element()).filter(|node| node.has_tag_name("link"));
    let mut found: Vec<(usize, Body)> = Vec::new();
    for ((index, link), node) in robot.links.iter().enumerate().zip(nodes) {
        let group = places[index].0;
        let Some(inertial) = child(node, "inertial") else {
            continue;
        };
        if groups[group].parent.is_none() {
            continue;
        }
        let extent_m = length_near(&groups, group);
        let children = robot.joints.iter().filter(|joint| joint.parent == index);
        let along_m = along(children, link.shapes.iter().chain(&link.collisions));
        found.extend(body(inertial, &link.name, extent_m, along_m).map(|body| (group, body)));
    }
    let mut groups = groups;
    for (group, body) in &found {
        groups[*group].mass_kg += body.mass_kg;
        groups[*group].moment_kgm2 += body.principal.scale();
    }
    let reach_m = (groups.iter())
        .map(|group| group.distance_m + group.length_m())
        .fold(0.0, f64::max);
    let mass_kg: f64 = found.iter().map(|(_, body)| body.mass_kg).sum();
    let least = NO_EFFECT * mass_kg * reach_m * reach_m;
    let matters = |(group, body): &(usize, Body)| {
        let (group, moment) = (&groups[*group], body.principal.scale());
        let in_group =
            body.mass_kg > LEAST_SHARE * group.mass_kg || moment > LEAST_SHARE * group.moment_kgm2;
        in_group && moment + body.mass_kg * body.length_m().powi(2) > least
    };
    found.retain(matters);
    Ok(Bodies {
        links: found.into_iter().map(|(_, body)| body).collect(),
        reach_m,
    })
}

/// The rigid groups, and by link its group and its frame in that of the group's first link.
///
/// # Errors
/// If the links and joints are no tree.
#[expect(clippy::type_complexity, reason = "a pair for each link")]
fn groups(robot: &Robot) -> Result<(Vec<Group>, Vec<(usize, Isometry3<f64>)>), ModelError> {
    let parents = tree::parent_joints(robot)?;
    let order = tree::parents_first(robot, &parents)?;
    let mut groups = vec![Group::default()];
    let mut places = vec![(0, Isometry3::identity()); robot.links.len()];
    for link in order {
        if let Some(joint) = parents[link].map(|joint| &robot.joints[joint]) {
            let (carrier, frame) = places[joint.parent];
            let origin = frame * joint.origin;
            groups[carrier].hold(origin.translation.vector);
            places[link] = match &joint.movable {
                None => (carrier, origin),
                Some(movable) => {
                    let limits = [movable.limits.lower, movable.limits.upper];
                    let stroke_m = match (movable.kind, limits) {
                        (JointKind::Prismatic, [Some(lower), Some(upper)]) => upper - lower,
                        _ => 0.0,
                    };
                    let before_m = groups[carrier].distance_m;
                    groups.push(Group {
                        parent: Some(carrier),
                        stroke_m,
                        distance_m: before_m + origin.translation.vector.norm() + stroke_m,
                        ..Group::default()
                    });
                    (groups.len() - 1, Isometry3::identity())
                }
            };
        }
        let (group, frame) = places[link];
        groups[group].hold(frame.translation.vector);
        let link = &robot.links[link];
        for corner in link.shapes.iter().chain(&link.collisions).flat_map(corners) {
            groups[group].hold(frame * corner);
        }
    }
    Ok((groups, places))
}

/// Longest extent of a group and of those next to it \[m\].
fn length_near(groups: &[Group], group: usize) -> f64 {
    let is_next = |other: &Group, place: usize| {
        place == group || other.parent == Some(group) || groups[group].parent == Some(place)
    };
    (groups.iter().enumerate())
        .filter(|(place, other)| is_next(other, *place))
        .map(|(_, other)| other.length_m().max(other.stroke_m))
        .fold(0.0, f64::max)
}

/// Vector along a link, in its frame, see [`Body::along_m`]; zero where only the centre of mass remains.
fn along<'a>(
    children: impl Iterator<Item = &'a RawJoint>,
    shapes: impl Iterator<Item = &'a Shape>,
) -> Vector3<f64> {
    let farthest = children
        .map(|joint| joint.origin.translation.vector)
        .max_by(|a, b| a.norm().total_cmp(&b.norm()))
        .unwrap_or_default();
    if farthest.norm() > 0.0 {
        return farthest;
    }
    let mut own = Group::default();
    shapes.flat_map(corners).for_each(|corner| own.hold(corner));
    let Some([low, high]) = own.bounds else {
        return Vector3::zeros();
    };
    let sides = high - low;
    let longest = sides.imax();
    Vector3::ith(longest, sides[longest])
}

/// Corners of the box around a shape, in the link's frame \[m\]; none for a mesh, whose size is in another file.
fn corners(shape: &Shape) -> Vec<Vector3<f64>> {
    let half = match shape.geometry {
        Geometry::Box { size_m } => Vector3::from(size_m) * 0.5,
        Geometry::Cylinder { radius_m, length_m } => {
            Vector3::new(radius_m, radius_m, 0.5 * length_m)
        }
        Geometry::Sphere { radius_m } => Vector3::repeat(radius_m),
        Geometry::Mesh { .. } => return Vec::new(),
    };
    let sign = |corner: usize, bit: usize| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
    (0..8)
        .map(|corner| Vector3::from_fn(|axis, _| sign(corner, axis) * half[axis]))
        .map(|corner| (shape.origin * nalgebra::Point3::from(corner)).coords)
        .collect()
}

/// The body of an `<inertial>`; `None` if it has neither mass nor inertia, or numbers at the limits of `f64`.
fn body(inertial: Node, name: &str, extent_m: f64, along_m: Vector3<f64>) -> Option<Body> {
    let number = |node: Option<Node>, attribute: &str| -> f64 {
        let text = node.and_then(|node| node.attribute(attribute));
        text.and_then(|text| text.trim().parse().ok())
            .unwrap_or(0.0)
    };
    let mass_kg = number(child(inertial, "mass"), "value");
    let inertia = child(inertial, "inertia");
    let numbers = NUMBERS.map(|attribute| number(inertia, attribute));
    let principal = Principal::of(numbers)?;
    let text = |attribute| inertia.and_then(|inertia| inertia.attribute(attribute));
    let diagonal = ["ixx", "iyy", "izz"].map(|attribute| text(attribute).unwrap_or("0"));
    let origin = child(inertial, "origin");
    let [com_m, rpy] = ["xyz", "rpy"].map(|attribute| triple(origin, attribute));
    let axes = UnitQuaternion::from_euler_angles(rpy.x, rpy.y, rpy.z);
    let along_m = if along_m == Vector3::zeros() {
        com_m * 2.0
    } else {
        along_m
    };
    let axes: Rotation3<f64> = axes.into();
    (mass_kg > 0.0 || principal.scale() > 0.0).then(|| Body {
        place: LinkPlace {
            link: name.to_owned(),
            line: line(inertial),
            inertia_line: line(inertia.unwrap_or(inertial)),
        },
        mass_kg,
        numbers,
        principal,
        half_unit: half_unit(diagonal),
        com_m,
        extent_m,
        along_m: axes.inverse() * along_m,
    })
}

/// Attributes of `<inertia>`, in the order of [`Body::numbers`].
pub const NUMBERS: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

/// The three numbers of an attribute, zeros where it is missing.
fn triple(node: Option<Node>, attribute: &str) -> Vector3<f64> {
    let text = node
        .and_then(|node| node.attribute(attribute))
        .unwrap_or("");
    let mut numbers = text
        .split_whitespace()
        .map(|word| word.parse().unwrap_or(0.0));
    Vector3::from_fn(|_, _| numbers.next().unwrap_or(0.0))
}

/// The first child element of that name.
pub fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    elements(node).find(|child| child.has_tag_name(name))
}
