//! 95 % intervals of the parameters of an explanation, from their covariance.

use nalgebra::DMatrix;
use tauscope_dynamics::terms::CoordinateKind;

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::physics::parameter_units::unit;

/// Relative standard deviation of a parameter from smoothing and differentiation.
/// Tuned: on arms simulated by another engine, on no recorded seeds; not swept.
const SYSTEMATIC: f64 = 0.003;
/// Relative standard deviation of effects in the fastest part of the motion: around reversals and in the spring of a
/// gear.
/// Tuned: on arms simulated by another engine, on no recorded seeds; not swept.
const SYSTEMATIC_WHEN_FAST: f64 = 0.02;
/// Distance from a gap below which a change may lie within the gap, in periods of the cutoff.
/// Chosen: half a period of the cutoff is what the comparison resolves in time.
const NEAR_GAP_PERIODS: f64 = 0.5;
/// Half width of a 95 % interval of a normal variable, in standard deviations.
/// Statistical: the 97.5 % quantile of the standard normal distribution.
pub const HALF_WIDTH_95: f64 = 1.96;
/// Step of a parameter's difference quotient, relative to its coordinate's standard deviation.
/// Resolution: between the truncation error of a long step and the rounding error of a short one.
const STEP_OF_DEVIATION: f64 = 1e-3;
/// Lower bound of that step, relative to the coordinate, where its standard deviation is tiny.
/// Resolution: above the rounding of f64.
const LEAST_RELATIVE_STEP: f64 = 1e-9;

/// Returns the standard deviations of the parameters of one effect, from the covariance of its coordinates.
/// Systematic errors are added: of smoothing and differentiation, and of a time that lies anywhere between two rows.
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
    let effect = active.hypothesis.effect;
    // A curve has more coordinates than named parameters.
    let is_angle = |row: usize| {
        let parameter = effect.parameters.get(row);
        parameter.is_some_and(|parameter| unit(parameter.name) == "rad")
    };
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
            if is_angle(row) && change.abs() > std::f64::consts::PI {
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

/// Returns the time between the two rows that enclose an effect's time \[s\], among the rows compared at its joint. A
/// time next to a gap may lie within the gap, because the filter bridges gaps.
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
