//! The fit of a robot to the data after a change, beside offset, Coulomb and viscous friction in each joint.

use nalgebra::{DMatrix, DVector, Vector3};
use tauscope_dynamics::{Data, Inertia, Model, gravity_effort, rnea};

use crate::data::efforts::TrackEfforts;
use crate::data::problem::Problem;
use crate::data::track::Track;
use crate::read::audit::MOVES;

/// Gravity after a turn of the base is as strong as before, up to this share: bodies in the URDF may be wrong by so much.
/// Physical: masses of published URDFs are within a tenth of the real ones.
const SAME_GRAVITY: f64 = 0.1;
/// A base that is turned by less is found by the search as a tilt \[rad\].
/// Physical: beyond it a sine is no longer near its angle.
const TURNED_RAD: f64 = 0.5;
/// A joint is compared if its effort varies by at least this many times the noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const STRONG: f64 = 5.0;
/// Added to the diagonal of the normal equations, as a share of their trace.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;

/// The data that every remedy is tried on.
pub(super) struct Trial<'a> {
    problem: &'a Problem,
    /// The twin's effort as a signal.
    pub own: Vec<f64>,
}

/// A joint's rows that count: 1, direction, speed.
type Friction = Vec<[f64; 3]>;

impl<'a> Trial<'a> {
    pub fn new(problem: &'a Problem) -> Self {
        Self {
            problem,
            own: problem.rigid().to_vec(),
        }
    }

    /// The efforts of `model` over the motion that `track` gives.
    fn efforts(&self, mut of: impl FnMut(&Track) -> Vec<f64>) -> Vec<f64> {
        let tracks = self.problem.tracks.iter();
        let efforts: TrackEfforts = tracks.map(|track| of(&track.track)).collect();
        self.problem.signal(&efforts)
    }

    /// The twin's effort where the position of each joint that turns is multiplied by `factor`.
    pub fn moved(&self, factor: impl Fn(usize) -> f64) -> Vec<f64> {
        let model = &self.problem.model;
        let mut data = Data::new(model);
        let slides = tauscope_dynamics::JointKind::Prismatic;
        let factor: Vec<f64> = (model.joints().iter().enumerate())
            .map(|(j, joint)| {
                let factor = factor(j);
                if joint.kind == slides {
                    factor.signum()
                } else {
                    factor
                }
            })
            .collect();
        let times = |all: &[f64]| -> Vec<f64> {
            all.iter()
                .zip(&factor)
                .map(|(x, factor)| x * factor)
                .collect()
        };
        self.efforts(|track| {
            let mut effort = Vec::with_capacity(track.position.len());
            track.each(|_, at| {
                let [q, qd, qdd] = [at.position, at.velocity, at.acceleration].map(times);
                effort.extend_from_slice(rnea(model, &mut data, &q, &qd, &qdd));
            });
            effort
        })
    }

    /// The rows of a joint that count, and its friction there.
    fn rows(&self, joint: usize) -> (Vec<usize>, Friction) {
        let first = self.problem.joint_rows(joint).start;
        let (mut rows, mut friction) = (Vec::new(), Vec::new());
        for track in &self.problem.tracks {
            for (row, &k) in track.rows().zip(&track.compared) {
                if self.problem.weight[first + row] > 0.0 {
                    let velocity = track.track.velocity[k * self.problem.joints + joint];
                    let sign = if velocity.abs() < MOVES {
                        0.0
                    } else {
                        velocity.signum()
                    };
                    rows.push(row);
                    friction.push([1.0, sign, velocity]);
                }
            }
        }
        (rows, friction)
    }

    /// By joint, the share of the measured variance beside friction that `model` leaves. A joint's measured effort is
    /// that of the channel, times the sign, that `channel` gives. Joints with hardly any effort are left out.
    pub fn left(&self, model: &[f64], channel: impl Fn(usize) -> (usize, f64)) -> Vec<f64> {
        let mut all = Vec::new();
        for joint in 0..self.problem.joints {
            let (rows, friction) = self.rows(joint);
            let (from, sign) = channel(joint);
            let first = self.problem.joint_rows(from).start;
            let own = self.problem.joint_rows(joint).start;
            let measured: Vec<f64> = (rows.iter())
                .map(|row| sign * self.problem.measured[first + row])
                .collect();
            let without: Vec<f64> = (rows.iter().zip(&measured))
                .map(|(row, measured)| measured - model[own + row])
                .collect();
            let (before, after) = (beside(&friction, &measured), beside(&friction, &without));
            let noise = STRONG * self.problem.white_noise[from];
            if rows.len() > 3 && before > noise * noise * rows.len() as f64 {
                all.push(after / before);
            }
        }
        all
    }

    /// The factors of `columns` (signals) beside friction that make the twin's effort fit best, and what is then left.
    fn fitted(&self, start: &[f64], columns: &[Vec<f64>]) -> Option<(DVector<f64>, Vec<f64>)> {
        let p = columns.len();
        let (mut normal, mut right) = (DMatrix::zeros(p, p), DVector::zeros(p));
        for joint in 0..self.problem.joints {
            let (rows, friction) = self.rows(joint);
            let first = self.problem.joint_rows(joint).start;
            let left = |of: &dyn Fn(usize) -> f64| {
                let values: Vec<f64> = rows.iter().map(|row| of(first + row)).collect();
                residual(&friction, &values)
            };
            let y = left(&|at| self.problem.measured[at] - start[at]);
            let x: Vec<DVector<f64>> = columns.iter().map(|c| left(&|at| c[at])).collect();
            let noise = self.problem.white_noise[joint].max(1e-9);
            for a in 0..p {
                right[a] += x[a].dot(&y) / (noise * noise);
                for b in 0..p {
                    normal[(a, b)] += x[a].dot(&x[b]) / (noise * noise);
                }
            }
        }
        let ridge = RIDGE * normal.trace() / p as f64;
        for a in 0..p {
            normal[(a, a)] += ridge;
        }
        let factors = normal.cholesky()?.solve(&right);
        let mut model = start.to_vec();
        for (factor, column) in factors.iter().zip(columns) {
            for (model, column) in model.iter_mut().zip(column) {
                *model += factor * column;
            }
        }
        let left = self.left(&model, |j| (j, 1.0));
        Some((factors, left))
    }

    /// Roll and pitch of the base that fit best, if gravity is then as strong as before.
    pub fn base_turned(&self) -> Option<([f64; 2], Vec<f64>)> {
        let model = &self.problem.model;
        let along = |axis: usize| {
            let mut gravity = [0.0; 3];
            gravity[axis] = 1.0;
            self.against_gravity(gravity)
        };
        let columns: Vec<Vec<f64>> = (0..3).map(along).collect();
        let mut weightless = self.own.clone();
        for (weightless, weight) in weightless
            .iter_mut()
            .zip(self.against_gravity(model.gravity()))
        {
            *weightless -= weight;
        }
        let (found, left) = self.fitted(&weightless, &columns)?;
        let found = Vector3::new(found[0], found[1], found[2]);
        let was = Vector3::from(model.gravity());
        let same = (found.norm() / was.norm() - 1.0).abs() < SAME_GRAVITY;
        let upright = was.x == 0.0 && was.y == 0.0;
        let turned = found.angle(&was) > TURNED_RAD;
        (same && upright && turned).then(|| (turn_to(&found), left))
    }

    fn against_gravity(&self, gravity: [f64; 3]) -> Vec<f64> {
        let mut model = self.problem.model.clone();
        model.set_gravity(gravity);
        let mut data = Data::new(&model);
        self.efforts(|track| {
            let mut effort = Vec::with_capacity(track.position.len());
            track.each(|_, at| {
                effort.extend_from_slice(gravity_effort(&model, &mut data, at.position));
            });
            effort
        })
    }

    /// Mass of the body on the tool that fits best.
    pub fn payload(&self) -> Option<(f64, Vec<f64>)> {
        let robot = &self.problem.model;
        let unit = |k: usize| {
            let mut parameters = [0.0; 10];
            parameters[k] = 1.0;
            let ghost: Model = robot.ghost(robot.tool_link(), Inertia::from_parameters(parameters));
            let mut data = Data::new(&ghost);
            self.efforts(|track| {
                let mut effort = Vec::with_capacity(track.position.len());
                track.each(|_, at| {
                    let of = rnea(&ghost, &mut data, at.position, at.velocity, at.acceleration);
                    effort.extend_from_slice(of);
                });
                effort
            })
        };
        let columns: Vec<Vec<f64>> = (0..10).map(unit).collect();
        let (found, left) = self.fitted(&self.own, &columns)?;
        (found[0] > 0.0).then_some((found[0], left))
    }
}

/// What friction leaves of `values`.
fn residual(friction: &[[f64; 3]], values: &[f64]) -> DVector<f64> {
    let x = DMatrix::from_fn(values.len(), 3, |a, b| friction[a][b]);
    let y = DVector::from_column_slice(values);
    let mut normal = x.transpose() * &x;
    let ridge = RIDGE * normal.trace() + f64::MIN_POSITIVE;
    for a in 0..3 {
        normal[(a, a)] += ridge;
    }
    let solution = normal.cholesky().map(|c| c.solve(&(x.transpose() * &y)));
    solution.map_or(y.clone(), |solution| y - x * solution)
}

/// The same as a sum of squares.
fn beside(friction: &[[f64; 3]], values: &[f64]) -> f64 {
    residual(friction, values).norm_squared()
}

/// Roll and pitch of a base that sees gravity so, with a pitch of a quarter turn at most.
fn turn_to(gravity: &Vector3<f64>) -> [f64; 2] {
    let down = gravity.normalize();
    let sin_roll = (-down.y).clamp(-1.0, 1.0);
    let upside_down = if down.z > 0.0 { -1.0 } else { 1.0 };
    let cos_roll = upside_down * (1.0 - sin_roll * sin_roll).sqrt();
    let pitch = (upside_down * down.x).atan2((upside_down * -down.z).max(0.0));
    [sin_roll.atan2(cos_roll), pitch]
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn a_turn_is_told_by_the_gravity_that_the_base_sees() {
        for (roll, pitch) in [(0.7, 0.2), (-1.2, -0.9), (2.5, 0.4), (3.1, -1.0)] {
            let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), roll)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
            let seen = turn.inverse_transform_vector(&Vector3::new(0.0, 0.0, -9.81));
            let [told_roll, told_pitch] = turn_to(&seen);
            assert!((told_roll - roll).abs() < 1e-9 && (told_pitch - pitch).abs() < 1e-9);
        }
    }
}
