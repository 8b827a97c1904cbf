//! Which link was touched, where, and how hard: the force that explains the whitened residual best.

use nalgebra::{Matrix3, Vector3};
use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

use super::windows::Windows;
use crate::isolation::Contact;
use crate::stage::Setup;

/// A joint counts as loaded from this many times its usual residual on.
const LOADED: f64 = 4.0;
/// Weight of a small force against a good fit, relative to what the joints tell: keeps directions that no
/// joint feels at zero.
const DAMPING: f64 = 1e-3;
/// The twin is believed to this share of the residual: a strong force is told no better than that.
const MODEL_ERROR: f64 = 0.05;
/// Where along a link contacts are sought, as shares of the way from its joint to the next.
const ALONG: [f64; 3] = [0.0, 0.5, 1.0];

/// A contact, and how the point moves that it acts on. World frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Touch {
    pub contact: Contact,
    pub velocity_m_per_s: Vector3<f64>,
}

/// Finds contacts on one robot. No allocation per call.
#[derive(Debug)]
pub(crate) struct Place {
    model: Option<(Model, Data)>,
    effort_per_nm: Vec<f64>,
    /// Where the tool is touched: its link and the point in its frame.
    tool: Option<(usize, Vector3<f64>)>,
}

impl Place {
    pub fn new(setup: &Setup) -> Self {
        let known = setup
            .joints
            .iter()
            .all(|joint| joint.effort_per_nm.is_finite());
        Self {
            model: setup.model.clone().filter(|_| known).map(|model| {
                let data = Data::new(&model);
                (model, data)
            }),
            effort_per_nm: setup
                .joints
                .iter()
                .map(|joint| joint.effort_per_nm)
                .collect(),
            tool: setup.tool_link.map(|link| {
                let point = setup.contact_point_on_tool_m.unwrap_or_default();
                (link, Vector3::from(point))
            }),
        }
    }

    /// The joints that are loaded: bit j for joint j.
    pub fn loaded(windows: &Windows) -> u32 {
        let w = windows.most;
        (0..windows.joints())
            .filter(|&j| windows.excess(w, j).abs() > LOADED * windows.noise(w, j))
            .fold(0, |mask, j| mask | 1 << j)
    }

    /// The contact that leaves least unexplained; its point moves as the joints' `velocity` \[rad/s\] has it.
    pub fn locate(
        &mut self,
        sample: &TwinState,
        windows: &Windows,
        velocity: &JointArray,
    ) -> Option<Touch> {
        let n = windows.joints();
        let w = windows.most;
        let inverse = windows.inverse_correlation(w);
        let (mut z, mut scale) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in 0..n {
            let mean = windows.excess(w, j);
            let noise = windows.noise(w, j).hypot(MODEL_ERROR * mean);
            z[j] = mean / noise;
            scale[j] = self.effort_per_nm[j] / noise;
        }
        let weighted_z: [f64; MAX_JOINTS] = std::array::from_fn(|a| {
            let row = inverse.iter().skip(a * n).take(n);
            row.zip(&z).map(|(weight, z)| weight * z).sum()
        });
        let mut best: Option<(f64, Touch)> = None;
        self.each_point(sample, n, |link, point_m, columns| {
            let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
            for a in 0..n {
                // A force on a link loads only the joints between it and the base.
                if columns[a] == Vector3::zeros() {
                    continue;
                }
                // residual = -Jᵀ F, in units of the noise.
                let row = columns[a] * -scale[a];
                let mut weighted = Vector3::zeros();
                for b in 0..n {
                    weighted += columns[b] * (-scale[b] * inverse[a * n + b]);
                }
                information += row * weighted.transpose();
                pull += row * weighted_z[a];
            }
            let ridge = DAMPING * information.trace() + 1e-12;
            let Some(solver) = (information + Matrix3::identity() * ridge).try_inverse() else {
                return;
            };
            let force = solver * pull;
            let explained = 2.0 * pull.dot(&force) - force.dot(&(information * force));
            if best.is_none_or(|(most, _)| explained > most) {
                let moved = columns.iter().zip(velocity).take(n);
                let touch = Touch {
                    contact: Contact {
                        link,
                        force_n: force.into(),
                        point_m: point_m.into(),
                    },
                    velocity_m_per_s: moved.map(|(column, rate)| column * *rate).sum(),
                };
                best = Some((explained, touch));
            }
        });
        best.map(|(_, touch)| touch)
    }

    /// Calls `visit` with points of each link, in order: the link, where the point is \[m\], and what 1 N at it along
    /// the world's axes loads each joint with \[N m\]. Nothing without a model.
    pub fn each_point(
        &mut self,
        sample: &TwinState,
        n: usize,
        mut visit: impl FnMut(usize, Vector3<f64>, &[Vector3<f64>; MAX_JOINTS]),
    ) {
        let Some((model, data)) = self.model.as_mut() else {
            return;
        };
        forward_kinematics(model, data, &sample.position[..n]);
        for joint in 0..n {
            let link = model.joints()[joint].child_link;
            let pose = link_pose(model, data, link);
            let origin = pose.translation.vector;
            let com = pose.rotation * Vector3::from(model.links()[link].com_m());
            let end = if joint + 1 < n {
                let next = model.joints()[joint + 1].child_link;
                link_pose(model, data, next).translation.vector
            } else if let Some((tool, point)) = self.tool {
                let tool = link_pose(model, data, tool);
                tool.translation.vector + tool.rotation * point
            } else {
                origin + com
            };
            let jacobian = link_jacobian(model, data, link);
            let along = ALONG.map(|share| (end - origin) * share);
            for arm in along.into_iter().chain([com]) {
                let mut columns = [Vector3::zeros(); MAX_JOINTS];
                for (j, column) in columns.iter_mut().enumerate().take(n) {
                    let of_joint = jacobian.column(j);
                    let angular = of_joint.fixed_rows::<3>(3).into_owned();
                    *column = of_joint.fixed_rows::<3>(0) + angular.cross(&arm);
                }
                visit(link, origin + arm, &columns);
            }
        }
    }

    /// By joint, how much the measured effort changes by 1 N m \[effort unit\].
    pub fn effort_per_nm(&self) -> &[f64] {
        &self.effort_per_nm
    }

    /// The name of a link.
    pub fn link_name(&self, link: usize) -> &str {
        self.model
            .as_ref()
            .map_or("", |(model, _)| model.links()[link].name.as_str())
    }
}
