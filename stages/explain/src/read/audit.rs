//! Whether the data allows a verdict at all, and what a reader should know of it.

use crate::read::input::Input;
use crate::read::recording::Recording;

/// Faster than this a joint counts as moving \[rad/s or m/s\].
pub const MOVES: f64 = 0.02;
/// A verdict needs a joint that moves for at least this long \[s\].
const LEAST_MOTION_S: f64 = 1.0;
/// And in some recording further than this: a push bends even an arm that holds still \[rad or m\].
const LEAST_RANGE: f64 = 0.05;

/// Why nothing can be said, found before anything is fitted.
pub fn before(input: &Input) -> Option<String> {
    if let Some(recording) = input.fit.iter().find(|r| r.effort.is_empty()) {
        return Some(format!("recording {} holds no effort", recording.name));
    }
    if !input.bodies && input.fit.iter().any(|r| r.reference.is_empty()) {
        return Some("the twin is a topic, and a recording does not hold it".to_owned());
    }
    if input.fit.iter().all(|r| r.effort.iter().all(|x| *x == 0.0)) {
        return Some("the effort is zero throughout: the driver does not publish it".to_owned());
    }
    if let Some(recording) = input
        .fit
        .iter()
        .find(|r| r.len() < 50 || r.duration_s() < 1.0)
    {
        return Some(format!(
            "recording {} holds {} samples over {:.2} s, which is too short",
            recording.name,
            recording.len(),
            recording.duration_s()
        ));
    }
    if input.fit.len() + input.holdout.len() < 2 && input.start.is_none() && !at_rest(input) {
        return Some(
            "there is one recording only: what is fitted on it cannot be proved on another. Record the same arm \
             once more, with another motion, or start from a corrected twin"
                .to_owned(),
        );
    }
    None
}

/// Whether no joint moves for as long, or as far, as a verdict on what lasts needs.
pub fn at_rest(input: &Input) -> bool {
    let n = input.model.dof();
    let stays = |j: usize| input.fit.iter().all(|r| range(r, j, n) < LEAST_RANGE);
    (0..n).all(|j| moving_s(&input.fit, j, n) < LEAST_MOTION_S || stays(j))
}

/// Whether no position ever changes, not by an encoder's step: then nobody publishes them.
pub fn is_frozen(recording: &Recording, n: usize) -> bool {
    (0..n).all(|j| range(recording, j, n) <= 0.0)
}

/// How far a joint moves in a recording \[rad or m\].
fn range(recording: &Recording, joint: usize, n: usize) -> f64 {
    let positions = recording.position.iter().skip(joint).step_by(n);
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = positions.fold(ends, |(low, high), q| (low.min(*q), high.max(*q)));
    high - low
}

/// How long a joint moves \[s\].
fn moving_s(recordings: &[Recording], joint: usize, n: usize) -> f64 {
    let mut sum = 0.0;
    for recording in recordings {
        // Over a tenth of a second, so that the encoder's noise is no motion.
        let rate = recording.len() as f64 / recording.duration_s().max(1e-3);
        let reach = ((0.1 * rate) as usize).max(1);
        for k in reach..recording.len() {
            let change =
                recording.position[k * n + joint] - recording.position[(k - reach) * n + joint];
            let passed = recording.time_s[k] - recording.time_s[k - reach];
            if change.abs() > MOVES * passed {
                sum += recording.time_s[k] - recording.time_s[k - 1];
            }
        }
    }
    sum
}

/// What was lost on reading, in words.
pub fn losses(input: &Input) -> Vec<String> {
    let mut notes = Vec::new();
    for recording in input.fit.iter().chain(&input.holdout) {
        let losses = &recording.losses;
        let mut parts = Vec::new();
        let mut add = |count: u64, what: &str| {
            if count > 0 {
                parts.push(format!("{count} {what}"));
            }
        };
        add(losses.repeated, "rows repeat a stamp");
        add(losses.not_finite, "rows are not finite and were dropped");
        add(
            losses.backward,
            "rows run backwards in time and were dropped",
        );
        add(losses.incomplete, "rows lack a joint and were dropped");
        add(losses.unreadable, "messages could not be read");
        add(
            losses.damaged,
            "parts of the file cannot be read, e.g. a torn tail",
        );
        if !parts.is_empty() {
            notes.push(format!("{}: {}.", recording.name, parts.join(", ")));
        }
    }
    notes
}
