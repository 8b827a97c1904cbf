//! Fit of a changed robot or reading to the data, with an offset, a gain, Coulomb and viscous friction in each joint.

mod base_turned;
mod without_sign;

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::STANDSTILL_RAD_S;
use tauscope_dynamics::{Inertia, Link, Model, rnea_rows};

use super::{Reading, Remedy, SUSPECT};
use crate::data::efforts::TrackEfforts;
use crate::data::problem::Problem;
use crate::data::same_robot::{LEAST_ROWS, STRONG};
use crate::data::track::Track;

/// Bounds of measured over required torque: gain errors of sensors and wrong bodies.
/// Physical: as `effort_scale::SURE_SCALE`.
const GAINS_OF_TORQUE: [f64; 2] = [0.5, 2.0];
/// Bounds of measured current over required torque: any scale of the same sign.
/// Physical: torque constants are positive.
const GAINS_OF_CURRENT: [f64; 2] = [0.0, f64::INFINITY];
/// Largest mass of a payload, or error of a link's mass, relative to the mass of the arm.
/// Physical: light arms carry as much as they weigh; the rest is for a URDF that is too light.
const BEARS: f64 = 4.0;
/// Ridge added to the diagonal of the normal equations, relative to their trace.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;

/// The data that every remedy is tried on.
pub(super) struct Trial<'a> {
    problem: &'a Problem,
    /// Limits of the slope of measured over required effort.
    gains: [f64; 2],
    /// Compared rows by joint.
    rows: Vec<Vec<Counted>>,
}

/// A compared row of a joint.
struct Counted {
    row: usize,
    recording: usize,
    velocity: f64,
}

/// The residual of a joint's measured effort after a model with friction and a gain.
#[derive(Debug, Clone)]
pub(super) struct Left {
    /// Sum of squares by recording, not below that of the noise.
    pub squares: Vec<f64>,
    /// Number of rows.
    pub count: f64,
    /// Sum of squares after friction alone.
    pub beside_friction: f64,
    /// Whether the joint is informative: its effort varies far above its noise.
    pub tells: bool,
}

impl Left {
    /// RMS error.
    pub fn rms(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.count).sqrt()
    }

    /// Whether the motion leaves much of an informative effort unexplained.
    pub fn is_suspect(&self) -> bool {
        self.tells && self.share() > SUSPECT
    }

    /// Returns the share of the variance after friction that is unexplained.
    pub fn share(&self) -> f64 {
        self.squares.iter().sum::<f64>() / self.beside_friction
    }
}

impl<'a> Trial<'a> {
    pub fn new(problem: &'a Problem, is_scaled: bool) -> Self {
        let gains = if is_scaled {
            GAINS_OF_TORQUE
        } else {
            GAINS_OF_CURRENT
        };
        let rows = (0..problem.joints).map(|j| counted(problem, j)).collect();
        Self {
            problem,
            gains,
            rows,
        }
    }

    /// Evaluates `of` for each track and filters the efforts into a signal.
    fn efforts(&self, mut of: impl FnMut(&Track) -> Vec<f64>) -> Vec<f64> {
        let tracks = self.problem.tracks.iter();
        let efforts: TrackEfforts = tracks.map(|track| of(&track.track)).collect();
        self.problem.signal(&efforts)
    }

    /// Computes the twin's effort, as a signal, for the positions and the gravity of a reading.
    pub fn model(&self, reading: &Reading) -> Vec<f64> {
        let mut model = self.problem.model.clone();
        if !reading.weighs {
            model.set_gravity([0.0; 3]);
        }
        let times = |all: &Vec<f64>| -> Vec<f64> {
            let pairs = || reading.place.iter().zip(&reading.position);
            let rows = all.chunks_exact(reading.place.len());
            rows.flat_map(|row| pairs().map(|(&at, factor)| row[at] * factor))
                .collect()
        };
        self.efforts(|track| {
            let [q, qd, qdd] = [&track.position, &track.velocity, &track.acceleration].map(times);
            rnea_rows(&model, &q, &qd, &qdd)
        })
    }

    /// Returns the residual of `model` by joint for the efforts of a reading. `None` for joints with hardly any row.
    pub fn left(&self, model: &[f64], reading: &Reading) -> Vec<Option<Left>> {
        let of = |joint: usize| self.left_of(joint, model, reading);
        (0..self.problem.joints).map(of).collect()
    }

    fn left_of(&self, joint: usize, model: &[f64], reading: &Reading) -> Option<Left> {
        // Its motion and its compared rows are those of the column with its position.
        let rows = &self.rows[reading.place[joint]];
        let from = self.problem.joint_rows(reading.column[joint]).start;
        let own = self.problem.joint_rows(joint).start;
        let measured = rows
            .iter()
            .map(|r| reading.effort[joint] * self.problem.measured[from + r.row]);
        let measured = DVector::from_iterator(rows.len(), measured);
        let required = rows.iter().map(|r| model[own + r.row]);
        let required = DVector::from_iterator(rows.len(), required);
        let measured = if reading.without_sign[joint] {
            measured.zip_map(&required, f64::copysign)
        } else {
            measured
        };
        let friction = friction(rows, reading.position[joint]);
        let (_, beside) = least_squares(&friction, &measured);
        let noise = self.problem.white_noise[reading.column[joint]].max(f64::MIN_POSITIVE);
        let enough = rows.len() > LEAST_ROWS;
        let strong = beside.norm_squared() > (STRONG * noise).powi(2) * rows.len() as f64;
        if !enough {
            return None;
        }
        let residual = self.residual(&friction, &measured, &required, self.is_known(joint));
        // Keeps every sum above zero, even without compared rows in a recording.
        let mut squares = vec![noise * noise; self.problem.tracks.len()];
        for (row, error) in rows.iter().zip(residual.iter()) {
            squares[row.recording] += error * error + noise * noise;
        }
        Some(Left {
            squares,
            count: rows.len() as f64,
            beside_friction: beside.norm_squared(),
            tells: strong,
        })
    }

    /// Whether the twin already contains friction of the joint, which the fit may then reduce.
    fn is_known(&self, joint: usize) -> bool {
        let mut known = self.problem.known_friction[joint].keys();
        known.any(|name| {
            tauscope_dynamics::terms::effect(name)
                .is_some_and(tauscope_dynamics::terms::Effect::is_plain_friction)
        })
    }

    /// Returns the residual after a gain within its bounds and dissipative friction. Where friction `is_known`, the
    /// correction may be negative.
    fn residual(
        &self,
        friction: &DMatrix<f64>,
        measured: &DVector<f64>,
        required: &DVector<f64>,
        is_known: bool,
    ) -> DVector<f64> {
        let [low, high] = self.gains;
        let fitted = |friction: &DMatrix<f64>| {
            let width = friction.ncols();
            let mut all = friction.clone().insert_column(width, 0.0);
            all.set_column(width, required);
            let (numbers, left) = least_squares(&all, measured);
            let gain = numbers[width].clamp(low, high);
            if (gain - numbers[width]).abs() <= f64::EPSILON {
                return (numbers, left);
            }
            least_squares(friction, &(measured - gain * required))
        };
        let (numbers, left) = fitted(friction);
        // The power of friction, averaged over the motion.
        let power = friction.column(1).dot(&friction.column(2)) * numbers[1]
            + friction.column(2).norm_squared() * numbers[2];
        if power >= 0.0 || is_known {
            return left;
        }
        let offset = friction.columns(0, 1).into_owned();
        fitted(&offset).1
    }

    /// Returns physics that may explain the whole mismatch, each with the effort of the changed robot.
    pub fn physics(&self) -> Vec<(Remedy, Vec<f64>)> {
        let all = [self.base_turned(), self.payload()];
        all.into_iter().flatten().collect()
    }

    /// Fits the coefficients of `columns` (signals), with friction in each joint, and returns them with the resulting
    /// effort of the twin.
    fn fitted(&self, start: &[f64], columns: &[Vec<f64>]) -> Option<(DVector<f64>, Vec<f64>)> {
        let p = columns.len();
        let (mut normal, mut right) = (DMatrix::zeros(p, p), DVector::zeros(p));
        for joint in 0..self.problem.joints {
            let rows = &self.rows[joint];
            let friction = friction(rows, 1.0);
            let first = self.problem.joint_rows(joint).start;
            let left = |of: &dyn Fn(usize) -> f64| {
                let values = rows.iter().map(|counted| of(first + counted.row));
                let values = DVector::from_iterator(rows.len(), values);
                least_squares(&friction, &values).1
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
        Some((factors, model))
    }

    /// Returns the mass of the best-fitting body on the tool.
    fn payload(&self) -> Option<(Remedy, Vec<f64>)> {
        let (found, loaded) = self.with_body(self.problem.model.tool_link())?;
        (found[0] > 0.0 && self.is_bearable(&found)).then_some((Remedy::Payload(found[0]), loaded))
    }

    /// Whether a body has at most [`BEARS`] times the mass of the arm in the URDF, and first moments of at most that
    /// times 1 m.
    fn is_bearable(&self, body: &DVector<f64>) -> bool {
        let arm_kg: f64 = self.problem.model.links().iter().map(Link::mass_kg).sum();
        body.rows(0, 4)
            .iter()
            .all(|moment| moment.abs() < BEARS * arm_kg)
    }

    /// Whether one link with another mass, centre or inertia than in the URDF makes all efforts torques of the
    /// motion.
    pub fn is_one_body(&self) -> bool {
        let reading = Reading::as_recorded(self.problem.joints);
        let explains = |(found, model): (DVector<f64>, Vec<f64>)| {
            let left = self.left(&model, &reading);
            self.is_bearable(&found) && !left.iter().flatten().any(Left::is_suspect)
        };
        let mut joints = self.problem.model.joints().iter();
        joints.any(|joint| self.with_body(joint.child_link).is_some_and(explains))
    }

    /// Fits the ten inertial parameters of a body on a link, and returns them with the resulting effort of the robot.
    fn with_body(&self, link: usize) -> Option<(DVector<f64>, Vec<f64>)> {
        let robot = &self.problem.model;
        let unit = |k: usize| {
            let mut parameters = [0.0; 10];
            parameters[k] = 1.0;
            let ghost: Model = robot.ghost(link, Inertia::from_parameters(parameters));
            self.efforts(|track| track.rigid_effort(&ghost, true))
        };
        let columns: Vec<Vec<f64>> = (0..10).map(unit).collect();
        self.fitted(self.problem.rigid(), &columns)
    }
}

/// Returns the compared rows of a joint.
fn counted(problem: &Problem, joint: usize) -> Vec<Counted> {
    let counted = |(recording, row, k): (usize, usize, usize)| Counted {
        row,
        recording,
        velocity: problem.tracks[recording].track.velocity[k * problem.joints + joint],
    };
    problem.counted(joint).map(counted).collect()
}

/// Returns the columns of an offset, the direction and the velocity, where positions are multiplied by `factor`.
fn friction(rows: &[Counted], factor: f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), 3, |row, column| {
        let velocity = factor * rows[row].velocity;
        match column {
            0 => 1.0,
            // At the recorded velocity, so that each reading has the same standstills.
            1 if rows[row].velocity.abs() < STANDSTILL_RAD_S => 0.0,
            1 => velocity.signum(),
            _ => velocity,
        }
    })
}

/// Least squares of `values` on `columns`: returns the coefficients and the residual.
fn least_squares(columns: &DMatrix<f64>, values: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
    let mut normal = columns.tr_mul(columns);
    for at in 0..columns.ncols() {
        normal[(at, at)] += RIDGE * normal[(at, at)] + f64::MIN_POSITIVE;
    }
    let right = columns.tr_mul(values);
    let solution = normal.cholesky().map(|c| c.solve(&right));
    let solution = solution.unwrap_or_else(|| DVector::zeros(columns.ncols()));
    let left = values - columns * &solution;
    (solution, left)
}
