//! Predictions of a fit's effects in pieces of recordings that are left out of it.

use nalgebra::DVector;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;

use super::left_out::LeftOut;
use super::prior::Magnitude;
use super::space::Space;
use super::variants::SILENT;
use super::{rows, tangents};

/// The columns of a fit's effects, scaled by their prior standard deviations, and the effort that they and the nuisances
/// are to explain.
pub fn tangents(problem: &Problem, fit: &Fit, efforts: &[Magnitude]) -> (Vec<Column>, Column) {
    let mut measured = Column {
        joint: None,
        values: fit.residual.clone(),
    };
    let mut columns = Vec::new();
    for (given, active) in tangents::of_fit(problem, fit, efforts)
        .iter()
        .zip(&fit.actives)
    {
        let mut add = |column: &Column, factor: f64| {
            let first = column.joint.map_or(0, |joint| joint * problem.rows);
            for (value, x) in measured.values[first..].iter_mut().zip(&column.values) {
                *value += factor * x;
            }
        };
        if let Some(alone) = &given.alone {
            add(alone, 1.0);
            columns.push(alone.clone());
        }
        let factors = given.variant.factors_of(active).into_iter();
        let all = factors.zip(&given.variant.deviations).zip(&given.factors);
        for ((factor, deviation), column) in all {
            add(column, factor);
            columns.push(column.times(*deviation));
        }
    }
    (columns, measured)
}

/// Predictions of a fit in pieces of recordings that are left out of it in turn.
pub struct Predictions<'a> {
    left_out: LeftOut<'a>,
    /// By column of the effects, whether its effect lasts.
    lasts: Vec<bool>,
    /// By joint, whether an effect that lasts changes its effort.
    felt: Vec<bool>,
    pieces: usize,
}

impl<'a> Predictions<'a> {
    /// Those of a fit; nothing where a normal matrix cannot be factored.
    pub fn of(
        problem: &Problem,
        space: &'a Space,
        fit: &Fit,
        efforts: &[Magnitude],
    ) -> Option<Self> {
        let pieces = rows::pieces(problem);
        let (columns, measured) = tangents(problem, fit, efforts);
        let given = tangents::of_fit(problem, fit, efforts);
        let lasts = given.iter().flat_map(|given| {
            let hypothesis = given.variant.hypothesis;
            let lasts = hypothesis.lasts() && !hypothesis.is_torque_scale();
            let count = usize::from(given.alone.is_some()) + given.factors.len();
            std::iter::repeat_n(lasts, count)
        });
        let lasts: Vec<bool> = lasts.collect();
        let lasting = || columns.iter().zip(&lasts).filter(|(_, lasts)| **lasts);
        let is_felt = |joint: usize| {
            let least = SILENT * efforts[joint].peak;
            lasting().any(|(column, _)| {
                let values = column.of_joint(joint, problem.rows).unwrap_or_default();
                values.iter().any(|x| x.abs() > least)
            })
        };
        Some(Self {
            felt: (0..problem.joints).map(is_felt).collect(),
            left_out: LeftOut::new(space, &columns, &measured, pieces)?,
            lasts,
            pieces,
        })
    }

    /// Whitened residuals by joint and piece.
    pub fn residuals(&self) -> Vec<Vec<DVector<f64>>> {
        let of_piece = |joint, piece| self.left_out.residual(joint, piece, &|_| true);
        self.by_joint(&of_piece)
    }

    /// Joints whose effort is predicted no better with the effects that last than without them. A twin has no nuisances, so
    /// they predict nothing here.
    pub fn unpredictive(&self) -> Vec<usize> {
        let nuisances = self.left_out.nuisances();
        let of_effects = |joint, piece| {
            let is_effect = |column: usize| column >= nuisances;
            self.left_out.residual(joint, piece, &is_effect)
        };
        let without = |joint, piece| {
            let passes = |column: usize| column >= nuisances && !self.lasts[column - nuisances];
            self.left_out.residual(joint, piece, &passes)
        };
        let square =
            |of_joint: &[DVector<f64>]| of_joint.iter().map(DVector::norm_squared).sum::<f64>();
        let (with, without) = (self.by_joint(&of_effects), self.by_joint(&without));
        let pairs = with.iter().zip(&without).enumerate();
        pairs
            .filter(|(_, (with, without))| square(with) >= square(without))
            .map(|(joint, _)| joint)
            .filter(|joint| self.felt[*joint])
            .collect()
    }

    fn by_joint(&self, of_piece: &dyn Fn(usize, usize) -> DVector<f64>) -> Vec<Vec<DVector<f64>>> {
        let of_joint = |joint| {
            (0..self.pieces)
                .map(|piece| of_piece(joint, piece))
                .collect()
        };
        (0..self.felt.len()).map(of_joint).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::fixture::{at_joint, problem_with};
    use crate::inference::nuisance;
    use crate::inference::state::State;

    /// Guards against a delay that was refused as unpredictive because it has no linear coefficient.
    #[test]
    fn a_delay_predicts_what_is_left_out() {
        let mut late: VecDeque<Vec<f64>> = VecDeque::new();
        // Six samples of 10 ms.
        let problem = problem_with(5, |_, _, effort| {
            late.push_back(effort.to_vec());
            if late.len() > 6
                && let Some(then) = late.pop_front()
            {
                effort.copy_from_slice(&then);
            }
        });
        let delay = at_joint("torque_delay", 0).with(vec![0.06]);
        let fit = Fit::new(&problem, vec![delay]);
        let state = State::new(&problem, true);
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(&problem, &fit, &sizes, true, state.scales);
        let space = state.space(&nuisances);
        let predictions = Predictions::of(&problem, &space, &fit, &state.efforts).unwrap();
        assert_eq!(predictions.unpredictive(), Vec::<usize>::new());
    }
}
