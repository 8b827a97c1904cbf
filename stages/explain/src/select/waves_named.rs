//! Two waves in the place of a curve over a joint's angle.
//!
//! Two ripples of a gear beat with each other. Where a joint turns by less than a revolution, the one that fits best alone is
//! neither of the two, so the search that adds one effect at a time draws a curve. Here each two whole numbers of cycles are
//! tried together.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::Against;

use crate::data::column::Column;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::select::explanation::{Explanation, describe};
use crate::select::grid::shapes;
use crate::select::parallel;
use crate::select::plausible::is_open_wave;
use crate::select::propose::Base;
use crate::select::search::Search;

/// Pairs of waves that are refined.
/// Tuned: by hand, for what it costs in time; not swept.
const REFINED: usize = 4;
/// Added to the scaled products of the columns, whose diagonal is 1: waves that the motion does not tell apart stay small.
/// Resolution: two waves a tenth of a cycle apart over the range.
const RIDGE: f64 = 1e-3;

impl Search<'_> {
    /// The explanation with two waves in the place of each curve over its joint's angle, where they do better.
    pub fn with_waves_named(&self, mut best: Explanation) -> Explanation {
        for joint in 0..self.problem.joints {
            let is_curve = |active: &Active| {
                let of_angle = |curve: &tauscope_dynamics::terms::Table| {
                    curve.against == Against::Position
                        && curve.of_joint == joint
                        && !curve.by_direction
                };
                active.hypothesis.only_joint() == Some(joint)
                    && active.curve.as_ref().is_some_and(of_angle)
            };
            if let Some(index) = best.fit.actives.iter().position(is_curve)
                && let Some(named) = self.two_waves(&best, index, joint)
            {
                (self.say)(&describe(&named));
                best = named;
            }
        }
        best
    }

    /// Two waves in the place of the effect at `index`, if they do better.
    fn two_waves(&self, best: &Explanation, index: usize, joint: usize) -> Option<Explanation> {
        let is_pair = |h: &&Hypothesis| {
            h.place.joint == joint
                && h.only_joint() == Some(joint)
                && h.is_of_position()
                && h.effect.traits.most_at_one_place > 1
        };
        let hypothesis = *self.hypotheses.iter().find(is_pair)?;
        let less = self.without(best, index);
        let pairs = self.best_pairs(&less.fit, hypothesis);
        let white = vec![1.0; self.problem.joints];
        let able = parallel::map(&pairs, |pair| {
            let both = pair.iter().try_fold(less.clone(), |now, wave| {
                let base = Base::new(self.problem, &now.fit, self.hypotheses.len());
                let proposal = base.propose_at(hypothesis, wave)?;
                let fit = now.fit.with(self.problem, proposal.active);
                let penalties = [&now.penalties[..], &[proposal.penalty]].concat();
                Some(Explanation { fit, penalties })
            })?;
            let fit = both
                .fit
                .refined_at(self.problem, Some(&[joint]), best.fit.likelihood());
            let named = Explanation { fit, ..both };
            let mut waves = named
                .fit
                .actives
                .iter()
                .filter(|a| a.hypothesis == hypothesis);
            let closes = !waves.any(is_open_wave);
            (closes && named.ahead_of(best, &white) > 0.0).then_some(named)
        });
        let able = able.into_iter().flatten();
        able.max_by(|a, b| a.ahead_of(b, &white).total_cmp(&0.0))
    }

    /// The pairs of waves that fit what `less` leaves best, of whole numbers of cycles.
    fn best_pairs(&self, less: &Fit, hypothesis: Hypothesis) -> Vec<[Vec<f64>; 2]> {
        let waves = shapes(self.problem, hypothesis);
        let joint = hypothesis.place.joint;
        let own = self.problem.joint_rows(joint);
        let residual = &less.residual[own.clone()];
        let weight = &self.problem.weight[own];
        let of = |wave: &Vec<f64>| {
            let columns = less.columns(self.problem, hypothesis, wave);
            let each = columns.factors.iter();
            each.filter_map(|column| {
                let column: &Column = column;
                Some(column.of_joint(joint, self.problem.rows)?.to_vec())
            })
            .collect::<Vec<Vec<f64>>>()
        };
        let columns: Vec<Vec<f64>> = parallel::map(&waves, of).into_iter().flatten().collect();
        let count = columns.len();
        if count != 2 * waves.len() {
            return Vec::new();
        }
        let product = |x: &[f64], y: &[f64]| -> f64 {
            x.iter()
                .zip(y)
                .zip(weight)
                .map(|((x, y), w)| w * x * y)
                .sum()
        };
        let scale: Vec<f64> = columns
            .iter()
            .map(|x| product(x, x).max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let gram = DMatrix::from_fn(count, count, |a, b| {
            if a <= b {
                product(&columns[a], &columns[b]) / (scale[a] * scale[b])
            } else {
                0.0
            }
        });
        let gram = |a: usize, b: usize| gram[(a.min(b), a.max(b))];
        let right: Vec<f64> = (columns.iter().zip(&scale))
            .map(|(x, scale)| product(x, residual) / scale)
            .collect();
        let mut pairs = Vec::new();
        for a in 0..waves.len() {
            for b in a + 1..waves.len() {
                let of = [2 * a, 2 * a + 1, 2 * b, 2 * b + 1];
                let normal = DMatrix::from_fn(4, 4, |i, k| {
                    gram(of[i], of[k]) + if i == k { RIDGE } else { 0.0 }
                });
                let right = DVector::from_iterator(4, of.iter().map(|&i| right[i]));
                if let Some(factor) = normal.cholesky() {
                    pairs.push((right.dot(&factor.solve(&right)), [a, b]));
                }
            }
        }
        pairs.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let first = pairs.into_iter().take(REFINED);
        first
            .map(|(_, pair)| pair.map(|wave| waves[wave].clone()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn two_waves_that_beat_are_named_and_no_other_curve_is() {
        let named = |of: fn(f64) -> f64| {
            let problem = problem_with(3, |q, _, effort| effort[1] += of(q[1]));
            let ripple = [at_joint("torque_ripple", 1)];
            let search = Search {
                problem: &problem,
                hypotheses: &ripple,
                unnamed_bodies: &[],
                say: &|_| {},
            };
            let nothing = Fit::new(&problem, Vec::new());
            let curve = Base::new(&problem, &nothing, 40).propose_curve(1).unwrap();
            let drawn = Explanation {
                fit: nothing.with(&problem, curve.active).refined(&problem),
                penalties: vec![curve.penalty],
            };
            let found = search.with_waves_named(drawn);
            let cycles = |a: &Active| a.curve.is_none().then(|| a.parameters()[1]);
            let mut cycles: Vec<f64> = found.fit.actives.iter().filter_map(cycles).collect();
            cycles.sort_by(f64::total_cmp);
            cycles
        };
        let beats = named(|q| 1.2 * (16.0 * q + 0.3).sin() + 0.8 * (12.0 * q).sin());
        assert!(
            matches!(beats[..], [a, b] if (a - 12.0).abs() < 0.2 && (b - 16.0).abs() < 0.2),
            "{beats:?}"
        );
        let dent = named(|q| 2.0 * (-0.5 * ((q - 0.2) / 0.08).powi(2)).exp());
        assert!(dent.is_empty(), "{dent:?}");
    }
}
