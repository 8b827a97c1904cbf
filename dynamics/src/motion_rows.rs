//! Effort along a recorded motion, four rows at once.

use nalgebra::SimdValue;

use crate::data::Data;
use crate::model::Model;
use crate::real::Lanes;
use crate::rnea::{gravity_effort, rnea};

/// Computes the effort \[N m or N\] of each row of a motion: [`rnea`] in batches. Positions `q`, velocities `qd`,
/// accelerations `qdd` and the result are row-major, a number per joint.
///
/// # Panics
/// If the slices have different lengths, or their rows do not have one number per joint.
pub fn rnea_rows(model: &Model, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
    rows(model, [q, qd, qdd], |data, [q, qd, qdd]| {
        rnea(model, data, q, qd, qdd)
    })
}

/// Computes the effort \[N m or N\] against gravity at each row of positions: [`gravity_effort`] in batches. Positions
/// and result are row-major, a number per joint.
///
/// # Panics
/// If the rows do not have one number per joint.
pub fn gravity_rows(model: &Model, q: &[f64]) -> Vec<f64> {
    rows(model, [q], |data, [q]| gravity_effort(model, data, q))
}

fn rows<const N: usize>(
    model: &Model,
    inputs: [&[f64]; N],
    effort: impl for<'d> Fn(&'d mut Data<Lanes>, [&[Lanes]; N]) -> &'d [Lanes],
) -> Vec<f64> {
    let n = model.dof();
    let numbers = inputs[0].len();
    for input in inputs {
        assert!(
            input.len() == numbers && numbers.is_multiple_of(n.max(1)),
            "{} numbers given, not rows of {n}",
            input.len()
        );
    }
    let mut data = Data::<Lanes>::new(model);
    let mut lanes = inputs.map(|_| vec![Lanes::ZERO; n]);
    let mut efforts = Vec::with_capacity(numbers);
    let count = numbers / n.max(1);
    for first in (0..count).step_by(Lanes::LANES) {
        // The last batch repeats its last row.
        let row = |lane: usize| (first + lane).min(count - 1) * n;
        for (input, lanes) in inputs.iter().zip(&mut lanes) {
            for (j, joint) in lanes.iter_mut().enumerate() {
                *joint = Lanes::from([0, 1, 2, 3].map(|lane| input[row(lane) + j]));
            }
        }
        let found = effort(&mut data, lanes.each_ref().map(Vec::as_slice));
        for lane in 0..Lanes::LANES.min(count - first) {
            efforts.extend(found.iter().map(|joint| joint.extract(lane)));
        }
    }
    efforts
}
