//! How much of the mismatch a finding explains.

use crate::fit::fitted::Fit;

/// Squares of the residual of `without` that `with` explains, over the final variance of each joint.
pub fn mismatch(without: &Fit, with: &Fit, count: &Fit) -> f64 {
    (0..with.variance.len())
        .map(|j| {
            (without.squares[j] - with.squares[j]).max(0.0)
                / with.variance[j]
                / count.count[j].max(1.0)
        })
        .sum::<f64>()
        .max(1e-12)
}

/// What `without` leaves less what `with` leaves, as root mean square at the joint where that is most \[effort unit\].
/// `unit_nm` are N m per that unit, by joint.
pub fn effort_rms(without: &Fit, with: &Fit, unit_nm: &[f64]) -> f64 {
    let at = |j: usize| {
        let square = (without.squares[j] - with.squares[j]).max(0.0) / with.count[j].max(1.0);
        square.sqrt() / unit_nm[j]
    };
    (0..with.squares.len()).map(at).fold(0.0, f64::max)
}
