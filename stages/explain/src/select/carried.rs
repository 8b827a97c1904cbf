//! How much of a residual functions of the motion predict in recordings that they were not fitted on.
//!
//! Noise of one recording says nothing about another one, however slow it is. So what carries over is no noise. What would
//! carry over by chance is measured on surrogates: the residual of each recording, turned round in time by another shift,
//! which keeps its correlation and its size and loses its relation to the motion.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::least_squares::dot;

/// Weight of zero in the fit of a function's factors, relative to the information of all recordings: where the others show
/// nothing, nothing is predicted.
/// Tuned: by hand, on no recorded seeds; not swept.
const DAMPING: f64 = 0.01;
/// Surrogates.
/// Statistical: mean and standard deviation of 39 are known to 16 % of the deviation.
const SURROGATES: usize = 39;
/// What surrogates predict at most, in standard deviations above their mean.
/// Statistical: a Gumbel variable, as the largest of many is, exceeds this once in 300.
pub const BEYOND_CHANCE: f64 = 4.0;
/// Surrogates are turned by at least this share of a recording, either way.
/// Statistical: noise that is slower than that is not slow noise but an offset.
const LEAST_TURN: f64 = 1.0 / 6.0;

/// What functions of the motion predict of a residual.
#[derive(Debug, Clone)]
pub struct Carried {
    /// Share of the squares that they predict. Below zero if they add to them.
    pub share: f64,
    /// The same of each surrogate.
    surrogates: Vec<f64>,
}

/// One recording: the functions at the rows that count, their products, and the residual there.
struct Part {
    columns: Vec<Vec<f64>>,
    gram: DMatrix<f64>,
    residual: Vec<f64>,
    square: f64,
}

impl Part {
    fn right(&self, residual: &[f64]) -> DVector<f64> {
        let each = self.columns.iter().map(|column| dot(column, residual));
        DVector::from_iterator(self.columns.len(), each)
    }

    /// The residual, turned round by a shift and perhaps its sign changed.
    fn surrogate(&self, number: usize, recording: usize) -> Vec<f64> {
        // Multiples of irrational numbers spread evenly, and are the same in every run.
        let fraction = |a: f64, b: f64| (number as f64 * a + recording as f64 * b).fract();
        let turn = LEAST_TURN + (1.0 - 2.0 * LEAST_TURN) * fraction(0.618_034, 0.414_214);
        let sign = if fraction(0.732_051, 0.236_068) < 0.5 {
            -1.0
        } else {
            1.0
        };
        let mut turned: Vec<f64> = self.residual.iter().map(|x| sign * x).collect();
        let by = (turn * turned.len() as f64) as usize;
        turned.rotate_left(by);
        turned
    }
}

impl Carried {
    /// How much `columns` predict of a residual at a joint. `None` if there are fewer than two recordings.
    pub fn of(
        problem: &Problem,
        residual: &[f64],
        joint: usize,
        columns: &[Column],
    ) -> Option<Self> {
        let own = problem.joint_rows(joint);
        let (weight, residual) = (&problem.weight[own.clone()], &residual[own]);
        let values: Vec<&[f64]> = (columns.iter())
            .map(|column| column.of_joint(joint, problem.rows))
            .collect::<Option<_>>()?;
        let parts: Vec<Part> = (problem.tracks.iter())
            .map(|track| {
                let used: Vec<usize> = track.rows().filter(|&row| weight[row] > 0.0).collect();
                let pick = |from: &[f64]| used.iter().map(|&row| from[row]).collect::<Vec<_>>();
                let columns: Vec<Vec<f64>> = values.iter().map(|column| pick(column)).collect();
                let p = columns.len();
                let gram = DMatrix::from_fn(p, p, |a, b| dot(&columns[a], &columns[b]));
                let residual = pick(residual);
                let square = dot(&residual, &residual);
                Part {
                    columns,
                    gram,
                    residual,
                    square,
                }
            })
            .filter(|part| !part.residual.is_empty())
            .collect();
        let square: f64 = parts.iter().map(|part| part.square).sum();
        if parts.len() < 2 || square <= 0.0 {
            return None;
        }
        let p = columns.len();
        let gram = parts
            .iter()
            .fold(DMatrix::zeros(p, p), |sum, part| sum + &part.gram);
        let factors: Vec<Cholesky<f64, Dyn>> = (parts.iter())
            .map(|part| {
                let mut others = &gram - &part.gram;
                for a in 0..p {
                    others[(a, a)] += DAMPING * gram[(a, a)] + f64::MIN_POSITIVE.sqrt();
                }
                others.cholesky()
            })
            .collect::<Option<_>>()?;
        let share = |residuals: &[Vec<f64>]| {
            let each = parts.iter().zip(residuals);
            let rights: Vec<DVector<f64>> = each.map(|(part, y)| part.right(y)).collect();
            let right = rights
                .iter()
                .fold(DVector::zeros(p), |sum, right| sum + right);
            let each = parts.iter().zip(&factors).zip(&rights);
            let gained = each.map(|((part, factor), own)| {
                let theta = factor.solve(&(&right - own));
                2.0 * own.dot(&theta) - (&part.gram * &theta).dot(&theta)
            });
            gained.sum::<f64>() / square
        };
        let measured: Vec<Vec<f64>> = parts.iter().map(|part| part.residual.clone()).collect();
        let surrogate = |number: usize| {
            let each = parts.iter().enumerate();
            let turned: Vec<Vec<f64>> = each
                .map(|(recording, part)| part.surrogate(number, recording))
                .collect();
            share(&turned)
        };
        Some(Self {
            share: share(&measured),
            surrogates: (1..=SURROGATES).map(surrogate).collect(),
        })
    }

    /// What the best of some functions predicts at most where the residual has nothing to do with the motion: so many standard
    /// deviations above the mean of surrogates.
    pub fn largest_by_chance<'a>(all: impl Iterator<Item = &'a Self>, deviations: f64) -> f64 {
        let mut best = vec![f64::NEG_INFINITY; SURROGATES];
        for one in all {
            for (best, share) in best.iter_mut().zip(&one.surrogates) {
                *best = best.max(*share);
            }
        }
        let count = best.len() as f64;
        let mean = best.iter().sum::<f64>() / count;
        let variance = best.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count;
        mean + deviations * variance.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, at_joint, model, problem, recording};

    /// What viscous friction predicts of the first joint's effort, beside what is added there.
    fn of(mut add: impl FnMut(f64, &mut f64)) -> (f64, f64) {
        let model = model();
        let recordings = [1, 2, 3]
            .map(|seed| recording(&model, seed, |_, qd, effort| add(qd[0], &mut effort[0])));
        let data = problem(&model, &recordings);
        let nothing = Fit::new(&data, Vec::new());
        let columns = nothing.columns(&data, at_joint("viscous_friction", 0), &[0.0]);
        let columns = [Column::clone(&columns.factors[0])];
        let carried = Carried::of(&data, &nothing.residual, 0, &columns).unwrap();
        (
            carried.share,
            Carried::largest_by_chance(std::iter::once(&carried), BEYOND_CHANCE),
        )
    }

    #[test]
    fn what_follows_the_motion_carries_over_and_slow_noise_does_not() {
        let mut noise = Noise(5);
        let mut slow = 0.0;
        let mut next = move || {
            slow = 0.99 * slow + 0.14 * noise.next();
            0.2 * slow
        };
        let (share, by_chance) = of(|qd, effort| *effort += 0.5 * qd + next());
        assert!(share > 0.5 && share > by_chance, "{share} {by_chance}");
        let mut noise = Noise(6);
        let mut slow = 0.0;
        let (share, by_chance) = of(|_, effort| {
            slow = 0.99 * slow + 0.14 * noise.next();
            *effort += 0.2 * slow;
        });
        assert!(share < by_chance, "{share} {by_chance}");
    }
}
