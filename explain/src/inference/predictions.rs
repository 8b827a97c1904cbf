//! Predictions of a fit's effects in pieces of recordings that are left out of it.

use nalgebra::DVector;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;

use super::left_out::LeftOut;
use super::prior::Magnitude;
use super::space::Space;
use super::{rows, variants};

/// The columns of a fit's effects, scaled by their prior standard deviations, and the effort that they and the nuisances
/// are to explain.
pub fn tangents(problem: &Problem, fit: &Fit, efforts: &[Magnitude]) -> (Vec<Column>, Column) {
    let mut measured = Column {
        joint: None,
        values: fit.residual.clone(),
    };
    let mut columns = Vec::new();
    for (given, active) in variants::of_fit(problem, fit, efforts)
        .iter()
        .zip(&fit.actives)
    {
        let factors = given.variant.factors_of(active);
        let all = factors
            .iter()
            .zip(&given.variant.deviations)
            .zip(&given.factors);
        for ((factor, deviation), column) in all {
            let first = column.joint.map_or(0, |joint| joint * problem.rows);
            for (value, x) in measured.values[first..].iter_mut().zip(&column.values) {
                *value += factor * x;
            }
            columns.push(column.times(*deviation));
        }
    }
    (columns, measured)
}

/// Whitened residuals in pieces of recordings that are left out of a fit in turn, by joint and piece.
pub fn residuals(
    problem: &Problem,
    space: &Space,
    fit: &Fit,
    efforts: &[Magnitude],
) -> Option<Vec<Vec<DVector<f64>>>> {
    let pieces = rows::pieces(problem);
    let (columns, measured) = tangents(problem, fit, efforts);
    let left_out = LeftOut::new(space, &columns, &measured, pieces)?;
    let of_joint = |joint: usize| {
        let of_piece = |piece: usize| left_out.residual(joint, piece);
        (0..pieces).map(of_piece).collect()
    };
    Some((0..problem.joints).map(of_joint).collect())
}

/// Joints whose residuals in pieces that are left out of the fit are smaller without the effects that last.
pub fn unpredictive(
    problem: &Problem,
    space: &Space,
    fit: &Fit,
    efforts: &[Magnitude],
    residuals: &[Vec<DVector<f64>>],
) -> Vec<usize> {
    let lasts =
        |active: &&Active| active.hypothesis.lasts() && !active.hypothesis.is_torque_scale();
    let (lasting, others): (Vec<&Active>, Vec<&Active>) = fit.actives.iter().partition(lasts);
    let feels = |joint: &usize| {
        let mut only = lasting.iter().map(|active| active.hypothesis.only_joint());
        only.any(|only| only.is_none_or(|own| own == *joint))
    };
    let others = others.into_iter().cloned().collect();
    let without = Fit::beside(problem, others, Some(fit));
    let Some(without) = self::residuals(problem, space, &without, efforts) else {
        return Vec::new();
    };
    let square =
        |of_joint: &[DVector<f64>]| of_joint.iter().map(DVector::norm_squared).sum::<f64>();
    let pairs = residuals.iter().zip(&without).enumerate();
    pairs
        .filter(|(_, (with, without))| square(with) >= square(without))
        .map(|(joint, _)| joint)
        .filter(feels)
        .collect()
}
