//! Covariance and 95 % intervals of the numbers of an explanation.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::CoordinateKind;

use crate::data::problem::Problem;
use crate::fit::body_prior;
use crate::fit::fitted::{Fit, LEAST_VARIANCE};
use crate::physics::active::Active;

/// Lags over which the residual is taken to be correlated, in compared samples.
/// Tuned: by hand, on no recorded seeds; not swept.
const LAGS: usize = 6;
/// Standard deviation of a number from smoothing and differentiation, as a share of the number.
/// Tuned: on arms simulated by another engine, on no recorded seeds; not swept.
const SYSTEMATIC: f64 = 0.003;
/// The same for effects in the fastest part of the motion: around reversals and in the spring of a gear.
/// Tuned: on arms simulated by another engine, on no recorded seeds; not swept.
const SYSTEMATIC_WHEN_FAST: f64 = 0.02;
/// A change this near to a gap may lie within the gap, in periods of the cutoff.
/// Tuned: by hand, on no recorded seeds; not swept.
const NEAR_GAP_PERIODS: f64 = 0.5;
/// Half width of a 95 % interval of a normal variable, in standard deviations.
/// Statistical: the 97.5 % quantile of the standard normal distribution.
pub const HALF_WIDTH_95: f64 = 1.96;
/// Coefficients of b, b² and b³ in the 97.5 % critical value with Bartlett's weights.
/// Statistical: Kiefer and Vogelsang, "A New Asymptotic Theory for Heteroskedasticity-Autocorrelation Robust Tests",
/// 2005, table 1.
const BARTLETT_97_5: [f64; 3] = [2.9694, 0.4160, -0.5324];
/// Added to the diagonal of the normal matrix, scaled to 1.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;
/// Step of the difference quotient of a parameter, as a share of its coordinate's standard deviation.
/// Resolution: between the curvature over a long step and the rounding over a short one.
const STEP_OF_DEVIATION: f64 = 1e-3;
/// The same as a share of the coordinate, where its standard deviation is tiny.
/// Resolution: above the rounding of f64.
const LEAST_RELATIVE_STEP: f64 = 1e-9;

/// Half width of a 95 % interval of a number, in its standard deviations by [`covariance`].
///
/// The covariance is itself an estimate from a limited number of rows. On average it is too small, the more so the
/// larger the share b of its lags in the rows is.
pub fn half_width_95(problem: &Problem) -> f64 {
    let lags = (LAGS + 1) as f64 / f64::max(problem.rows as f64, 1.0);
    let b = lags.min(1.0);
    let [first, second, third] = BARTLETT_97_5;
    HALF_WIDTH_95 + b * (first + b * (second + b * third))
}

/// Covariance of all free coordinates of a fit, in the order of [`Fit::parameters`].
///
/// The sandwich `A⁻¹ B A⁻¹` with A the normal matrix and B the covariance of the scores, autocorrelation within
/// each recording counted with Bartlett's weights (Newey and West, "A Simple, Positive Semi-Definite,
/// Heteroskedasticity and Autocorrelation Consistent Covariance Matrix", 1987), but never less than white noise
/// of the variance that is left gives.
pub fn covariance(problem: &Problem, fit: &Fit) -> DMatrix<f64> {
    let jacobian = fit.jacobian(problem);
    let p = jacobian.len();
    let mut normal = DMatrix::<f64>::zeros(p, p);
    let mut scores = DMatrix::<f64>::zeros(p, p);
    for j in 0..problem.joints {
        let touching: Vec<(usize, &[f64])> = jacobian
            .iter()
            .enumerate()
            .filter_map(|(a, column)| Some((a, column.of_joint(j, problem.rows)?)))
            .collect();
        let variance = fit.squares[j] / (fit.count[j] - touching.len() as f64).max(1.0);
        let variance = variance.max(LEAST_VARIANCE);
        let rows = problem.joint_rows(j);
        for track in &problem.tracks {
            let mut past: Vec<DVector<f64>> = Vec::new();
            for row in track.rows() {
                let mut score = DVector::zeros(p);
                let at = rows.start + row;
                if problem.weight[at] > 0.0 {
                    let mut column = DVector::zeros(p);
                    for (a, values) in &touching {
                        column[*a] = values[row];
                    }
                    normal.ger(1.0 / variance, &column, &column, 1.0);
                    score = column * (fit.residual[at] / variance);
                }
                scores.ger(1.0, &score, &score, 1.0);
                for (lag, earlier) in past.iter().rev().take(LAGS).enumerate() {
                    let weight = 1.0 - (lag + 1) as f64 / (LAGS + 1) as f64;
                    scores.ger(weight, &score, earlier, 1.0);
                    scores.ger(weight, earlier, &score, 1.0);
                }
                past.push(score);
                if past.len() > LAGS {
                    past.remove(0);
                }
            }
        }
    }
    // The prior counts as if it had been measured, too.
    let (known, _) = body_prior::normal(&problem.model, &fit.actives, &fit.parameters());
    normal += &known;
    scores += known;
    // What no row depends on has no scale of its own, such as an end that lies beside a recording.
    let scale = |a: usize| normal[(a, a)].max(0.0).sqrt();
    let scale: Vec<f64> = (0..p)
        .map(scale)
        .map(|s| if s > 0.0 { s } else { 1.0 })
        .collect();
    let mut scaled = DMatrix::from_fn(p, p, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
    for a in 0..p {
        scaled[(a, a)] += RIDGE;
    }
    let Some(inverse) = scaled.try_inverse() else {
        return DMatrix::from_diagonal_element(p, p, f64::INFINITY);
    };
    let inverse = DMatrix::from_fn(p, p, |a, b| inverse[(a, b)] / (scale[a] * scale[b]));
    let mut covariance = &inverse * scores * &inverse;
    for a in 0..p {
        let (robust, white) = (covariance[(a, a)], inverse[(a, a)]);
        // Zero is what no row depends on: it stays so.
        if robust > 0.0 && robust < white {
            let grow = (white / robust).sqrt();
            for b in 0..p {
                covariance[(a, b)] *= grow;
                covariance[(b, a)] *= grow;
            }
        }
    }
    covariance
}

/// Standard deviations of the parameters of one effect, from the covariance of its coordinates. Systematic errors are
/// added: of smoothing and differentiation, and of a time that lies anywhere between two rows.
pub fn parameter_deviations(
    problem: &Problem,
    fit: &Fit,
    covariance: &DMatrix<f64>,
    index: usize,
) -> Vec<f64> {
    let first: usize = fit.actives[..index]
        .iter()
        .map(|a| a.coordinates.len())
        .sum();
    let active = &fit.actives[index];
    let count = active.coordinates.len();
    let mut own = covariance.view((first, first), (count, count)).into_owned();
    let times: Vec<bool> = (0..count).map(|c| is_time(active.kind(c))).collect();
    for c in (0..count).filter(|c| times[*c]) {
        // The variance of a time that is uniform over its interval.
        own[(c, c)] += between_rows(problem, active, c).powi(2) / 12.0;
    }
    let centre = active.parameters();
    let mut slopes = DMatrix::<f64>::zeros(centre.len(), count);
    for c in 0..count {
        let step = (STEP_OF_DEVIATION * own[(c, c)].max(0.0).sqrt())
            .max(LEAST_RELATIVE_STEP * active.coordinates[c].abs())
            .max(1e-12);
        if !step.is_finite() {
            return vec![f64::INFINITY; centre.len()];
        }
        let mut there = active.clone();
        there.coordinates[c] += step;
        for (row, (a, b)) in there.parameters().iter().zip(&centre).enumerate() {
            let mut change = a - b;
            // Angles may wrap between the two.
            if change.abs() > std::f64::consts::PI {
                change -= change.signum() * std::f64::consts::TAU;
            }
            slopes[(row, c)] = change / step;
        }
    }
    let spread = &slopes * own * slopes.transpose();
    let share = if active.hypothesis.effect.traits.is_fast {
        SYSTEMATIC_WHEN_FAST
    } else {
        SYSTEMATIC
    };
    let in_time = |row: usize| (0..count).any(|c| times[c] && slopes[(row, c)] != 0.0);
    (0..centre.len())
        .map(|row| {
            let systematic = if in_time(row) {
                0.0
            } else {
                share * centre[row]
            };
            (spread[(row, row)].max(0.0) + systematic * systematic).sqrt()
        })
        .collect()
}

fn is_time(kind: CoordinateKind) -> bool {
    matches!(
        kind,
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime
    )
}

/// The time between the two rows that an effect's time lies between \[s\]. Only rows that are compared at its joint
/// count. A time beside a gap may lie within the gap, because the filter bridges gaps.
fn between_rows(problem: &Problem, active: &Active, c: usize) -> f64 {
    let of_session = active.kind(c) == CoordinateKind::SessionTime;
    let joint = active.hypothesis.only_joint();
    let at = active.coordinates[c];
    let mut times: Vec<f64> = Vec::new();
    for track in &problem.tracks {
        let shift = if of_session {
            track.track.session_s
        } else {
            0.0
        };
        for (row, &k) in track.rows().zip(&track.compared) {
            if joint.is_none_or(|j| problem.weight[j * problem.rows + row] > 0.0) {
                times.push(shift + track.track.time_s[k]);
            }
        }
    }
    times.sort_by(f64::total_cmp);
    let near_s = NEAR_GAP_PERIODS / problem.cutoff_hz;
    let pairs = times.windows(2).map(|pair| [pair[0], pair[1]]);
    pairs
        .filter(|[first, last]| {
            let margin_s = if last - first > near_s { near_s } else { 0.0 };
            first - margin_s <= at && at < last + margin_s
        })
        .map(|[first, last]| last - first)
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    const TRUE: f64 = 0.8;

    /// A viscous friction and its half width, fitted with noise from a seed.
    fn fitted(seed: u64) -> (f64, f64) {
        let problem = problem_with(seed, |_, qd, effort| effort[0] += TRUE * qd[0]);
        let active = at_joint("viscous_friction", 0).with(vec![0.0]);
        let fit = Fit::new(&problem, vec![active]).refined(&problem);
        let spread = covariance(&problem, &fit);
        let deviation = parameter_deviations(&problem, &fit, &spread, 0)[0];
        (
            fit.actives[0].coordinates[0],
            half_width_95(&problem) * deviation,
        )
    }

    #[test]
    fn intervals_hold_the_true_number_nearly_always_and_are_no_wider_than_they_must_be() {
        let all: Vec<(f64, f64)> = (1..=20).map(fitted).collect();
        let held = all
            .iter()
            .filter(|(value, half)| (value - TRUE).abs() <= *half);
        assert!(held.count() >= 17, "{all:?}");
        let error = |(value, _): &(f64, f64)| (value - TRUE).powi(2);
        let rms = (all.iter().map(error).sum::<f64>() / 20.0).sqrt();
        let half = all.iter().map(|(_, half)| half).sum::<f64>() / 20.0;
        assert!(
            half < 6.0 * HALF_WIDTH_95 * rms,
            "{half} for errors of {rms}"
        );
    }

    #[test]
    fn fewer_rows_make_a_half_width_wider_than_the_normal_one() {
        let mut problem = problem_with(1, |_, _, _| {});
        let many = half_width_95(&problem);
        problem.rows = 20;
        assert!(many > HALF_WIDTH_95 && half_width_95(&problem) > many + 0.5);
    }
}
