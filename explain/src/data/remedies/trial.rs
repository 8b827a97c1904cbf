//! The fit of a robot to the data after a change, beside offset, gain, Coulomb and viscous friction in each joint.

mod base_turned;
mod without_sign;

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::{Data, Inertia, Link, Model, rnea};

use super::{Reading, Remedy, SUSPECT};
use crate::data::efforts::TrackEfforts;
use crate::data::problem::Problem;
use crate::data::track::STANDSTILL_RAD_S;
use crate::data::track::Track;

/// A joint tells if its effort varies by at least this many times the noise, and is compared with this many rows.
/// Tuned: by hand, on no recorded seeds; not swept.
const STRONG: f64 = 5.0;
const LEAST_ROWS: usize = 20;
/// A measured torque is between these times the required one: gain errors of sensors and wrong bodies.
/// Physical: as `effort_scale::SURE_SCALE`.
const GAINS_OF_TORQUE: [f64; 2] = [0.5, 2.0];
/// A current may be any share of the torque, of the same sign.
/// Physical: torque constants are positive.
const GAINS_OF_CURRENT: [f64; 2] = [0.0, f64::INFINITY];
/// No arm carries more than this many times its own mass, and no link is wrong by more.
/// Physical: light arms carry as much as they weigh; the rest is for a URDF that is too light.
const BEARS: f64 = 4.0;
/// Added to the diagonal of the normal equations, as a share of their trace.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;

/// The data that every remedy is tried on.
pub(super) struct Trial<'a> {
    problem: &'a Problem,
    /// Limits of the slope of measured over required effort.
    gains: [f64; 2],
    /// By joint, the rows that count.
    rows: Vec<Vec<Counted>>,
}

/// A row of a joint that counts.
struct Counted {
    row: usize,
    recording: usize,
    velocity: f64,
}

/// What a model leaves of a joint's measured effort, beside friction and a gain.
#[derive(Debug, Clone)]
pub(super) struct Left {
    /// Sum of squares by recording, no less than that of the noise.
    pub squares: Vec<f64>,
    /// Rows.
    pub count: f64,
    /// Sum of squares that friction alone leaves.
    pub beside_friction: f64,
    /// Whether the effort varies far above its noise: only then the joint says what is wrong.
    pub tells: bool,
}

impl Left {
    /// RMS error.
    pub fn rms(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.count).sqrt()
    }

    /// Whether the motion leaves much of an effort that tells.
    pub fn is_suspect(&self) -> bool {
        self.tells && self.share() > SUSPECT
    }

    /// Share of the variance beside friction that is left.
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

    /// The efforts over the motion that `of` gives for each track, as a signal.
    fn efforts(&self, mut of: impl FnMut(&Track) -> Vec<f64>) -> Vec<f64> {
        let tracks = self.problem.tracks.iter();
        let efforts: TrackEfforts = tracks.map(|track| of(&track.track)).collect();
        self.problem.signal(&efforts)
    }

    /// The twin's effort, as a signal, for the positions and the gravity of a reading.
    pub fn model(&self, reading: &Reading) -> Vec<f64> {
        let mut model = self.problem.model.clone();
        if !reading.weighs {
            model.set_gravity([0.0; 3]);
        }
        let mut data = Data::new(&model);
        let times = |all: &[f64]| -> Vec<f64> {
            let pairs = reading.place.iter().zip(&reading.position);
            pairs.map(|(&at, factor)| all[at] * factor).collect()
        };
        self.efforts(|track| {
            let mut effort = Vec::with_capacity(track.position.len());
            track.each(|_, at| {
                let [q, qd, qdd] = [at.position, at.velocity, at.acceleration].map(times);
                effort.extend_from_slice(rnea(&model, &mut data, &q, &qd, &qdd));
            });
            effort
        })
    }

    /// By joint, what `model` leaves of the effort that a reading takes for its. Nothing for joints with hardly any row.
    pub fn left(&self, model: &[f64], reading: &Reading) -> Vec<Option<Left>> {
        let of = |joint: usize| self.left_of(joint, model, reading);
        (0..self.problem.joints).map(of).collect()
    }

    fn left_of(&self, joint: usize, model: &[f64], reading: &Reading) -> Option<Left> {
        // Its motion, and the rows that count by it, stand where its position does.
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
        // No sum is zero, not even where a recording has no row that counts.
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

    /// Whether the twin has friction of the joint already: there may be less of it.
    fn is_known(&self, joint: usize) -> bool {
        let mut known = self.problem.known_friction[joint].keys();
        known.any(|name| {
            tauscope_dynamics::terms::effect(name)
                .is_some_and(tauscope_dynamics::terms::Effect::is_plain_friction)
        })
    }

    /// What a gain within its limits and friction that takes power leave. What is known of the friction may be too much.
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
        // Averaged over the motion.
        let power = friction.column(1).dot(&friction.column(2)) * numbers[1]
            + friction.column(2).norm_squared() * numbers[2];
        if power >= 0.0 || is_known {
            return left;
        }
        let offset = friction.columns(0, 1).into_owned();
        fitted(&offset).1
    }

    /// Physics that may be behind all that does not match, with the effort that the robot then needs.
    pub fn physics(&self) -> Vec<(Remedy, Vec<f64>)> {
        let all = [self.base_turned(), self.payload()];
        all.into_iter().flatten().collect()
    }

    /// The factors of `columns` (signals) beside friction that make the twin's effort fit best, and that effort.
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

    /// Mass of the body on the tool that fits best.
    fn payload(&self) -> Option<(Remedy, Vec<f64>)> {
        let (found, loaded) = self.with_body(self.problem.model.tool_link())?;
        (found[0] > 0.0 && self.is_bearable(&found)).then_some((Remedy::Payload(found[0]), loaded))
    }

    /// Whether a body is no heavier than [`BEARS`] times the arm by its URDF, and no further out than a metre.
    fn is_bearable(&self, body: &DVector<f64>) -> bool {
        let arm_kg: f64 = self.problem.model.links().iter().map(Link::mass_kg).sum();
        body.rows(0, 4)
            .iter()
            .all(|moment| moment.abs() < BEARS * arm_kg)
    }

    /// Whether one link of another mass, centre or inertia than in the URDF makes all efforts torques of the motion.
    pub fn is_one_body(&self) -> bool {
        let reading = Reading::as_recorded(self.problem.joints);
        let explains = |(found, model): (DVector<f64>, Vec<f64>)| {
            let left = self.left(&model, &reading);
            self.is_bearable(&found) && !left.iter().flatten().any(Left::is_suspect)
        };
        let mut joints = self.problem.model.joints().iter();
        joints.any(|joint| self.with_body(joint.child_link).is_some_and(explains))
    }

    /// The ten parameters of a body on a link that fit best, and the effort that the robot then needs.
    fn with_body(&self, link: usize) -> Option<(DVector<f64>, Vec<f64>)> {
        let robot = &self.problem.model;
        let unit = |k: usize| {
            let mut parameters = [0.0; 10];
            parameters[k] = 1.0;
            let ghost: Model = robot.ghost(link, Inertia::from_parameters(parameters));
            let mut data = Data::new(&ghost);
            self.efforts(|track| {
                let mut effort = Vec::with_capacity(track.position.len());
                track.each(|_, at| {
                    let [q, qd, qdd] = [at.position, at.velocity, at.acceleration];
                    effort.extend_from_slice(rnea(&ghost, &mut data, q, qd, qdd));
                });
                effort
            })
        };
        let columns: Vec<Vec<f64>> = (0..10).map(unit).collect();
        self.fitted(self.problem.rigid(), &columns)
    }
}

/// The rows of a joint that count.
fn counted(problem: &Problem, joint: usize) -> Vec<Counted> {
    let counted = |(recording, row, k): (usize, usize, usize)| Counted {
        row,
        recording,
        velocity: problem.tracks[recording].track.velocity[k * problem.joints + joint],
    };
    problem.counted(joint).map(counted).collect()
}

/// Columns of an offset, the direction and the speed, where positions are multiplied by `factor`.
fn friction(rows: &[Counted], factor: f64) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), 3, |row, column| {
        let velocity = factor * rows[row].velocity;
        match column {
            0 => 1.0,
            // As recorded, so that each reading has the same standstills.
            1 if rows[row].velocity.abs() < STANDSTILL_RAD_S => 0.0,
            1 => velocity.signum(),
            _ => velocity,
        }
    })
}

/// Least squares of `values` on `columns`: the numbers, and what is left.
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
