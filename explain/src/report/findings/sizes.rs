//! Share of the mismatch that a finding explains, and its RMS effort.

use crate::fit::fitted::Fit;

/// Returns the mean square by which `with` reduces the residual of `without`, summed over joints in units of their
/// final variance.
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

/// Returns the RMS by which `with` reduces the residual of `without`, at the joint with the largest reduction
/// \[effort unit\]. `unit_nm` are N m per effort unit, by joint.
pub fn effort_rms(without: &Fit, with: &Fit, unit_nm: &[f64]) -> f64 {
    let at = |j: usize| {
        let square = (without.squares[j] - with.squares[j]).max(0.0) / with.count[j].max(1.0);
        square.sqrt() / unit_nm[j]
    };
    (0..with.squares.len()).map(at).fold(0.0, f64::max)
}
