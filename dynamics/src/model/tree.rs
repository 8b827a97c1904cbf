//! From links and joints to the tree the algorithms walk.

use nalgebra::{Matrix3, Vector3};

use super::urdf::{RawJoint, RawLink, Robot};
use super::{Body, Frame, GRAVITY_M_S2, Joint, Link, Load, Model, ModelError};
use crate::inertia::Inertia;

/// Puts the tree together.
///
/// # Errors
/// If the links and joints are no tree, nothing moves, or what moves weighs nothing.
pub(super) fn build(robot: Robot) -> Result<Model, ModelError> {
    let parents = parent_joints(&robot)?;
    let order = parents_first(&robot, &parents)?;
    let document_order = number_joints(&robot);
    let mut builder = Builder {
        links: &robot.links,
        document_order: &document_order,
        bodies: Vec::new(),
        frames: vec![None; robot.links.len()],
    };
    let mut places = vec![(None, None); robot.links.len()];
    for &link in &order {
        match parents[link].map(|joint| (joint, &robot.joints[joint])) {
            None => builder.root(link),
            Some((index, joint)) => {
                builder.hang(index, joint);
                let carrier = match document_order[index] {
                    Some(movable) => Some(movable),
                    None => places[joint.parent].1,
                };
                places[link] = (Some(joint.parent), carrier);
            }
        }
    }
    let Builder {
        mut bodies, frames, ..
    } = builder;
    for body in &mut bodies {
        body.update_load();
    }
    let joints = movable_joints(&robot);
    if joints.is_empty() {
        return Err(ModelError::NothingMoves { robot: robot.name });
    }
    let links: Vec<Link> = robot
        .links
        .into_iter()
        .zip(places)
        .map(|(link, (parent, joint))| Link {
            name: link.name,
            inertia: link.inertia,
            shapes: link.shapes,
            parent,
            joint,
        })
        .collect();
    refuse_massless(&bodies, &joints, &links, &robot.joints)?;
    Ok(Model {
        name: robot.name,
        joints,
        links,
        bodies,
        // Every link is reached: the order holds them all.
        frames: frames.into_iter().flatten().collect(),
        gravity: Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
        tool_on: None,
    })
}

/// The joint that each link is the child of.
fn parent_joints(robot: &Robot) -> Result<Vec<Option<usize>>, ModelError> {
    let mut parents: Vec<Option<usize>> = vec![None; robot.links.len()];
    for (index, joint) in robot.joints.iter().enumerate() {
        if let Some(first) = parents[joint.child].replace(index) {
            return Err(ModelError::TwoParents {
                line: joint.line,
                link: robot.links[joint.child].name.clone(),
                first: robot.joints[first].name.clone(),
                second: joint.name.clone(),
            });
        }
    }
    Ok(parents)
}

/// The links in an order in which parents come first, and otherwise as in the document.
fn parents_first(robot: &Robot, parents: &[Option<usize>]) -> Result<Vec<usize>, ModelError> {
    let links = 0..robot.links.len();
    let roots: Vec<usize> = links
        .clone()
        .filter(|&link| parents[link].is_none())
        .collect();
    if roots.len() > 1 {
        let name = |&link: &usize| robot.links[link].name.clone();
        return Err(ModelError::SeveralRoots {
            roots: roots.iter().map(name).collect(),
        });
    }
    let mut order = roots;
    let mut next = 0;
    while let Some(&link) = order.get(next) {
        order.extend(
            robot
                .joints
                .iter()
                .filter(|j| j.parent == link)
                .map(|j| j.child),
        );
        next += 1;
    }
    match links.clone().find(|link| !order.contains(link)) {
        // One root at most and one parent each: what is not reached hangs on a ring.
        Some(link) => Err(cycle(robot, parents, link)),
        None => Ok(order),
    }
}

/// The ring that one comes to from `link` towards the base.
fn cycle(robot: &Robot, parents: &[Option<usize>], link: usize) -> ModelError {
    let mut visited: Vec<usize> = Vec::new();
    let mut at = link;
    while let Some(joint) = parents[at] {
        if let Some(start) = visited.iter().position(|&seen| seen == joint) {
            let ring = visited[start..].iter().rev();
            let joints = ring
                .map(|&joint| robot.joints[joint].name.clone())
                .collect();
            return ModelError::Cycle { joints };
        }
        visited.push(joint);
        at = robot.joints[joint].parent;
    }
    ModelError::Cycle { joints: Vec::new() }
}

/// For each joint its number among the movable ones.
fn number_joints(robot: &Robot) -> Vec<Option<usize>> {
    let mut count = 0;
    let number = |joint: &RawJoint| {
        joint.movable.as_ref().map(|_| {
            count += 1;
            count - 1
        })
    };
    robot.joints.iter().map(number).collect()
}

fn movable_joints(robot: &Robot) -> Vec<Joint> {
    let joint = |raw: &RawJoint| {
        let movable = raw.movable.as_ref()?;
        Some(Joint {
            name: raw.name.clone(),
            kind: movable.kind,
            parent_link: raw.parent,
            child_link: raw.child,
            axis: movable.axis.into(),
            limits: movable.limits,
            follows: movable.follows.clone(),
        })
    };
    robot.joints.iter().filter_map(joint).collect()
}

fn refuse_massless(
    bodies: &[Body],
    joints: &[Joint],
    links: &[Link],
    raw: &[RawJoint],
) -> Result<(), ModelError> {
    let mut massless: Vec<usize> = bodies
        .iter()
        .filter(|body| body.own.mass == 0.0)
        .map(|body| body.joint)
        .collect();
    massless.sort_unstable();
    let Some(&joint) = massless.first() else {
        return Ok(());
    };
    let name = &joints[joint].name;
    let moved = links.iter().filter(|link| link.joint == Some(joint));
    Err(ModelError::NoMass {
        line: raw
            .iter()
            .find(|raw| raw.name == *name)
            .map_or(0, |raw| raw.line),
        joint: name.clone(),
        links: moved.map(|link| link.name.clone()).collect(),
    })
}

struct Builder<'a> {
    links: &'a [RawLink],
    document_order: &'a [Option<usize>],
    bodies: Vec<Body>,
    frames: Vec<Option<Frame>>,
}

impl Builder<'_> {
    fn root(&mut self, link: usize) {
        let (rotation, translation) = (Matrix3::identity(), Vector3::zeros());
        self.frames[link] = Some(Frame {
            slot: 0,
            rotation,
            translation,
        });
    }

    /// Hangs the joint's child on its parent, which has its frame already.
    fn hang(&mut self, index: usize, joint: &RawJoint) {
        let Some(parent) = self.frames[joint.parent].clone() else {
            return;
        };
        let origin = joint.origin.rotation.to_rotation_matrix();
        let rotation = parent.rotation * origin.matrix();
        let translation = parent.translation + parent.rotation * joint.origin.translation.vector;
        let frame = match (&joint.movable, self.document_order[index]) {
            (Some(movable), Some(number)) => {
                let alignment = z_to(&movable.axis);
                self.bodies.push(Body {
                    joint: number,
                    parent: parent.slot,
                    prismatic: movable.kind == super::JointKind::Prismatic,
                    rotation: rotation * alignment.transpose(),
                    translation,
                    alignment,
                    own: Inertia::zero(),
                    tool: Inertia::zero(),
                    load: Load::default(),
                });
                Frame {
                    slot: self.bodies.len(),
                    rotation: alignment,
                    translation: Vector3::zeros(),
                }
            }
            _ => Frame {
                slot: parent.slot,
                rotation,
                translation,
            },
        };
        if let Some(body) = frame.slot.checked_sub(1) {
            let inertia = &self.links[joint.child].inertia;
            self.bodies[body].own += inertia.moved(&frame.rotation, &frame.translation);
        }
        self.frames[joint.child] = Some(frame);
    }
}

/// A rotation that takes `axis` to z: its rows are a right-handed frame with `axis` as the third. An
/// axis along x, y or z gives exact zeros and ones.
fn z_to(axis: &Vector3<f64>) -> Matrix3<f64> {
    if *axis == Vector3::z() {
        return Matrix3::identity();
    }
    let mut least = Vector3::zeros();
    least[axis.iamin()] = 1.0;
    let x = least.cross(axis).normalize();
    let y = axis.cross(&x);
    Matrix3::from_rows(&[x.transpose(), y.transpose(), axis.transpose()])
}
