//! Whether a joint leaves far more than the others do, each in units of its white noise.
//!
//! The slow noise of a measurement may be any number of times its fast noise. But drives and sensors of one arm are of one
//! kind, so that number is about the same at all joints. What one joint alone leaves is no noise of the measurement.

use tauscope_dynamics::terms::words::number;

use super::follows::clock_cost;
use super::{LOUD, Left, Row, rms_error};

/// A joint leaves far more than the others from this many times the median of theirs on.
/// Tuned: by hand, with `tests/proof/first_sight.py --beside friction,bodies --nulls 6 --kinds ""`, seed 5, and the same with
/// 4 and all kinds, seed 71, in view: arms without a fault reach 3.0, friction that comes and goes 23; not swept.
const FAR_MORE: f64 = 4.0;

/// What is told for another reason is of this joint from this many times the median of the others on.
/// Tuned: by hand, with `tests/proof/first_sight.py` in view, seed 41, and seed 42 beside friction and bodies: joints with a
/// fault reach 5.8 to 48, others 1.7; not swept.
const SEVERAL: f64 = 3.0;

/// What is told of the time is the worst of spans this long \[s\].
/// Resolution: as long as what people find again in a recording.
const SPAN_S: f64 = 1.0;

/// How many times its white noise a joint leaves, and how many times theirs the others do, if that is far less.
fn far_more(left: Left<'_>, joint: usize) -> Option<[f64; 2]> {
    let white = &left.problem.white_noise;
    let [times, usual] = beside(left, joint)?;
    // Errors of clocks and derivatives grow with the rate of the effort, which differs from joint to joint. The clock itself
    // is one for all: it is no worse than what the others leave allows.
    let clock = usual_of(left, joint, &|j| left.rms(j) / clock_cost(left, j))?.min(1.0);
    let is_clear = left.rms(joint) > LOUD * white[joint].max(clock * clock_cost(left, joint));
    (is_clear && times > FAR_MORE * usual).then_some([times, usual])
}

/// How many times its white noise a joint leaves, and how many times theirs the others do: their median, at least 1.
fn beside(left: Left<'_>, joint: usize) -> Option<[f64; 2]> {
    let times = |j: usize| left.rms(j) / left.problem.white_noise[j];
    let usual = usual_of(left, joint, &times)?.max(1.0);
    is_told(left, joint).then(|| [times(joint), usual])
}

/// Whether a joint leaves several times what the others do, each in units of its noise: then it is something of this joint.
pub(super) fn is_alone(left: Left<'_>, joint: usize) -> bool {
    beside(left, joint).is_some_and(|[times, usual]| times > SEVERAL * usual)
}

/// The median of what the joints beside `joint` have; nothing where no other joint tells.
fn usual_of(left: Left<'_>, joint: usize, of: &dyn Fn(usize) -> f64) -> Option<f64> {
    let others = (0..left.problem.joints).filter(|j| *j != joint && is_told(left, *j));
    let mut others: Vec<f64> = others.map(of).collect();
    others.sort_by(f64::total_cmp);
    others.get(others.len().saturating_sub(1) / 2).copied()
}

fn is_told(left: Left<'_>, joint: usize) -> bool {
    left.problem.white_noise[joint] > 0.0 && left.fit.count[joint] > 0.0
}

/// Recording, time \[s\] and root mean square of the second in which a joint leaves most.
fn most(left: Left<'_>, joint: usize) -> Option<(String, f64, f64)> {
    let rows = left.rows(joint);
    let span = |row: &Row| (row.time_s / SPAN_S) as usize;
    let is_same = |a: &Row, b: &Row| a.recording == b.recording && span(a) == span(b);
    let each = rows
        .chunk_by(is_same)
        .map(|rows| (&rows[0], rms_error(rows)));
    let (row, rms) = each.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let name = left.problem.tracks[row.recording].track.name.clone();
    Some((name, span(row) as f64 * SPAN_S, rms))
}

/// What is said of a joint that leaves far more than the others. `told` gives efforts in the recording's unit.
pub(super) fn beside_others(
    left: Left<'_>,
    joint: usize,
    told: &dyn Fn(f64) -> String,
) -> Option<String> {
    let [times, usual] = far_more(left, joint)?;
    let when = most(left, joint).map_or_else(String::new, |(name, time_s, rms)| {
        format!(
            ", most of it ({}) in {name} in the second after {time_s:.0} s",
            told(rms)
        )
    });
    Some(format!(
        "That is {} times its white noise, where most joints leave {} times theirs{when}. So it is no noise of the measurement, and \
         it has no name. No curve of the motion predicts it from one recording to the next: it comes and goes, or depends on \
         something that was not recorded.",
        number(times),
        number(usual)
    ))
}
