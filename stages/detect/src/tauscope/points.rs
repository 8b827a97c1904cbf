//! Where a robot may be touched.

use std::f64::consts::TAU;

use crate::frame::Setup;
use nalgebra::{Vector3, Vector6};
use tauscope_bus::{MAX_JOINTS, TwinState};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

/// Where along a link points are asked about, as shares of the way from its joint to the next; and about its centre of mass.
const ALONG: [f64; 4] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];
/// How many around it.
const AROUND: usize = 6;
/// How far from its axis: between its axis and its surface \[m\].
const RADIUS_M: f64 = 0.03;
/// A link shorter than this has no axis of its own \[m\].
const SHORT_M: f64 = 0.02;
/// Points of a link.
pub(crate) const POINTS: usize = (ALONG.len() + 1) * AROUND + 1;

/// A robot's links. No allocation per call.
#[derive(Debug)]
pub(crate) struct Points {
    robot: (Model, Data),
    /// Where the tool is touched: its link and the point in its frame.
    tool: Option<(usize, Vector3<f64>)>,
}

/// A link as it is at one sample, world frame.
pub(crate) struct LinkAt {
    /// Index into the model's links.
    pub link: usize,
    pub origin_m: Vector3<f64>,
    /// From the origin to the centre of mass and to the next joint, or to the point of the tool that is touched.
    pub com_m: Vector3<f64>,
    pub end_m: Vector3<f64>,
    /// Whether it ends at the point of the tool.
    has_tool: bool,
    /// The axis of the joint that carries it.
    axis: Vector3<f64>,
    /// How the origin moves, and how the link turns, by 1 rad/s of each joint.
    pub columns: [Vector6<f64>; MAX_JOINTS],
}

impl LinkAt {
    /// How a point moves by 1 rad/s of a joint; also what 1 N at it along the world's axes loads the joint with \[N m\].
    pub fn moved(&self, joint: usize, arm: &Vector3<f64>) -> Vector3<f64> {
        let column = &self.columns[joint];
        let angular = column.fixed_rows::<3>(3);
        column.fixed_rows::<3>(0) + angular.cross(arm)
    }

    /// Points along and around the link and at its end, from its origin \[m\], with their weights: the tool is touched where it is
    /// meant to be as often as anywhere else on the link that carries it.
    pub fn around(&self) -> impl Iterator<Item = (Vector3<f64>, f64)> + '_ {
        let axis = if self.end_m.norm() < SHORT_M {
            self.axis
        } else {
            self.end_m.normalize()
        };
        // The world's axis that is most across it.
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
    /// Of the cell's robot; nothing without a model.
    pub fn new(setup: &Setup) -> Option<Self> {
        let model = setup.model.clone()?;
        let data = Data::new(&model);
        let tool = setup.tool_link.map(|link| {
            let point = setup.contact_point_on_tool_m.unwrap_or_default();
            (link, Vector3::from(point))
        });
        Some(Self {
            robot: (model, data),
            tool,
        })
    }

    /// Calls `visit` with each joint in order and the link that it carries.
    pub fn each_link(&mut self, sample: &TwinState, mut visit: impl FnMut(usize, &LinkAt)) {
        let (model, data) = &mut self.robot;
        let n = model.dof().min(MAX_JOINTS);
        forward_kinematics(model, data, &sample.position[..n]);
        for joint in 0..n {
            let link = model.joints()[joint].child_link;
            let pose = link_pose(model, data, link);
            let origin_m = pose.translation.vector;
            let com_m = pose.rotation * Vector3::from(model.links()[link].com_m());
            let end = if joint + 1 < n {
                let next = model.joints()[joint + 1].child_link;
                link_pose(model, data, next).translation.vector
            } else if let Some((tool, point)) = self.tool {
                let tool = link_pose(model, data, tool);
                tool.translation.vector + tool.rotation * point
            } else {
                origin_m + com_m
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
                    has_tool: joint + 1 == n && self.tool.is_some(),
                    // A joint that slides has none; then any will do.
                    axis: turn.try_normalize(1e-9).unwrap_or_else(Vector3::z),
                    columns,
                },
            );
        }
    }

    /// The name of a link.
    pub fn link_name(&self, link: usize) -> &str {
        &self.robot.0.links()[link].name
    }
}
