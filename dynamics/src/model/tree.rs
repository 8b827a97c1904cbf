//! Builds the kinematic tree of the algorithms from links and joints.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::urdf::{Leader, RawJoint, RawLink, Robot};
use super::{Body, Follower, Frame, GRAVITY_M_S2, Joint, Link, Load, Model, ModelError};
use crate::inertia::Inertia;

/// Builds the model.
///
/// # Errors
/// If the links and joints are not a tree, nothing moves, or a moving body has no mass.
pub(super) fn build(robot: Robot) -> Result<Model, ModelError> {
    let parents = parent_joints(&robot)?;
    let order = parents_first(&robot, &parents)?;
    let movers = movers(&robot)?;
    let joints = movable_joints(&robot, &movers);
    let mut builder = Builder {
        links: &robot.links,
        movers: &movers,
        joints: joints.len(),
        bodies: Vec::new(),
        frames: vec![None; robot.links.len()],
    };
    let mut places = vec![(None, None); robot.links.len()];
    for &link in &order {
        match parents[link].map(|joint| (joint, &robot.joints[joint])) {
            None => builder.root(link),
            Some((index, joint)) => {
                builder.hang(index, joint);
                let carrier = match movers[index] {
                    Mover::Own(number) | Mover::Follows { number, .. } => Some(number),
                    Mover::Fixed { .. } => places[joint.parent].1,
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
    let followers = followers(&robot, &movers);
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
        followers,
        links,
        bodies,
        // Every link is reached: the order contains all of them.
        frames: frames.into_iter().flatten().collect(),
        gravity: Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
        tool_on: None,
    })
}

/// The joint that each link is the child of.
pub(super) fn parent_joints(robot: &Robot) -> Result<Vec<Option<usize>>, ModelError> {
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

/// Links ordered so that parents come first, and otherwise as in the document.
pub(super) fn parents_first(
    robot: &Robot,
    parents: &[Option<usize>],
) -> Result<Vec<usize>, ModelError> {
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
        // There is at most one root and one parent each, so a link that is not reached leads to a cycle.
        Some(link) => Err(cycle(robot, parents, link)),
        None => Ok(order),
    }
}

/// The cycle that the chain from `link` towards the base ends in.
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

/// The coordinate that determines a joint's position.
#[derive(Debug, Clone, Copy)]
enum Mover {
    /// The joint itself: its number among such joints.
    Own(usize),
    /// The joint of that number: the position is `ratio` times its position, plus `offset`.
    Follows {
        number: usize,
        ratio: f64,
        offset: f64,
    },
    /// None: the joint stays at that position \[rad or m\].
    Fixed { position: f64 },
}

fn movers(robot: &Robot) -> Result<Vec<Mover>, ModelError> {
    let mut count = 0;
    let mut number = |joint: &RawJoint| {
        let is_own = matches!(&joint.movable, Some(movable) if movable.follows.is_none());
        is_own.then(|| {
            count += 1;
            count - 1
        })
    };
    let numbers: Vec<Option<usize>> = robot.joints.iter().map(&mut number).collect();
    let mover = |index: usize| match robot.joints[index].leader(&robot.joints)? {
        Some(Leader {
            joint,
            ratio,
            offset,
        }) => Ok(match numbers[joint] {
            Some(number) if joint == index => Mover::Own(number),
            Some(number) => Mover::Follows {
                number,
                ratio,
                offset,
            },
            None => Mover::Fixed { position: offset },
        }),
        None => Ok(Mover::Fixed { position: 0.0 }),
    };
    (0..robot.joints.len()).map(mover).collect()
}

fn movable_joints(robot: &Robot, movers: &[Mover]) -> Vec<Joint> {
    let joint = |(raw, mover): (&RawJoint, &Mover)| {
        let movable = raw.movable.as_ref()?;
        matches!(mover, Mover::Own(_)).then(|| Joint {
            name: raw.name.clone(),
            kind: movable.kind,
            parent_link: raw.parent,
            child_link: raw.child,
            axis: movable.axis.into(),
            limits: movable.limits,
            drive: movable.drive,
        })
    };
    robot.joints.iter().zip(movers).filter_map(joint).collect()
}

fn followers(robot: &Robot, movers: &[Mover]) -> Vec<Follower> {
    let follower = |(raw, mover): (&RawJoint, &Mover)| match *mover {
        Mover::Follows {
            number,
            ratio,
            offset,
        } => Some(Follower {
            name: raw.name.clone(),
            joint: number,
            ratio,
            offset,
        }),
        Mover::Own(_) | Mover::Fixed { .. } => None,
    };
    robot
        .joints
        .iter()
        .zip(movers)
        .filter_map(follower)
        .collect()
}

fn refuse_massless(
    bodies: &[Body],
    joints: &[Joint],
    links: &[Link],
    raw: &[RawJoint],
) -> Result<(), ModelError> {
    let mut massless: Vec<usize> = bodies
        .iter()
        // A body that follows a joint may have no mass: the joint moves others.
        .filter(|body| body.own.mass == 0.0 && body.block == body.joint)
        .map(|body| body.joint)
        // A joint without a mass of its own may move others, for example the virtual joint of a gripper, which its
        // fingers follow.
        .filter(|joint| {
            bodies
                .iter()
                .all(|body| body.joint != *joint || body.own.mass == 0.0)
        })
        // Two joints in one place have a link without mass and shape in between, which carries the bodies of the next
        // joint.
        .filter(|joint| {
            let own = links.iter().filter(|link| link.joint == Some(*joint));
            let is_drawn = own.flat_map(|link| &link.shapes).next().is_some();
            is_drawn || !carries_mass(bodies, *joint)
        })
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

/// Whether any body that a joint carries has a mass.
fn carries_mass(bodies: &[Body], joint: usize) -> bool {
    let mut stands = vec![false; bodies.len()];
    // Parents come first.
    for (k, body) in bodies.iter().enumerate() {
        let on_parent = body
            .parent
            .checked_sub(1)
            .is_some_and(|parent| stands[parent]);
        stands[k] = body.joint == joint || on_parent;
    }
    let mut standing = bodies.iter().zip(stands);
    standing.any(|(body, stands)| stands && body.own.mass > 0.0)
}

struct Builder<'a> {
    links: &'a [RawLink],
    movers: &'a [Mover],
    /// Number of joints that follow no other.
    joints: usize,
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

    /// Attaches the joint's child to its parent, whose frame exists already.
    fn hang(&mut self, index: usize, joint: &RawJoint) {
        let Some(parent) = self.frames[joint.parent].clone() else {
            return;
        };
        let origin = joint.origin.rotation.to_rotation_matrix();
        let rotation = parent.rotation * origin.matrix();
        let translation = parent.translation + parent.rotation * joint.origin.translation.vector;
        let moved = match self.movers[index] {
            Mover::Own(number) => Some((number, 1.0, 0.0, number)),
            Mover::Follows {
                number,
                ratio,
                offset,
            } => {
                let earlier = &self.movers[..index];
                let followers = earlier
                    .iter()
                    .filter(|mover| matches!(mover, Mover::Follows { .. }));
                Some((number, ratio, offset, self.joints + followers.count()))
            }
            Mover::Fixed { .. } => None,
        };
        let frame = match (&joint.movable, moved) {
            (Some(movable), Some((number, ratio, offset, block))) => {
                let alignment = z_to(&movable.axis);
                self.bodies.push(Body {
                    joint: number,
                    ratio,
                    offset,
                    block,
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
            (movable, _) => {
                let stays = match (movable, self.movers[index]) {
                    (Some(movable), Mover::Fixed { position }) => movable.moved(position),
                    _ => Isometry3::identity(),
                };
                Frame {
                    slot: parent.slot,
                    rotation: rotation * stays.rotation.to_rotation_matrix().matrix(),
                    translation: translation + rotation * stays.translation.vector,
                }
            }
        };
        if let Some(body) = frame.slot.checked_sub(1) {
            let inertia = &self.links[joint.child].inertia;
            self.bodies[body].own += inertia.moved(&frame.rotation, &frame.translation);
        }
        self.frames[joint.child] = Some(frame);
    }
}

/// Rotation that maps `axis` to z: its rows are a right-handed frame with `axis` as the third. An axis along x, y or
/// z gives exact zeros and ones.
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
