//! Products of signals, and the solution of normal equations.

use nalgebra::{DMatrix, DVector};

/// Sums are formed in this many parts, which a processor adds at once.
/// Resolution: changes computing time and rounding.
const LANES: usize = 8;

/// Sum of `weight * x * y`.
pub fn weighted_dot(weight: &[f64], x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (ws, w_rest) = weight.as_chunks::<LANES>();
    let (xs, x_rest) = x.as_chunks::<LANES>();
    let (ys, y_rest) = y.as_chunks::<LANES>();
    for ((w, x), y) in ws.iter().zip(xs).zip(ys) {
        for lane in 0..LANES {
            sums[lane] += w[lane] * x[lane] * y[lane];
        }
    }
    let rest = w_rest.iter().zip(x_rest).zip(y_rest);
    sums.iter().sum::<f64>() + rest.map(|((w, x), y)| w * x * y).sum::<f64>()
}

/// Sum of `x * y`.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (xs, x_rest) = x.as_chunks::<LANES>();
    let (ys, y_rest) = y.as_chunks::<LANES>();
    for (x, y) in xs.iter().zip(ys) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let rest = x_rest.iter().zip(y_rest);
    sums.iter().sum::<f64>() + rest.map(|(x, y)| x * y).sum::<f64>()
}

/// Least share that is added to the diagonal, so that columns that are nearly dependent can be solved for.
/// Resolution: columns count as dependent if their directions differ by less than about 1e-5 rad.
const LEAST_DAMPING: f64 = 1e-10;

/// Solves normal equations for the columns in `used`, the others stay at 0, with `damping` in shares of the diagonal (Levenberg
/// and Marquardt). `None` if the columns are not independent even so.
pub fn solved(
    normal: &DMatrix<f64>,
    right: &DVector<f64>,
    used: &[bool],
    damping: f64,
) -> Option<DVector<f64>> {
    let index: Vec<usize> = (0..used.len()).filter(|&i| used[i]).collect();
    let m = index.len();
    let scale: Vec<f64> = index
        .iter()
        .map(|&i| normal[(i, i)].max(1e-300).sqrt())
        .collect();
    let mut scaled = DMatrix::from_fn(m, m, |a, b| {
        normal[(index[a], index[b])] / (scale[a] * scale[b])
    });
    for a in 0..m {
        scaled[(a, a)] += damping + LEAST_DAMPING;
    }
    let side = DVector::from_fn(m, |a, _| right[index[a]] / scale[a]);
    let within = scaled.cholesky()?.solve(&side);
    let mut solution = DVector::zeros(used.len());
    for (a, &i) in index.iter().enumerate() {
        solution[i] = within[a] / scale[a];
    }
    Some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_in_lanes_is_the_sum() {
        for n in [0, 1, 7, 8, 9, 31, 64] {
            let of =
                |shift: f64| -> Vec<f64> { (0..n).map(|k| (f64::from(k) + shift).sin()).collect() };
            let (w, x, y) = (of(0.1), of(0.7), of(1.9));
            let plain: f64 = w.iter().zip(&x).zip(&y).map(|((w, x), y)| w * x * y).sum();
            assert!((weighted_dot(&w, &x, &y) - plain).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_not_used_stays_at_zero_and_damping_shortens_the_step() {
        let normal = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, 0.0, 1.0, 3.0, 1.0, 0.0, 1.0, 2.0]);
        let right = DVector::from_row_slice(&[1.0, 2.0, 3.0]);
        let all = solved(&normal, &right, &[true; 3], 0.0).unwrap();
        assert!((&normal * &all - &right).norm() < 1e-8);
        let some = solved(&normal, &right, &[true, false, true], 0.0).unwrap();
        assert!(some[1].abs() <= 0.0 && (some[2] - 1.5).abs() < 1e-8);
        let damped = solved(&normal, &right, &[true; 3], 1.0).unwrap();
        assert!(damped.norm() < all.norm());
    }
}
