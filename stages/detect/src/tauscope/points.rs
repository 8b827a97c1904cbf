//! Points at which a robot may be touched.

use std::f64::consts::TAU;

use nalgebra::{Vector3, Vector6};
use tauscope_bus::{MAX_JOINTS, TwinState};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

use crate::frame::{JointSetup, Setup};

/// Positions of the evaluated points along a link, as shares of the way from its joint to the next one. Further
/// points are around its centre of mass.
/// Chosen: a third of a link of 0.3 m is the width of a hand. Fewer points miss the point of contact, more need
/// proportionally more computing time.
const ALONG: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];
/// Number of points around the link at each position.
/// Chosen: neighbouring points are 3 cm apart, less than the width of a hand. Fewer points lose the side of the link,
/// more need proportionally more computing time.
const AROUND: usize = 6;
/// Distance of these points from the link's axis: between axis and surface \[m\].
/// Physical: half the radius of an arm's links, which are 0.1 to 0.15 m thick.
const RADIUS_M: f64 = 0.03;
/// Length below which a link has no axis of its own \[m\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SHORT_M: f64 = 0.02;
/// Number of points of a link.
pub(crate) const POINTS: usize = (ALONG.len() + 1) * AROUND + 1;

/// Links of a robot, from its kinematic tree. No allocation per call.
///
/// A link is evaluated only if the effort of its own joint gives a torque. No residual distinguishes another link,
/// such as a gripper's finger, from the link that carries it.
#[derive(Debug)]
pub(crate) struct Points {
    robot: (Model, Data),
    /// Joints whose links are evaluated, with the ends of these links.
    ends: Vec<(usize, End)>,
    /// The one of these joints that carries the tool.
    tool_joint: Option<usize>,
}

/// End of a link.
#[derive(Debug, Clone, Copy)]
enum End {
    /// The joint that carries this next link.
    NextLink(usize),
    /// The contact point of the tool: the tool's link, and the point in its frame.
    Tool(usize, Vector3<f64>),
    /// Unknown; the centre of mass is used instead.
    CentreOfMass,
}

/// Iterates over the movable joints between `joint` and the base, the one next to `joint` first.
fn towards_base(model: &Model, joint: usize) -> impl Iterator<Item = usize> + '_ {
    let above = |joint: usize| model.links()[model.joints()[joint].parent_link].joint;
    std::iter::successors(above(joint), move |&joint| above(joint))
}

/// Returns the child of `joint` that carries most joints; `None` if there is no child, or several of them carry
/// equally many.
fn next_joint(model: &Model, joint: usize) -> Option<usize> {
    let above = |other: usize, joint: usize| towards_base(model, other).any(|j| j == joint);
    let carried = |by: usize| (0..model.dof()).filter(|&other| above(other, by)).count();
    let is_next = |other: &usize| towards_base(model, *other).next() == Some(joint);
    let next: Vec<usize> = (0..model.dof()).filter(is_next).collect();
    let most = next.iter().map(|&next| carried(next)).max()?;
    let mut longest = next.into_iter().filter(|&next| carried(next) == most);
    longest.next().filter(|_| longest.next().is_none())
}

/// Pose and motion of a link at one sample, in the world frame.
pub(crate) struct LinkAt {
    /// Index into the model's links.
    pub link: usize,
    pub origin_m: Vector3<f64>,
    /// Vectors from the origin to the centre of mass, and to the next joint or the contact point of the tool.
    pub com_m: Vector3<f64>,
    pub end_m: Vector3<f64>,
    /// Whether it ends at the contact point of the tool.
    has_tool: bool,
    /// Axis of the joint that carries it.
    axis: Vector3<f64>,
    /// Jacobian by joint: linear velocity of the origin and angular velocity of the link at 1 rad/s of the joint.
    pub columns: [Vector6<f64>; MAX_JOINTS],
}

impl LinkAt {
    /// Returns the velocity of a point at 1 rad/s of a joint. It equals the torque on the joint from 1 N at the point
    /// along each world axis \[N m\].
    pub fn moved(&self, joint: usize, arm: &Vector3<f64>) -> Vector3<f64> {
        let column = &self.columns[joint];
        let angular = column.fixed_rows::<3>(3);
        column.fixed_rows::<3>(0) + angular.cross(arm)
    }

    /// Returns points along and around the link and at its end, from its origin \[m\], with their weights. The
    /// contact point of the tool weighs as much as all other points of the link that carries the tool.
    pub fn around(&self) -> impl Iterator<Item = (Vector3<f64>, f64)> + '_ {
        let axis = if self.end_m.norm() < SHORT_M {
            self.axis
        } else {
            self.end_m.normalize()
        };
        // The world axis that is most nearly perpendicular to it.
        let least = axis.map(f64::abs).imin();
        let across = axis.cross(&Vector3::ith(least, 1.0)).normalize();
        let other = axis.cross(&across);
        let middles = ALONG.map(|share| self.end_m * share);
        let end = if self.has_tool {
            (POINTS - 1) as f64
        } else {
            1.0
        };
        middles
            .into_iter()
            .chain([self.com_m])
            .flat_map(move |middle| {
                (0..AROUND).map(move |k| {
                    let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
                    middle + (across * cos + other * sin) * RADIUS_M
                })
            })
            .map(|arm| (arm, 1.0))
            .chain([(self.end_m, end)])
    }
}

impl Points {
    /// Creates the points of the cell's robot; `None` without a model.
    pub fn new(setup: &Setup) -> Option<Self> {
        let model = setup.model.clone()?;
        let tells = |joint: usize| {
            setup
                .joints
                .get(joint)
                .is_some_and(JointSetup::tells_torque)
        };
        let carrier = |link: usize| {
            let joint = model.links()[link].joint?;
            std::iter::once(joint)
                .chain(towards_base(&model, joint))
                .find(|&joint| tells(joint))
        };
        let tool = setup.tool_link.unwrap_or_else(|| model.tool_link());
        let tool_joint = carrier(tool);
        let end = |joint: usize| {
            let on_the_way =
                |&next: &usize| towards_base(&model, next).any(|j| j == joint) && tells(next);
            let towards_tool = tool_joint
                .into_iter()
                .flat_map(|tool| std::iter::once(tool).chain(towards_base(&model, tool)));
            // The joint next to this one comes last on the way from the tool to the base.
            if let Some(next) = towards_tool.filter(on_the_way).last() {
                return End::NextLink(model.joints()[next].child_link);
            }
            if tool_joint == Some(joint) {
                let point = setup.contact_point_on_tool_m.unwrap_or_default();
                return match setup.tool_link {
                    Some(link) => End::Tool(link, point.into()),
                    None => End::CentreOfMass,
                };
            }
            next_joint(&model, joint).map_or(End::CentreOfMass, |next| {
                End::NextLink(model.joints()[next].child_link)
            })
        };
        let asked = (0..model.dof().min(MAX_JOINTS)).filter(|&joint| tells(joint));
        let ends = asked.map(|joint| (joint, end(joint))).collect();
        let data = Data::new(&model);
        Some(Self {
            robot: (model, data),
            ends,
            tool_joint,
        })
    }

    /// Returns the joint that carries the tool, among those whose effort gives a torque.
    pub fn tool_joint(&self) -> Option<usize> {
        self.tool_joint
    }

    /// Calls `visit` with each joint whose effort gives a torque, and the link that it carries.
    pub fn each_link(&mut self, sample: &TwinState, mut visit: impl FnMut(usize, &LinkAt)) {
        let (model, data) = &mut self.robot;
        let n = model.dof().min(MAX_JOINTS);
        forward_kinematics(model, data, &sample.position[..n]);
        for &(joint, end) in &self.ends {
            let link = model.body_link(joint);
            let pose = link_pose(model, data, link);
            let origin_m = pose.translation.vector;
            let com_m = pose.rotation * Vector3::from(model.links()[link].com_m());
            let has_tool = matches!(end, End::Tool(..));
            let end = match end {
                End::NextLink(next) => link_pose(model, data, next).translation.vector,
                End::Tool(tool, point) => {
                    let tool = link_pose(model, data, tool);
                    tool.translation.vector + tool.rotation * point
                }
                End::CentreOfMass => origin_m + com_m,
            };
            let jacobian = link_jacobian(model, data, link);
            let mut columns = [Vector6::zeros(); MAX_JOINTS];
            for (j, column) in columns.iter_mut().enumerate().take(n) {
                *column = jacobian.column(j).fixed_rows::<6>(0).into_owned();
            }
            let turn = columns[joint].fixed_rows::<3>(3).into_owned();
            visit(
                joint,
                &LinkAt {
                    link,
                    origin_m,
                    com_m,
                    end_m: end - origin_m,
                    has_tool,
                    // A prismatic joint has no axis of rotation: any axis will do.
                    axis: turn.try_normalize(1e-9).unwrap_or_else(Vector3::z),
                    columns,
                },
            );
        }
    }

    /// Returns the name of a link.
    pub fn link_name(&self, link: usize) -> &str {
        &self.robot.0.links()[link].name
    }
}
