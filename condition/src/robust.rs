//! Medians, and slopes as medians.

/// Largest number of estimates whose pairwise slopes are computed. Resolution: 2,000 estimates; more are thinned.
const MOST_ESTIMATES: usize = 2_000;

/// The median; 0 without values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => 0.0,
        length if length % 2 == 1 => values[half],
        _ => f64::midpoint(values[half - 1], values[half]),
    }
}

/// A slope and its 95 % interval: H. Theil, "A rank-invariant method of linear and polynomial regression analysis",
/// 1950; P. K. Sen, "Estimates of the regression coefficient based on Kendall's tau", JASA 63, 1968, equation 3.4.
///
/// `None` for fewer than three points or equal times.
pub fn theil_sen(points: &[(f64, f64)]) -> Option<(f64, [f64; 2])> {
    let step = points.len().div_ceil(MOST_ESTIMATES).max(1);
    let points: Vec<(f64, f64)> = points.iter().copied().step_by(step).collect();
    let n = points.len() as f64;
    let mut slopes = Vec::with_capacity(points.len() * points.len() / 2);
    for (at, (x, y)) in points.iter().enumerate() {
        for (other_x, other_y) in &points[at + 1..] {
            let apart = other_x - x;
            if apart.abs() > 0.0 {
                slopes.push((other_y - y) / apart);
            }
        }
    }
    if slopes.len() < 3 {
        return None;
    }
    slopes.sort_by(f64::total_cmp);
    // The 97.5 % quantile of Kendall's statistic, as a number of slopes.
    let spread = 1.96 * (n * (n - 1.0) * (2.0 * n + 5.0) / 18.0).sqrt();
    let count = slopes.len() as f64;
    let rank = |rank: f64| slopes[(rank.max(0.0) as usize).min(slopes.len() - 1)];
    let interval = [
        rank(((count - spread) / 2.0).floor() - 1.0),
        rank(f64::midpoint(count, spread).ceil()),
    ];
    Some((median(slopes.clone()), interval))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_wild_points_does_not_move_the_slope() {
        let line = |k: i32| {
            (
                f64::from(k),
                1.0 + 0.5 * f64::from(k) + 0.01 * f64::from(k * 7 % 5),
            )
        };
        let mut points: Vec<(f64, f64)> = (0..60).map(line).collect();
        for point in points.iter_mut().step_by(4) {
            point.1 += 40.0;
        }
        let (slope, [low, high]) = theil_sen(&points).unwrap();
        assert!((slope - 0.5).abs() < 0.01, "{slope}");
        assert!(low <= slope && slope <= high && low > 0.0, "{low} {high}");
    }

    #[test]
    fn two_points_have_no_interval() {
        assert!(theil_sen(&[(0.0, 1.0), (1.0, 2.0)]).is_none());
        assert!((median(vec![3.0, 1.0, 2.0]) - 2.0).abs() < 1e-12);
    }
}
