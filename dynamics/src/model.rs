//! The robot: its tree of links and joints, prepared for the algorithms.

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::inertia::Inertia;

mod consistency;
mod document;
mod drive;
mod error;
mod fix;
mod places;
mod shape;
mod tree;
mod urdf;

pub use consistency::{
    BodyFault, BodyFinding, BodyPlace, BodySeverity, Substitute, check_bodies,
    with_plausible_bodies,
};
pub use drive::{Drive, MUJOCO};
pub use error::ModelError;
pub use fix::fix_joints;
pub use shape::{Geometry, Shape};

/// Gravity \[m/s²\], along the world's -z.
/// Physical: URDF and its simulators use 9.81 instead of the standard 9.80665.
const GRAVITY_M_S2: f64 = 9.81;

/// A robot with a fixed base. Cheap to share by reference; the properties that change during a run (gravity, tool)
/// can be set without allocation.
#[derive(Debug, Clone)]
pub struct Model {
    name: String,
    joints: Vec<Joint>,
    followers: Vec<Follower>,
    links: Vec<Link>,
    /// In traversal order: parents first.
    pub(crate) bodies: Vec<Body>,
    /// Per link.
    pub(crate) frames: Vec<Frame>,
    pub(crate) gravity: Vector3<f64>,
    /// The link that [`Model::set_tool`] was last called with.
    tool_on: Option<usize>,
}

/// A movable joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name, unique in the robot.
    pub name: String,
    /// Kind of its motion.
    pub kind: JointKind,
    /// The link it is mounted on, an index into [`Model::links`].
    pub parent_link: usize,
    /// The link it moves.
    pub child_link: usize,
    /// Its axis in the child link's frame, of length 1.
    pub axis: [f64; 3],
    /// Limits that the URDF gives.
    pub limits: Limits,
    /// Friction, rotor and spring that the file states.
    pub drive: Drive,
}

impl Joint {
    /// Whether it slides: its position is in m and its effort in N.
    pub fn slides(&self) -> bool {
        self.kind == JointKind::Prismatic
    }

    /// Sentence on limits that are treated as missing.
    pub fn remark(&self) -> Option<String> {
        let [lower, upper] = self.limits.ignored?;
        let name = &self.name;
        Some(format!(
            "joint `{name}` counts as unlimited: in the URDF its lower limit, {lower}, is not below its upper one, \
             {upper}"
        ))
    }
}

/// A joint without a drive of its own: by its `<mimic>` its position follows that of another joint. It is not among
/// the [`Model::joints`]; its load is part of the effort of the joint that it follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Follower {
    /// Its name, unique in the robot.
    pub name: String,
    /// The joint that it follows, an index into [`Model::joints`].
    pub joint: usize,
    /// Its position is `ratio` times the position of that joint \[rad or m per rad or m\], plus `offset`.
    pub ratio: f64,
    /// Position at the zero of that joint \[rad or m\].
    pub offset: f64,
}

/// Kind of a joint's motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Turns within limits \[rad\].
    Revolute,
    /// Turns without limits \[rad\].
    Continuous,
    /// Slides \[m\].
    Prismatic,
}

/// Limits of a joint; `None` if the URDF gives none or an infinite one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Limits {
    /// Lowest position \[rad or m\].
    pub lower: Option<f64>,
    /// Highest position \[rad or m\].
    pub upper: Option<f64>,
    /// Highest speed \[rad/s or m/s\].
    pub velocity: Option<f64>,
    /// Highest effort \[N m or N\].
    pub effort: Option<f64>,
    /// Lowest and highest position in the URDF, if they leave no range and are treated as missing \[rad or m\].
    pub ignored: Option<[f64; 2]>,
}

/// A link, including those behind fixed joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Its name, unique in the robot.
    pub name: String,
    /// Inertia in its own frame as in the URDF; zero if there is none.
    pub inertia: Inertia,
    /// Shapes of its `<visual>` elements.
    pub shapes: Vec<Shape>,
    /// Parent link, by a movable or fixed joint; `None` for the root.
    pub parent: Option<usize>,
    /// Nearest joint towards the base that moves it; `None` for fixed links.
    pub joint: Option<usize>,
}

impl Link {
    /// Mass \[kg\].
    pub fn mass_kg(&self) -> f64 {
        self.inertia.mass_kg()
    }

    /// Centre of mass in the link's frame \[m\]; its origin for a link without mass.
    pub fn com_m(&self) -> [f64; 3] {
        self.inertia.com_m()
    }

    /// Radius of gyration: root-mean-square distance of the mass from its centre \[m\]; NaN without a mass.
    pub fn gyration_radius_m(&self) -> f64 {
        let [xx, _, _, yy, _, zz] = self.inertia.inertia_about_com_kgm2();
        (0.5 * (xx + yy + zz) / self.mass_kg()).sqrt()
    }
}

/// A moving body: a joint's child link and all links fixed to it. Its frame has the joint's axis as z, so that every
/// joint is as cheap as an aligned one.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    /// The joint that moves it: index in document order.
    pub joint: usize,
    /// The position of its own joint is `ratio` times that of `joint`, plus `offset`: 1 and 0 except for joints that
    /// follow another.
    pub ratio: f64,
    pub offset: f64,
    /// Index of its block of parameters in the regressor.
    pub block: usize,
    /// Slot of the parent: 0 is the base, i + 1 the body i.
    pub parent: usize,
    pub prismatic: bool,
    /// Pose in the parent's frame at position zero.
    pub rotation: Matrix3<f64>,
    pub translation: Vector3<f64>,
    /// Rotation from the child link's axes to the body's.
    pub alignment: Matrix3<f64>,
    /// Inertia of the lumped links, and of permanently attached bodies.
    pub own: Inertia,
    pub tool: Inertia,
    pub load: Load,
}

/// A body's inertia in the form that RNEA needs.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Load {
    pub mass: f64,
    pub first_moment: Vector3<f64>,
    /// ∫ r rᵀ dm.
    pub pseudo_inertia: Matrix3<f64>,
}

/// Pose of a link on the body that carries it.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub slot: usize,
    pub rotation: Matrix3<f64>,
    pub translation: Vector3<f64>,
}

impl Body {
    /// Inertia including the tool.
    pub fn inertia(&self) -> Inertia {
        self.own + self.tool
    }

    pub fn update_load(&mut self) {
        let total = self.inertia();
        let trace = total.rotational.trace();
        self.load = Load {
            mass: total.mass,
            first_moment: total.first_moment,
            pseudo_inertia: Matrix3::from_diagonal_element(0.5 * trace) - total.rotational,
        };
    }
}

impl Model {
    /// Reads a URDF.
    ///
    /// Supports trees of revolute, continuous, prismatic and fixed joints. Links behind fixed joints are lumped into
    /// the body that carries them and stay as frames. Elements that do not describe links and joints (`gazebo`,
    /// `transmission`, `ros2_control`, ...) are ignored.
    ///
    /// # Errors
    /// If the text, an element or the tree is invalid; with the element's name and line.
    pub fn from_urdf(xml: &str) -> Result<Self, ModelError> {
        tree::build(urdf::read(xml)?)
    }

    /// The robot's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of movable joints, without those that follow another.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// The movable joints, in the order of the URDF document.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The joints that follow one of these, in the order of the URDF document.
    pub fn followers(&self) -> &[Follower] {
        &self.followers
    }

    /// Whether a joint moves more than one body.
    #[inline]
    pub(crate) fn is_coupled(&self) -> bool {
        !self.followers.is_empty()
    }

    /// Names of the movable joints, in the order of the URDF document.
    pub fn joint_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.joints.iter().map(|joint| joint.name.as_str())
    }

    /// All links, in the order of the URDF document.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Index of the movable joint with this name.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Index of the link with this name.
    pub fn link_index(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// Gravity in the world frame \[m/s²\]; (0, 0, -9.81) unless set.
    pub fn gravity(&self) -> [f64; 3] {
        self.gravity.into()
    }

    /// Sets gravity in the world frame \[m/s²\]; for a tilted or hanging base, gravity in the base's frame.
    pub fn set_gravity(&mut self, gravity_m_s2: [f64; 3]) {
        self.gravity = gravity_m_s2.into();
    }

    /// Shifts the zero of `joint`: the pose at the position q is then the previous pose at q + `offset` \[rad or m\].
    ///
    /// # Panics
    /// If `joint` is not an index into [`Model::joints`].
    pub fn shift_zero(&mut self, joint: usize, offset: f64) {
        assert!(joint < self.dof(), "the robot has no joint {joint}");
        for body in self.bodies.iter_mut().filter(|body| body.joint == joint) {
            let offset = body.ratio * offset;
            if body.prismatic {
                body.translation += body.rotation.column(2) * offset;
            } else {
                let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), offset);
                body.rotation *= turn.matrix();
            }
        }
    }

    /// Adds `inertia`, in the frame of `link`, to the robot permanently, independent of the tool. On a fixed link it
    /// has no effect.
    ///
    /// # Panics
    /// If `link` is not an index into [`Model::links`].
    pub fn attach(&mut self, link: usize, inertia: Inertia) {
        self.change(link, |body, there| body.own += there, inertia);
    }

    /// Sets the tool: `inertia` in the frame of `link` replaces the previous tool, on whichever link that was.
    /// [`Inertia::zero`] removes it. On a fixed link it has no effect.
    ///
    /// # Panics
    /// If `link` is not an index into [`Model::links`].
    pub fn set_tool(&mut self, link: usize, inertia: Inertia) {
        if let Some(before) = self.tool_on.replace(link) {
            self.change(before, |body, there| body.tool = there, Inertia::zero());
        }
        self.change(link, |body, there| body.tool = there, inertia);
    }

    /// Returns the robot with all inertias zero except `inertia`, in the frame of `link`: gives the effort of this
    /// body alone.
    #[must_use]
    pub fn ghost(&self, link: usize, inertia: Inertia) -> Self {
        let mut ghost = self.clone();
        for body in &mut ghost.bodies {
            body.own = Inertia::zero();
            body.tool = Inertia::zero();
            body.update_load();
        }
        ghost.attach(link, inertia);
        ghost
    }

    /// Ten inertial parameters of a body, tool included, in the frame of its joint's child link: the factors of the
    /// regressor's columns, see [`crate::regressor`]. Body j is moved by joint j; those of [`Model::followers`] come
    /// after them.
    ///
    /// # Panics
    /// If the body does not exist.
    pub fn body_parameters(&self, body: usize) -> [f64; 10] {
        assert!(body < self.bodies.len(), "the robot has no body {body}");
        let body = self.bodies.iter().find(|other| other.block == body);
        body.map_or([0.0; 10], |body| {
            let to_link = body.alignment.transpose();
            body.inertia()
                .moved(&to_link, &Vector3::zeros())
                .parameters()
        })
    }

    /// Applies a change of inertia, given in a link's frame, to the body that carries the link.
    fn change(&mut self, link: usize, change: fn(&mut Body, Inertia), inertia: Inertia) {
        let frame = &self.frames[link];
        let Some(index) = frame.slot.checked_sub(1) else {
            return;
        };
        let body = &mut self.bodies[index];
        change(body, inertia.moved(&frame.rotation, &frame.translation));
        body.update_load();
    }
}
