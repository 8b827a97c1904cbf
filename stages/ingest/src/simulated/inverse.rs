//! Inverse kinematics: joint positions that bring a point of a link to a place.
//!
//! Levenberg and Marquardt's damped least squares on the pose error, as Sugihara (2011) and Nakamura and
//! Hanafusa (1986) propose it for arms, kept within the joints' limits: a joint at its limit is excluded
//! from a step that would exceed it.

use nalgebra::{DMatrix, DVector, Isometry3, UnitQuaternion, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::{Data, Model, forward_kinematics};

use super::link_point::LinkPoint;
use super::trajectory::JointRange;

/// Tolerance of position and orientation \[m\], \[rad\].
/// Resolution: far below the precision to which a motion is drawn.
const NEAR: f64 = 1e-6;
/// Maximum number of steps from one start.
/// Resolution: bounds the computing time of a start.
const STEPS: usize = 200;
/// Number of further, random starts for a point that must be reached.
/// Resolution: bounds the computing time; a point that is not reached by then is an error.
const OTHER_STARTS: usize = 30;
/// Weight of rotation against translation in the pose error \[m/rad\].
/// Chosen: for simulated cells only; about the length of a forearm, so that place and orientation converge together.
const METRES_PER_RADIAN: f64 = 0.3;
/// Damping of the first step.
/// Resolution: changes the number of steps.
const FIRST_DAMPING: f64 = 1e-3;
/// Largest damping; beyond it no step makes progress.
/// Resolution: ends a start that is stuck.
const LAST_DAMPING: f64 = 1e6;

/// Target of a point of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Goal {
    /// Place in the world frame \[m\].
    pub place: Vector3<f64>,
    /// Orientation of the link; `None` for any.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// Smallest pose error for a goal that the arm does not reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Missed {
    /// Distance from the place \[m\].
    pub distance_m: f64,
    /// Angle from the orientation \[rad\].
    pub angle_rad: f64,
}

impl Missed {
    fn size(&self) -> f64 {
        self.distance_m.hypot(METRES_PER_RADIAN * self.angle_rad)
    }
}

/// Inverse kinematics of a point of an arm.
#[derive(Debug)]
pub(super) struct Inverse {
    model: Model,
    data: Data,
    joints: Vec<JointRange>,
    point: LinkPoint,
}

impl Inverse {
    pub fn new(model: &Model, joints: &[JointRange], point: LinkPoint) -> Self {
        Self {
            model: model.clone(),
            data: Data::new(model),
            joints: joints.to_vec(),
            point,
        }
    }

    /// Returns the name of the link.
    pub fn link_name(&self) -> &str {
        &self.model.links()[self.point.link].name
    }

    /// Returns the pose of the point at `position`.
    pub fn pose(&mut self, position: &[f64]) -> Isometry3<f64> {
        forward_kinematics(&self.model, &mut self.data, position);
        self.point.pose(&self.model, &self.data)
    }

    /// Returns positions that reach the goal, searched from `start`, then from random positions.
    pub fn reach(&mut self, goal: &Goal, start: &JointArray) -> Result<JointArray, Missed> {
        let mut best = match self.reach_from(goal, start) {
            Ok(found) => return Ok(found),
            Err(missed) => missed,
        };
        // A fixed seed: whether a point can be reached must not depend on the scenario's seed.
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        for _ in 0..OTHER_STARTS {
            let mut other = [0.0; MAX_JOINTS];
            for (value, joint) in other.iter_mut().zip(&self.joints) {
                *value = joint.lower + (joint.upper - joint.lower) * rng.random::<f64>();
            }
            match self.reach_from(goal, &other) {
                Ok(found) => return Ok(found),
                Err(missed) if missed.size() < best.size() => best = missed,
                Err(_) => {}
            }
        }
        Err(best)
    }

    /// Returns positions that reach the goal, searched from `start` alone.
    pub fn reach_from(&mut self, goal: &Goal, start: &JointArray) -> Result<JointArray, Missed> {
        let n = self.joints.len();
        let mut position = *start;
        let mut damping = FIRST_DAMPING;
        let mut error = self.error(goal, &position[..n]);
        for _ in 0..STEPS {
            let missed = missed(&error);
            if missed.distance_m < NEAR && missed.angle_rad < NEAR {
                return Ok(position);
            }
            // The last step was accepted, so the kinematics are those of `position`.
            let mut jacobian = self.jacobian(goal);
            let downhill = jacobian.transpose() * &error;
            for (j, joint) in self.joints.iter().enumerate() {
                let held = (position[j] >= joint.upper && downhill[j] > 0.0)
                    || (position[j] <= joint.lower && downhill[j] < 0.0);
                if held {
                    jacobian.column_mut(j).fill(0.0);
                }
            }
            let square = &jacobian * jacobian.transpose();
            loop {
                let mut damped = square.clone();
                for k in 0..damped.nrows() {
                    damped[(k, k)] += damping;
                }
                let step = damped.cholesky().map(|factors| factors.solve(&error));
                let mut next = position;
                if let Some(step) = step {
                    let step = jacobian.transpose() * step;
                    for (j, joint) in self.joints.iter().enumerate() {
                        next[j] = (position[j] + step[j]).clamp(joint.lower, joint.upper);
                    }
                }
                let next_error = self.error(goal, &next[..n]);
                if next_error.norm() < error.norm() {
                    (position, error) = (next, next_error);
                    damping = (0.2 * damping).max(1e-12);
                    break;
                }
                damping *= 5.0;
                if damping > LAST_DAMPING {
                    return Err(missed);
                }
            }
        }
        Err(missed(&error))
    }

    /// Returns the pose error: the translation, followed by the rotation vector scaled to metres.
    fn error(&mut self, goal: &Goal, position: &[f64]) -> DVector<f64> {
        let pose = self.pose(position);
        let way = goal.place - pose.translation.vector;
        let Some(orientation) = goal.orientation else {
            return DVector::from_column_slice(way.as_slice());
        };
        let turn = METRES_PER_RADIAN * (orientation * pose.rotation.inverse()).scaled_axis();
        DVector::from_iterator(6, way.iter().chain(turn.iter()).copied())
    }

    fn jacobian(&mut self, goal: &Goal) -> DMatrix<f64> {
        let jacobian = self.point.jacobian(&self.model, &mut self.data);
        let rows = if goal.orientation.is_some() { 6 } else { 3 };
        DMatrix::from_fn(rows, jacobian.ncols(), |k, j| {
            let scale = if k < 3 { 1.0 } else { METRES_PER_RADIAN };
            scale * jacobian[(k, j)]
        })
    }
}

fn missed(error: &DVector<f64>) -> Missed {
    let turn = error.rows(3, error.len() - 3).norm();
    Missed {
        distance_m: error.rows(0, 3).norm(),
        angle_rad: turn / METRES_PER_RADIAN,
    }
}
