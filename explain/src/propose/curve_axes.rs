//! Arguments of the curves that are tried in a joint, and their knots.

use tauscope_dynamics::JointKind;
use tauscope_dynamics::terms::{Against, Gauge, MotionSample, Table};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;

/// Number of knots of a curve.
/// Resolution: of a curve with a few bends.
const KNOTS: usize = 10;
/// Smallest number of distinct knots of a curve.
/// Statistical: two knots are a straight line, which effects of the library already describe.
const LEAST_KNOTS: usize = 3;
/// Distance below which knots are merged, relative to their mean spacing.
/// Resolution: of the knots.
const LEAST_SPACING: f64 = 0.2;
/// Relative velocity of two joints within which the friction between them changes its sign, as a share of the
/// fastest.
/// Resolution: as for standstills, 0.01 rad/s, of a motion at 0.5 rad/s.
const JUMP_SHARE: f64 = 0.02;
/// Hysteresis bands of the grid, in standard deviations of the load.
/// Resolution: steps of about three; the knots resolve what lies between.
const HYSTERESIS: [f64; 3] = [0.1, 0.3, 1.0];
/// Number of knots of a hysteresis to either side of its middle.
/// Resolution: straight in between, so half the band is resolved.
const KNOTS_OF_SIDE: usize = 2;
/// First knot after a standstill; each further one is at twice the time \[s\].
/// Resolution: near the comparison's fastest response, 1 / (2 pi 8 Hz) = 0.02 s, and its spacing of 0.06 s.
const FIRST_S: f64 = 0.1;
/// Time after which the effect of a standstill has decayed \[s\].
/// Physical: brakes, lubricants and springs settle within seconds; what takes longer is seen over the session.
const SETTLED_S: f64 = 10.0;

/// Number of knots of a curve over the travel since the last reversal; the first is at 1/64 of the joint's range.
/// Resolution: a thirtieth of a radian on a range of two; what winds up by less is friction at rest.
const OCTAVES: u32 = 7;

/// Returns the curves that are tried in a joint.
pub fn curves(problem: &Problem, joint: usize) -> Vec<Table> {
    let mut all = Vec::new();
    let mut add = |against: Against, of_joint: usize, knots: Vec<f64>, signs: &[bool]| {
        if knots.len() < LEAST_KNOTS && against != Against::SessionTime {
            return;
        }
        for &by_direction in signs {
            all.push(Table {
                against,
                of_joint,
                by_direction,
                period: None,
                values: vec![0.0; knots.len()],
                knots: knots.clone(),
            });
        }
    };
    let even =
        |against, of_joint, count| even_quantiles(readings(problem, against, of_joint), count);
    let position = even(Against::Position, joint, KNOTS);
    add(Against::Position, joint, position, &[false, true]);
    // Friction jumps at standstill, so curves over the velocity change sign with the direction of motion.
    let velocity = even(Against::Velocity, joint, KNOTS);
    add(Against::Velocity, joint, velocity, &[true]);
    // Friction between two moving parts depends on their relative velocity.
    if !problem.is_foreign && is_comparable_to_next(problem, joint) {
        for against in [Against::VelocityDifference, Against::VelocitySum] {
            let speeds = with_jump(even(against, joint, KNOTS));
            add(against, joint, speeds, &[false]);
        }
    }
    for against in [Against::Acceleration, Against::Load, Against::RecordingTime] {
        add(against, joint, even(against, joint, KNOTS), &[false, true]);
    }
    let driven = with_zero(even(Against::DrivenLoad, joint, KNOTS));
    add(Against::DrivenLoad, joint, driven, &[true]);
    for knots in hysteresis_knots(problem, joint) {
        add(Against::LoadTurned, joint, knots, &[false]);
    }
    let rested = since_rest_knots(problem, joint);
    add(Against::SinceRest, joint, rested, &[false, true]);
    // An effort that builds up after each reversal opposes the motion.
    add(
        Against::SinceTurn,
        joint,
        since_turn_knots(problem, joint),
        &[true],
    );
    // A straight line, because curvature over the session cannot be distinguished from slow noise.
    if let Some(ends) = session_ends(problem, joint) {
        add(Against::SessionTime, joint, ends.to_vec(), &[false, true]);
    }
    all
}

/// Returns the knots of hystereses with several bands \[N m or N\], where the joint bears a load that changes.
fn hysteresis_knots(problem: &Problem, joint: usize) -> Vec<Vec<f64>> {
    let spread = deviation(&readings(problem, Against::Load, joint));
    let sides = 0..=2 * KNOTS_OF_SIDE;
    let of_band = |band: f64| {
        let at = |k: usize| band * (k as f64 / KNOTS_OF_SIDE as f64 - 1.0);
        sides.clone().map(at).collect()
    };
    let bands = HYSTERESIS.iter().map(|share| share * spread);
    bands.filter(|band| *band > 0.0).map(of_band).collect()
}

/// Returns the knots over the time since the last standstill \[s\], each twice the one before, as far as the joint
/// moves.
fn since_rest_knots(problem: &Problem, joint: usize) -> Vec<f64> {
    let since_rest = readings(problem, Against::SinceRest, joint);
    let longest = since_rest.iter().copied().filter(|t| *t < SETTLED_S);
    let longest = longest.fold(0.0, f64::max);
    let times = (0..).map(|k| FIRST_S * f64::from(1 << k));
    let times = times.take_while(|t| *t <= longest);
    std::iter::once(0.0).chain(times).collect()
}

/// Returns the knots over the travel since the last reversal \[rad or m\], each twice the one before, as far as the
/// joint moves in one direction.
fn since_turn_knots(problem: &Problem, joint: usize) -> Vec<f64> {
    let position = readings(problem, Against::Position, joint);
    let least = position.iter().copied().fold(f64::INFINITY, f64::min);
    let most = position.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let ways = (0..OCTAVES).map(|k| (most - least) / f64::from(1 << k));
    std::iter::once(0.0).chain(ways.rev()).collect()
}

/// Returns the first and the last time of the session \[s\], if they differ.
fn session_ends(problem: &Problem, joint: usize) -> Option<[f64; 2]> {
    let session = readings(problem, Against::SessionTime, joint);
    let first = session.iter().copied().fold(f64::INFINITY, f64::min);
    let last = session.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (first < last).then_some([first, last])
}

/// Whether a joint has a next one in the URDF whose velocity has the same unit.
fn is_comparable_to_next(problem: &Problem, joint: usize) -> bool {
    let slides = |joint: usize| problem.model.joints()[joint].kind == JointKind::Prismatic;
    joint + 1 < problem.joints && slides(joint) == slides(joint + 1)
}

/// Returns the argument of a curve at all samples.
fn readings(problem: &Problem, against: Against, of_joint: usize) -> Vec<f64> {
    let mut values = Vec::new();
    for track in &problem.tracks {
        let mut gauge = Gauge::new(against, of_joint, 0.0);
        let read = |_, at: &MotionSample<'_>| values.push(gauge.read(at));
        track.track.each(read);
    }
    values
}

/// Returns `count` even quantiles of `values`; those that are too close to each other are merged.
fn even_quantiles(mut values: Vec<f64>, count: usize) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    let mut knots: Vec<f64> = (0..count).map(|k| values[last * k / (count - 1)]).collect();
    let least = LEAST_SPACING / count as f64 * (knots[count - 1] - knots[0]);
    knots.dedup_by(|later, earlier| *later - *earlier <= least);
    knots
}

/// Moves the knot nearest to zero to zero.
fn with_zero(mut knots: Vec<f64>) -> Vec<f64> {
    let nearest = (0..knots.len()).min_by(|a, b| knots[*a].abs().total_cmp(&knots[*b].abs()));
    if let Some(nearest) = nearest {
        knots[nearest] = 0.0;
    }
    knots
}

/// Replaces the knots near zero by two on either side of it, so that a curve can jump there as friction does.
fn with_jump(mut knots: Vec<f64>) -> Vec<f64> {
    let [Some(first), Some(last)] = [knots.first().copied(), knots.last().copied()] else {
        return knots;
    };
    let beside = JUMP_SHARE * first.abs().max(last.abs());
    if !(first < -beside && last > beside) {
        return knots;
    }
    knots.retain(|knot| knot.abs() > beside);
    let middle = knots.partition_point(|knot| *knot < 0.0);
    knots.splice(middle..middle, [-beside, beside]);
    knots
}

/// Returns the standard deviation.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
    (squares / count).sqrt()
}

/// Returns the effort of a unit value at each free knot of a curve, in addition to the effects of `fit`.
pub(crate) fn knot_columns(problem: &Problem, fit: &Fit, curve: &Active) -> Vec<Column> {
    let free = curve.coordinates.len();
    let unit = |k: usize| {
        let mut unit = curve.clone();
        unit.coordinates = (0..free)
            .map(|other| f64::from(u8::from(other == k)))
            .collect();
        fit.added(problem, &unit)
    };
    (0..free).map(unit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_may_jump_at_zero_and_only_there() {
        assert_eq!(
            with_jump(vec![-2.0, -0.5, 0.01, 0.7, 1.0]),
            [-2.0, -0.5, -0.04, 0.04, 0.7, 1.0]
        );
        assert_eq!(with_jump(vec![0.1, 0.5, 1.0]), [0.1, 0.5, 1.0]);
    }
}
