//! What a correction leaves on held-out recordings, beside the fitted ones and beside the twin as it was.

use tauscope_dynamics::terms::words::number;

use super::{Before, Left, rms_error, rms_rate};
use crate::report::sentences::UNCHANGED;

/// An explanation does not carry over at a joint if its error on held-out recordings is this many times that on fitted
/// ones, where both have the same rate of change of effort.
/// Tuned: by hand, on no recorded seeds; not swept.
const WORSE: f64 = 2.0;
/// The error on held-out recordings must also be this many times the measurement's white noise.
/// Tuned: by hand, on no recorded seeds; not swept.
pub(super) const ABOVE_NOISE: f64 = 3.0;
/// A correction makes a joint worse if its error on held-out recordings is this many times that of the twin as it was.
/// Tuned: by hand, with `tests/proof/first_sight.py`, seed 41, in view; not swept.
const WORSENED: f64 = 1.1;
/// What is said of a joint on held-out recordings.
pub(super) struct Held {
    pub sentences: Vec<String>,
    /// Whether the remainder is far larger there.
    pub is_elsewhere: bool,
    /// Whether it is larger than what the twin as it was leaves there.
    pub is_worsened: bool,
}

/// What is said of a joint on held-out recordings. `told` gives efforts in the recording's unit, and the joint's name.
pub(super) fn of_held(
    found: Left<'_>,
    before: Before<'_>,
    held: Left<'_>,
    j: usize,
    (told, joint): (&dyn Fn(f64) -> String, &str),
) -> Held {
    let (here, there) = (found.rms(j), held.rms(j));
    let faster = is_elsewhere(found, held, j);
    let mut sentences = Vec::new();
    if let Some(faster) = faster {
        let times = number(there / here);
        let than = than(faster);
        sentences.push(format!(
            "On the held-out recordings {} remain at joint {joint}, {times} times as much as on the fitted ones{than}: either \
             something acts on the held-out recordings only, or the correction does not carry over to them.",
            told(there)
        ));
    }
    let worsened = worsened(found, before, held, j);
    if let Some(uncorrected) = worsened {
        sentences.push(format!(
            "At joint {joint} the correction predicts the held-out recordings worse than the twin as it was: {} remain there, {} did \
             before. What acts at this joint is something else.",
            told(there),
            told(uncorrected)
        ));
    }
    Held {
        sentences,
        is_elsewhere: faster.is_some(),
        is_worsened: worsened.is_some(),
    }
}

/// How many times as fast the effort changes on held-out recordings, in words.
fn than(faster: f64) -> String {
    if faster <= 1.0 {
        return String::new();
    }
    let times = number(faster);
    format!(", although the effort changes only {times} times as fast there")
}

/// The error that the twin as it was leaves at a joint on held-out recordings, if the correction makes it larger.
fn worsened(found: Left<'_>, before: Before<'_>, held: Left<'_>, joint: usize) -> Option<f64> {
    let uncorrected = Left {
        problem: held.problem,
        fit: before.held?,
    };
    let (was, is) = (uncorrected.rms(joint), held.rms(joint));
    let is_corrected = found.fit.squares[joint] < UNCHANGED * before.fit.squares[joint];
    let is_seen = is > ABOVE_NOISE * found.problem.white_noise[joint];
    (is_corrected && is_seen && is > WORSENED * was).then_some(was)
}

/// Whether the error of a joint is much larger on held-out recordings, and how many times as fast as on the fitted ones the
/// effort changes there. The errors of clocks, filters and derivatives grow with that rate.
fn is_elsewhere(found: Left<'_>, held: Left<'_>, joint: usize) -> Option<f64> {
    let (own, there) = (found.rows(joint), held.rms(joint));
    // Fitted recordings differ among themselves, too: the worst of them is what the held-out ones are compared with.
    let each = own
        .chunk_by(|a, b| a.recording == b.recording)
        .map(rms_error);
    let here = each.fold(found.rms(joint), f64::max);
    let faster = rms_rate(&held.rows(joint)) / rms_rate(&own).max(f64::MIN_POSITIVE);
    let more = there > WORSE * faster.max(1.0) * here;
    (more && there > ABOVE_NOISE * found.problem.white_noise[joint]).then_some(faster)
}
