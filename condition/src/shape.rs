//! The shape of a change: a step, or a continuing drift.
//!
//! Weighted least squares of level, covariate and change together, for each night at which the change may have begun;
//! the best fit is selected (R. E. Quandt, "The Estimation of the Parameters of a Linear Regression System Obeying
//! Two Separate Regimes", JASA 53, 1958).

use serde::{Deserialize, Serialize};

/// Fewest nights before and after the onset of a change. Resolution: one night is an outlier.
const LEAST_NIGHTS: usize = 3;

/// Shape of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Sudden and lasting.
    Step,
    /// Gradual and continuing.
    Drift,
    /// Temporary.
    Episode,
}

/// Estimate of one night, as a data point.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// Time \[days\].
    pub day: f64,
    /// Estimated value.
    pub value: f64,
    /// Standard deviation of its error.
    pub deviation: f64,
    /// Covariate relative to its centre; 0 without a covariate.
    pub covariate: f64,
}

/// A change with its fitted parameters.
#[derive(Debug, Clone, Copy)]
pub struct Change {
    /// Step or drift.
    pub shape: Shape,
    /// Onset \[days\].
    pub from: f64,
    /// Level before the change, at the centre of the covariate.
    pub level: f64,
    /// Change of the value per unit of the covariate.
    pub slope: f64,
    /// Standard deviation of the level.
    pub level_deviation: f64,
    /// Deviation of the newest night from the level.
    pub size: f64,
    /// 95 % interval of `size`.
    pub interval: [f64; 2],
}

/// Fits the best change of those that began by the day `by`; `None` for too few nights. With `has_slope`, the fit
/// includes the covariate.
pub fn change(points: &[Point], has_slope: bool, by: f64) -> Option<Change> {
    let last = points.last()?.day;
    let mut best: Option<(f64, Change)> = None;
    for at in LEAST_NIGHTS..points.len().saturating_sub(LEAST_NIGHTS) {
        let from = points[at].day;
        if from > by {
            break;
        }
        for shape in [Shape::Step, Shape::Drift] {
            // A drift begins between two nights, and is zero in the first of them.
            let begin = if shape == Shape::Drift {
                points[at - 1].day
            } else {
                from
            };
            let column = |day: f64| match shape {
                Shape::Drift => (day - begin).max(0.0) / (last - begin).max(f64::MIN_POSITIVE),
                _ => f64::from(u8::from(day >= from)),
            };
            let Some(fit) = fit(points, has_slope, column) else {
                continue;
            };
            if best.as_ref().is_none_or(|(left, _)| fit.left < *left) {
                let half = 1.96 * fit.deviation;
                let change = Change {
                    shape,
                    from: begin,
                    level: fit.level,
                    level_deviation: fit.level_deviation,
                    slope: fit.slope,
                    size: fit.size,
                    interval: [fit.size - half, fit.size + half],
                };
                best = Some((fit.left, change));
            }
        }
    }
    best.map(|(_, change)| change)
}

struct Fit {
    level: f64,
    level_deviation: f64,
    slope: f64,
    size: f64,
    deviation: f64,
    /// Weighted residual sum of squares.
    left: f64,
}

/// Least squares of level, covariate and one more column.
fn fit(points: &[Point], has_slope: bool, column: impl Fn(f64) -> f64) -> Option<Fit> {
    let rows = |point: &Point| {
        let covariate = if has_slope { point.covariate } else { 0.0 };
        [1.0, covariate, column(point.day)]
    };
    let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
    for point in points {
        let (row, weight) = (rows(point), point.deviation.powi(-2));
        for a in 0..3 {
            for b in 0..3 {
                normal[a][b] += weight * row[a] * row[b];
            }
            right[a] += weight * row[a] * point.value;
        }
    }
    if !has_slope || normal[1][1] <= 0.0 {
        normal[1][1] = 1.0;
    }
    let inverse = inverse(normal)?;
    let solved: Vec<f64> = (0..3)
        .map(|a| (0..3).map(|b| inverse[a][b] * right[b]).sum())
        .collect();
    let off = |point: &Point| {
        let row = rows(point);
        let expected: f64 = (0..3).map(|a| row[a] * solved[a]).sum();
        ((point.value - expected) / point.deviation).powi(2)
    };
    let left: f64 = points.iter().map(off).sum();
    let freedom = (points.len() as f64 - 3.0).max(1.0);
    let scatter = left / freedom;
    Some(Fit {
        level: solved[0],
        level_deviation: (inverse[0][0] * scatter).sqrt(),
        slope: solved[1],
        size: solved[2],
        deviation: (inverse[2][2] * scatter).sqrt(),
        left,
    })
}

/// Inverse of a symmetric matrix; `None` for a singular one.
fn inverse(m: [[f64; 3]; 3]) -> Option<[[f64; 3]; 3]> {
    // The cyclic order of rows and columns gives each cofactor its sign.
    let cofactor = |a: usize, b: usize| {
        let ([p, q], [r, s]) = ([(a + 1) % 3, (a + 2) % 3], [(b + 1) % 3, (b + 2) % 3]);
        m[p][r] * m[q][s] - m[p][s] * m[q][r]
    };
    let determinant: f64 = (0..3).map(|b| m[0][b] * cofactor(0, b)).sum();
    let sound = determinant.abs() > 1e-12 * (m[0][0] * m[1][1] * m[2][2]).abs();
    sound.then(|| {
        let mut inverse = [[0.0; 3]; 3];
        for (a, row) in inverse.iter_mut().enumerate() {
            for (b, value) in row.iter_mut().enumerate() {
                *value = cofactor(b, a) / determinant;
            }
        }
        inverse
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(value: impl Fn(f64, f64) -> f64) -> Vec<Point> {
        let one = |night: i32| {
            let (day, covariate) = (f64::from(night), f64::from(night * 13 % 7));
            Point {
                day,
                value: value(day, covariate),
                deviation: 0.01,
                covariate,
            }
        };
        (0..80).map(one).collect()
    }

    #[test]
    fn a_step_and_a_drift_are_told_apart_beside_a_covariate() {
        let step = points(|day, x| 2.0 - 0.05 * x + if day >= 50.0 { 0.3 } else { 0.0 });
        let found = change(&step, true, 79.0).unwrap();
        assert!(found.shape == Shape::Step && (found.from - 50.0).abs() < 1e-9);
        assert!((found.size - 0.3).abs() < 1e-6 && (found.slope + 0.05).abs() < 1e-6);
        let drift = points(|day, x| 2.0 - 0.05 * x + 0.01 * (day - 40.0).max(0.0));
        let found = change(&drift, true, 79.0).unwrap();
        assert!(found.shape == Shape::Drift && (found.from - 40.0).abs() < 1e-9);
        assert!((found.size - 0.39).abs() < 1e-6);
        // A later change does not move the onset of one that was detected before it.
        let both =
            points(|day, _| 2.0 + f64::from(day >= 40.0) * 0.3 + f64::from(day >= 60.0) * 0.9);
        let found = change(&both, false, 45.0).unwrap();
        assert!((found.from - 40.0).abs() <= 5.0, "{found:?}");
    }
}
