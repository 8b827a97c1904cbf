//! Series too short to learn from: whether the estimates change, and with which variable.

use serde::{Deserialize, Serialize};

use crate::robust::median;
use crate::series::{Covariate, Estimate};

/// Fewest estimates to compare. Resolution: a line through four leaves two degrees of freedom.
pub const LEAST: usize = 5;
/// Deviation from the median up to which estimates are treated as equal, as a share of the median.
/// Resolution: repeatability of a gear's friction from one hour to the next.
const SAME: f64 = 0.02;
/// Evidence by which one line must exceed another \[nats of the Bayesian information criterion, G. Schwarz 1978\].
/// Statistical: odds of 3 to 1.
const BETTER: f64 = 1.1;

/// Behaviour of a few estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SoFar {
    /// Too few estimates.
    TooFew,
    /// No change: all are within 2 % of their median, or their intervals contain it.
    Stable,
    /// Change with the temperature, or with the time since the start.
    Warmth,
    /// Change with the date.
    Trend,
    /// Change without an identified variable.
    Undecided,
}

/// Compares estimates, oldest first.
pub fn so_far(estimates: &[Estimate]) -> SoFar {
    let sound: Vec<&Estimate> = estimates.iter().filter(|one| one.is_sound()).collect();
    if sound.len() < LEAST {
        return SoFar::TooFew;
    }
    let middle = median(sound.iter().map(|one| one.value).collect());
    let same = |one: &&&Estimate| {
        let near = (one.value - middle).abs() <= SAME * middle.abs();
        near || (one.low <= middle && middle <= one.high)
    };
    if sound.iter().filter(same).count() == sound.len() {
        return SoFar::Stable;
    }
    let left = |of: &dyn Fn(&Estimate) -> Option<f64>| {
        let points: Option<Vec<(f64, f64)>> = sound
            .iter()
            .map(|one| Some((of(one)?, one.value)))
            .collect();
        line(&points?)
    };
    let begin = sound[0].day;
    let by_date = left(&|one| Some(one.day - begin));
    let warmths = [Covariate::Temperature, Covariate::TimeSinceStart];
    let by_warmth = warmths
        .into_iter()
        .find_map(|warmth| left(&|one| warmth.of(one)));
    let mean = sound.iter().map(|one| one.value).sum::<f64>() / sound.len() as f64;
    let flat: f64 = sound.iter().map(|one| (one.value - mean).powi(2)).sum();
    let n = sound.len() as f64;
    // Half of n times the logarithm of the ratio of residual sums, less half the logarithm of n for the slope.
    let evidence = |left: f64| 0.5 * n * (flat / left.max(1e-12 * flat)).ln() - 0.5 * n.ln();
    let date = by_date.map_or(0.0, evidence);
    let warmth = by_warmth.map_or(0.0, evidence);
    if warmth > BETTER && warmth > date + BETTER {
        SoFar::Warmth
    } else if date > BETTER && date > warmth + BETTER {
        SoFar::Trend
    } else {
        SoFar::Undecided
    }
}

/// Residual sum of squares of a line; `None` if all abscissas are equal.
fn line(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let sums = points.iter().fold([0.0; 3], |[xx, xy, yy], (px, py)| {
        let (dx, dy) = (px - x, py - y);
        [xx + dx * dx, xy + dx * dy, yy + dy * dy]
    });
    (sums[0] > 0.0).then(|| (sums[2] - sums[1] * sums[1] / sums[0]).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimates(of: impl Fn(f64) -> (f64, f64)) -> Vec<Estimate> {
        let one = |at: i32| {
            let (value, temperature) = of(f64::from(at));
            Estimate {
                day: 0.1 * f64::from(at),
                value,
                low: value - 0.002,
                high: value + 0.002,
                temperature_c: Some(temperature),
                hours_since_start: None,
            }
        };
        (0..7).map(one).collect()
    }

    #[test]
    fn what_falls_with_temperature_is_warmth_and_what_grows_by_date_is_a_trend() {
        let temperature = |at: f64| 28.0 + (3.0 * at) % 5.0;
        let small = |at: f64| 0.001 * (5.0 * at).sin();
        let warm = estimates(|at| (1.2 - 0.01 * temperature(at) + small(at), temperature(at)));
        assert_eq!(so_far(&warm), SoFar::Warmth);
        let worn = estimates(|at| (0.5 + 0.02 * at + small(at), temperature(at)));
        assert_eq!(so_far(&worn), SoFar::Trend);
        let same = estimates(|at| (0.5 + 2.0 * small(at), temperature(at)));
        assert_eq!(so_far(&same), SoFar::Stable);
        assert_eq!(so_far(&same[..4]), SoFar::TooFew);
    }
}
