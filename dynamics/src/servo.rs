//! Controllers of joints: PID with feedforward, and their gains from what they did.

use nalgebra::{DMatrix, DVector};

use crate::data::Data;
use crate::model::Model;
use crate::rnea::rnea;

/// Effort that a controller adds from its model of the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Feedforward {
    /// That of gravity in the measured position.
    #[default]
    Gravity,
    /// That of the commanded motion: its inverse dynamics.
    Motion,
}

/// Gains of a joint's controller. Its effort is `position` e + `integral` ∫e dt + `velocity` (s ċ - q̇) + `share` f + `offset`,
/// for the commanded position c, its error e = c - q and the feedforward f (Siciliano et al., *Robotics*, 2009, sections
/// 8.5 and 8.6).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Servo {
    /// Gain of the position's error \[N m/rad or N/m\].
    pub position: f64,
    /// Gain of its integral \[N m/(rad s) or N/(m s)\].
    pub integral: f64,
    /// Gain of the velocity \[N m s/rad or N s/m\].
    pub velocity: f64,
    /// Share s of the commanded velocity that is subtracted from the measured one: 1 or 0.
    pub commanded_velocity: f64,
    /// Kind of feedforward.
    pub feedforward: Feedforward,
    /// Share of the feedforward that is added.
    pub share: f64,
    /// Constant effort \[N m or N\].
    pub offset: f64,
}

/// Commanded positions over time, and the effort that they require of the controller's model.
#[derive(Debug, Clone)]
pub struct Commands<'a> {
    pub(crate) time_s: &'a [f64],
    position: &'a [f64],
    velocity: Vec<f64>,
    effort: Vec<f64>,
}

impl<'a> Commands<'a> {
    /// Commands as rows of `position` \[rad or m\], a number per joint, at increasing times \[s\].
    ///
    /// # Panics
    /// If there are fewer than two times, or `position` has another number of rows.
    pub fn new(model: &Model, time_s: &'a [f64], position: &'a [f64]) -> Self {
        let n = model.dof();
        assert!(
            time_s.len() > 1 && position.len() == n * time_s.len(),
            "a row of positions at each of two times or more"
        );
        let velocity = derivative(time_s, position, n);
        let acceleration = derivative(time_s, &velocity, n);
        let mut data = Data::new(model);
        let mut effort = Vec::with_capacity(position.len());
        for k in 0..time_s.len() {
            let row = k * n..(k + 1) * n;
            let [q, v] = [&position[row.clone()], &velocity[row.clone()]];
            effort.extend_from_slice(rnea(model, &mut data, q, v, &acceleration[row]));
        }
        Self {
            time_s,
            position,
            velocity,
            effort,
        }
    }

    /// Calls `give` with the joint's index and its interpolated position and effort, the ends held.
    pub(crate) fn at(&self, at_s: f64, n: usize, mut give: impl FnMut(usize, f64, f64)) {
        let next = self.time_s.partition_point(|t| *t <= at_s);
        let next = next.clamp(1, self.time_s.len() - 1);
        let (from, to) = (self.time_s[next - 1], self.time_s[next]);
        let share = ((at_s - from) / (to - from)).clamp(0.0, 1.0);
        let of = |rows: &[f64], j: usize| {
            let (a, b) = (rows[(next - 1) * n + j], rows[next * n + j]);
            a + share * (b - a)
        };
        for j in 0..n {
            give(j, of(self.position, j), of(&self.effort, j));
        }
    }
}

/// Central differences of rows.
fn derivative(time_s: &[f64], rows: &[f64], n: usize) -> Vec<f64> {
    let last = time_s.len() - 1;
    let of = |i: usize| {
        let (k, j) = (i / n, i % n);
        let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
        (rows[b * n + j] - rows[a * n + j]) / (time_s[b] - time_s[a]).max(1e-9)
    };
    (0..rows.len()).map(of).collect()
}

/// Recorded motion and effort of a joint; each slice has one number per sample.
#[derive(Debug, Clone)]
pub struct Observed<'a> {
    /// Time \[s\].
    pub time_s: &'a [f64],
    /// Position \[rad or m\].
    pub position: &'a [f64],
    /// Velocity \[rad/s or m/s\].
    pub velocity: &'a [f64],
    /// Effort \[N m or N\].
    pub effort: &'a [f64],
    /// Effort of gravity in the position \[N m or N\].
    pub gravity: &'a [f64],
}

impl Servo {
    /// The controller of joint `j` whose gains explain its effort best, by least squares, and the share of the effort's
    /// variance that it explains. Gains of errors are not negative.
    pub fn fitted(
        observed: &Observed<'_>,
        commands: &Commands<'_>,
        j: usize,
    ) -> Option<(Self, f64)> {
        let rows = observed.effort.len();
        let n = commands.position.len() / rows;
        let of = |all: &[f64], k: usize| all[k * n + j];
        let error: Vec<f64> = (0..rows)
            .map(|k| of(commands.position, k) - observed.position[k])
            .collect();
        let mut integral = vec![0.0; rows];
        for k in 1..rows {
            let step_s = observed.time_s[k] - observed.time_s[k - 1];
            integral[k] = integral[k - 1] + error[k] * step_s;
        }
        let y = DVector::from_column_slice(observed.effort);
        let with = |(commanded_velocity, feedforward, has_integral): (f64, Feedforward, bool)| {
            let column = |k: usize, c: usize| match (c, feedforward) {
                (0, _) => error[k],
                (1, _) => commanded_velocity * of(&commands.velocity, k) - observed.velocity[k],
                (2, Feedforward::Gravity) => observed.gravity[k],
                (2, Feedforward::Motion) => of(&commands.effort, k),
                (3, _) => 1.0,
                _ => integral[k],
            };
            let count = if has_integral { 5 } else { 4 };
            let (solved, left) = least_squares(DMatrix::from_fn(rows, count, column), &y)?;
            let servo = Self {
                position: solved[0],
                integral: if has_integral { solved[4] } else { 0.0 },
                velocity: solved[1],
                commanded_velocity,
                feedforward,
                share: solved[2],
                offset: solved[3],
            };
            let gains = [servo.position, servo.integral, servo.velocity];
            gains
                .iter()
                .all(|gain| *gain >= 0.0)
                .then_some((servo, left))
        };
        let all = [1.0, 0.0].into_iter().flat_map(|s| {
            [Feedforward::Gravity, Feedforward::Motion]
                .into_iter()
                .flat_map(move |f| [(s, f, true), (s, f, false)])
        });
        let best = all.filter_map(with).min_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(servo, left)| (servo, 1.0 - left / (rows as f64 * y.variance())))
    }
}

/// The solution of least squares, and the square that it leaves.
fn least_squares(mut matrix: DMatrix<f64>, y: &DVector<f64>) -> Option<(Vec<f64>, f64)> {
    // Columns of one size, so that the cut of small singular values is relative to each.
    let size = |c: usize| matrix.column(c).norm().max(f64::MIN_POSITIVE);
    let sizes: Vec<f64> = (0..matrix.ncols()).map(size).collect();
    for (c, size) in sizes.iter().enumerate() {
        matrix.column_mut(c).scale_mut(1.0 / size);
    }
    let solved = matrix.clone().svd(true, true).solve(y, 1e-9).ok()?;
    let left = (y - &matrix * &solved).norm_squared();
    let pairs = solved.iter().zip(&sizes);
    Some((pairs.map(|(x, size)| x / size).collect(), left))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
mod tests {
    use super::*;
    use crate::model::Drive;
    use crate::rnea::gravity_effort;
    use crate::rollout::ClosedLoop;
    use crate::rollout::tests::pendulum;

    #[test]
    fn gains_are_found_from_what_the_controller_did() {
        let model = pendulum();
        let time_s: Vec<f64> = (0..2000).map(|k| 0.005 * f64::from(k)).collect();
        let rows: Vec<f64> = time_s
            .iter()
            .map(|t| (1.5 * t).sin() + 0.3 * (4.0 * t).sin())
            .collect();
        let commands = Commands::new(&model, &time_s, &rows);
        for servo in [
            Servo {
                position: 80.0,
                velocity: 6.0,
                share: 1.0,
                offset: 0.5,
                ..Servo::default()
            },
            Servo {
                position: 300.0,
                integral: 200.0,
                velocity: 20.0,
                commanded_velocity: 1.0,
                feedforward: Feedforward::Motion,
                share: 0.9,
                offset: 0.0,
            },
        ] {
            let (drives, servos) = (
                [Drive {
                    damping: 1.0,
                    friction: 0.5,
                    ..Drive::default()
                }],
                [servo],
            );
            let mut arm = ClosedLoop::new((&model, &drives), (&model, &servos));
            let position = arm.positions(&rows[..1], &[2.7], &commands).unwrap();
            let velocity = derivative(&time_s, &position, 1);
            let mut data = Data::new(&model);
            let gravity: Vec<f64> = position
                .iter()
                .map(|q| gravity_effort(&model, &mut data, &[*q])[0])
                .collect();
            let mut integral = 0.0;
            let effort: Vec<f64> = (0..rows.len())
                .map(|k| {
                    let error = rows[k] - position[k];
                    integral += if k > 0 { 0.005 * error } else { 0.0 };
                    let feedforward = match servo.feedforward {
                        Feedforward::Gravity => gravity[k],
                        Feedforward::Motion => commands.effort[k],
                    };
                    servo.position * error
                        + servo.integral * integral
                        + servo.velocity
                            * (servo.commanded_velocity * commands.velocity[k] - velocity[k])
                        + servo.share * feedforward
                        + servo.offset
                })
                .collect();
            let observed = Observed {
                time_s: &time_s,
                position: &position,
                velocity: &velocity,
                effort: &effort,
                gravity: &gravity,
            };
            let (found, share) = Servo::fitted(&observed, &commands, 0).unwrap();
            assert!(share > 0.999_999, "{share}");
            assert!(
                (found.position / servo.position - 1.0).abs() < 1e-3,
                "{found:?}"
            );
            assert!(
                (found.velocity / servo.velocity - 1.0).abs() < 1e-3,
                "{found:?}"
            );
            assert!((found.integral - servo.integral).abs() < 0.5, "{found:?}");
            assert!((found.share - servo.share).abs() < 1e-3, "{found:?}");
        }
    }
}
