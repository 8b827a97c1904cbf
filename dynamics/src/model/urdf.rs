//! The URDF's links and joints, each checked by itself; [`super::tree`] checks them together.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};

use super::document::{self, JointMarks};
use super::drive::drives;
use super::{Drive, Geometry, JointKind, Limits, ModelError, Shape};
use crate::inertia::Inertia;
use crate::inertia::symmetric;

/// A robot as written.
#[derive(Debug)]
pub(super) struct Robot {
    pub name: String,
    pub links: Vec<RawLink>,
    pub joints: Vec<RawJoint>,
}

#[derive(Debug)]
pub(super) struct RawLink {
    pub name: String,
    pub inertia: Inertia,
    pub shapes: Vec<Shape>,
    /// Its `<collision>` elements.
    pub collisions: Vec<Shape>,
}

/// A joint, fixed or not.
#[derive(Debug)]
pub(super) struct RawJoint {
    pub name: String,
    pub line: u32,
    /// `None` if fixed.
    pub movable: Option<Movable>,
    /// Links by index.
    pub parent: usize,
    pub child: usize,
    pub origin: Isometry3<f64>,
}

#[derive(Debug)]
pub(super) struct Movable {
    pub kind: JointKind,
    /// Of length 1.
    pub axis: Vector3<f64>,
    pub limits: Limits,
    pub drive: Drive,
    pub follows: Option<Follows>,
}

impl Movable {
    /// Pose of the joint's child at a position \[rad or m\], relative to position zero.
    pub fn moved(&self, position: f64) -> Isometry3<f64> {
        let along = self.axis * position;
        match self.kind {
            JointKind::Prismatic => {
                Isometry3::from_parts(along.into(), nalgebra::UnitQuaternion::identity())
            }
            JointKind::Revolute | JointKind::Continuous => Isometry3::rotation(along),
        }
    }
}

/// The joint that determines the position of another: `ratio` times its position, plus `offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leader {
    /// Its index among all joints.
    pub joint: usize,
    pub ratio: f64,
    pub offset: f64,
}

impl RawJoint {
    /// Joint at the end of the chain of `<mimic>` elements; the joint itself without a `<mimic>`, `None` if it cannot
    /// move.
    ///
    /// # Errors
    /// If a `<mimic>` names no joint, or they form a cycle.
    pub fn leader(&self, joints: &[Self]) -> Result<Option<Leader>, ModelError> {
        let place = |name: &str| joints.iter().position(|joint| joint.name == name);
        let (mut at, mut ratio, mut offset) = (self, 1.0, 0.0);
        for _ in 0..=joints.len() {
            let Some(follows) = at.movable.as_ref().and_then(|m| m.follows.as_ref()) else {
                let leader = |joint| Leader {
                    joint,
                    ratio,
                    offset,
                };
                return Ok(place(&at.name)
                    .filter(|_| self.movable.is_some())
                    .map(leader));
            };
            offset += ratio * follows.offset;
            ratio *= follows.ratio;
            at = match place(&follows.joint) {
                Some(next) => &joints[next],
                None => {
                    return Err(ModelError::UnknownMimic {
                        line: at.line,
                        joint: at.name.clone(),
                        mimics: follows.joint.clone(),
                    });
                }
            };
        }
        Err(ModelError::MimicCircle {
            line: self.line,
            joint: self.name.clone(),
        })
    }
}

/// A `<mimic>`.
#[derive(Debug, Clone)]
pub(super) struct Follows {
    /// The joint's name.
    pub joint: String,
    pub ratio: f64,
    pub offset: f64,
}

/// Reads the document.
///
/// # Errors
/// If the document, a link or a joint is invalid by itself.
pub(super) fn read(xml: &str) -> Result<Robot, ModelError> {
    let marks = document::inspect(xml)?;
    let used = document::without_unused(xml)?;
    let robot = urdf_rs::read_from_string(&used).map_err(|error| document::blame(&used, &error))?;
    let mut indices: BTreeMap<String, usize> = BTreeMap::new();
    let mut links = Vec::with_capacity(robot.links.len());
    for (index, (link, &line)) in robot.links.into_iter().zip(&marks.link_lines).enumerate() {
        if let Some(first) = indices.insert(link.name.clone(), index) {
            let first_line = marks.link_lines[first];
            return Err(ModelError::DuplicateLink {
                link: link.name,
                first_line,
                line,
            });
        }
        links.push(read_link(link, line)?);
    }
    let drives = drives(&document::parse(xml)?);
    let mut seen: BTreeMap<String, u32> = BTreeMap::new();
    let mut joints = Vec::with_capacity(robot.joints.len());
    for (joint, marks) in robot.joints.into_iter().zip(&marks.joints) {
        let line = marks.line;
        if let Some(first_line) = seen.insert(joint.name.clone(), line) {
            return Err(ModelError::DuplicateJoint {
                joint: joint.name,
                first_line,
                line,
            });
        }
        let drive = drives.get(&joint.name).copied().unwrap_or_default();
        joints.push(read_joint(joint, marks, drive, &indices)?);
    }
    Ok(Robot {
        name: robot.name,
        links,
        joints,
    })
}

fn read_link(link: urdf_rs::Link, line: u32) -> Result<RawLink, ModelError> {
    let inertial = link.inertial;
    let mass = inertial.mass.value;
    if mass < 0.0 {
        return Err(ModelError::NegativeMass {
            line,
            link: link.name,
            mass_kg: mass,
        });
    }
    let i = inertial.inertia;
    let about_com = symmetric([i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz]);
    let inertia = Inertia::from_parts(mass, Vector3::zeros(), about_com);
    let shapes = link.visual.into_iter().map(|visual| Shape {
        origin: pose(&visual.origin),
        geometry: geometry(visual.geometry),
    });
    let collisions = link.collision.into_iter().map(|collision| Shape {
        origin: pose(&collision.origin),
        geometry: geometry(collision.geometry),
    });
    Ok(RawLink {
        name: link.name,
        inertia: inertia.transformed(&pose(&inertial.origin)),
        shapes: shapes.collect(),
        collisions: collisions.collect(),
    })
}

fn read_joint(
    joint: urdf_rs::Joint,
    marks: &JointMarks,
    drive: Drive,
    links: &BTreeMap<String, usize>,
) -> Result<RawJoint, ModelError> {
    let (name, line) = (joint.name, marks.line);
    let link = |role, link: String| match links.get(&link) {
        Some(&index) => Ok(index),
        None => Err(ModelError::UnknownLink {
            line,
            joint: name.clone(),
            role,
            link,
        }),
    };
    let (parent, child) = (
        link("parent", joint.parent.link)?,
        link("child", joint.child.link)?,
    );
    let unsupported = |kind| ModelError::UnsupportedJoint {
        line,
        joint: name.clone(),
        kind,
    };
    let kind = match joint.joint_type {
        urdf_rs::JointType::Fixed => None,
        urdf_rs::JointType::Revolute => Some(JointKind::Revolute),
        urdf_rs::JointType::Continuous => Some(JointKind::Continuous),
        urdf_rs::JointType::Prismatic => Some(JointKind::Prismatic),
        urdf_rs::JointType::Floating => return Err(unsupported("floating")),
        urdf_rs::JointType::Planar => return Err(unsupported("planar")),
        urdf_rs::JointType::Spherical => return Err(unsupported("spherical")),
    };
    let movable = match kind {
        None => None,
        Some(kind) => {
            let axis = Vector3::from(*joint.axis.xyz);
            let Some(axis) = axis.try_normalize(f64::MIN_POSITIVE) else {
                return Err(ModelError::ZeroAxis { line, joint: name });
            };
            Some(Movable {
                kind,
                axis,
                limits: limits(kind, &joint.limit, marks),
                drive,
                follows: joint.mimic.map(|mimic| Follows {
                    joint: mimic.joint,
                    ratio: mimic.multiplier.unwrap_or(1.0),
                    offset: mimic.offset.unwrap_or(0.0),
                }),
            })
        }
    };
    Ok(RawJoint {
        name,
        line,
        movable,
        parent,
        child,
        origin: pose(&joint.origin),
    })
}

fn limits(kind: JointKind, limit: &urdf_rs::JointLimit, marks: &JointMarks) -> Limits {
    let known = |given: bool, value: f64| (given && value.is_finite()).then_some(value);
    let bounded = kind != JointKind::Continuous;
    // Limits whose lower bound is not below the upper one are a mistake of unknown intent.
    let leave_none = bounded && limit.lower >= limit.upper && (marks.lower || marks.upper);
    let bounded = bounded && limit.lower < limit.upper;
    Limits {
        ignored: leave_none.then_some([limit.lower, limit.upper]),
        lower: known(bounded && marks.lower, limit.lower),
        upper: known(bounded && marks.upper, limit.upper),
        velocity: known(marks.velocity, limit.velocity),
        effort: known(marks.effort, limit.effort),
    }
}

fn pose(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = *pose.rpy;
    let rotation = nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Vector3::from(*pose.xyz).into(), rotation)
}

fn geometry(geometry: urdf_rs::Geometry) -> Geometry {
    match geometry {
        urdf_rs::Geometry::Box { size } => Geometry::Box { size_m: *size },
        urdf_rs::Geometry::Cylinder { radius, length } => Geometry::Cylinder {
            radius_m: radius,
            length_m: length,
        },
        // Drawn as the circumscribed cylinder.
        urdf_rs::Geometry::Capsule { radius, length } => Geometry::Cylinder {
            radius_m: radius,
            length_m: length + 2.0 * radius,
        },
        urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius_m: radius },
        urdf_rs::Geometry::Mesh { filename, scale } => Geometry::Mesh {
            filename,
            scale: scale.map_or([1.0; 3], |scale| *scale),
        },
    }
}
