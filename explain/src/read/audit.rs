//! Audit of the recordings: whether they allow a verdict, and the losses on reading.

use tauscope_session::by_recording;

use crate::read::input::{FOR_ONE_HELD_OUT, Input};
use crate::read::recording::Recording;

/// Smallest range of a moving joint in some recording: a push bends even an arm that holds still \[rad or m\].
/// Physical: 50 N at 1 m bend a compliant joint of 1000 N m/rad that far.
const LEAST_RANGE: f64 = 0.05;
/// Smallest number of samples of a recording.
/// Chosen: a second at 50 Hz, [`LEAST_DURATION_S`]; slower recordings must be longer.
const LEAST_SAMPLES: usize = 50;
/// Shortest recording \[s\].
/// Chosen: eight periods of a cutoff of 8 Hz, of which the margins at the ends take 1.6.
const LEAST_DURATION_S: f64 = 1.0;
/// Returns the reason against a verdict before any fit, if there is one.
pub fn before(input: &Input) -> Option<String> {
    if let Some(recording) = input.fit.iter().find(|r| r.effort.is_empty()) {
        return Some(format!("recording {} holds no effort", recording.name));
    }
    if !input.bodies && input.fit.iter().any(|r| r.reference.is_empty()) {
        return Some("the twin's effort is a topic, and a recording does not have it".to_owned());
    }
    if input.fit.iter().all(|r| r.effort.iter().all(|x| *x == 0.0)) {
        return Some("the effort is zero throughout, so it is not measured".to_owned());
    }
    if let Some(recording) = input
        .fit
        .iter()
        .find(|r| r.len() < LEAST_SAMPLES || r.duration_s() < LEAST_DURATION_S)
    {
        return Some(format!(
            "recording {} holds {} samples over {:.2} s, which is too short",
            recording.name,
            recording.len(),
            recording.duration_s()
        ));
    }
    // The held-out part of a single recording must be long enough, too.
    let is_short = |r: &Recording| {
        let part = 1.0 / FOR_ONE_HELD_OUT as f64;
        r.len() < FOR_ONE_HELD_OUT * LEAST_SAMPLES || part * r.duration_s() < LEAST_DURATION_S
    };
    if input.is_parted() && !at_rest(input) && input.fit.iter().any(is_short) {
        return Some(
            "there is only one recording, and it is too short for a part of it to be held out. Record the same arm once more, \
             with another motion, or start from a corrected twin"
                .to_owned(),
        );
    }
    None
}

/// Whether no joint moves far enough for a verdict on lasting effects.
pub fn at_rest(input: &Input) -> bool {
    let n = input.model.dof();
    let stays = |j: usize| input.fit.iter().all(|r| range(r, j, n) < LEAST_RANGE);
    (0..n).all(stays)
}

/// Whether no position ever changes, not even by one encoder step: the driver does not publish positions.
pub fn is_frozen(recording: &Recording, n: usize) -> bool {
    (0..n).all(|j| range(recording, j, n) <= 0.0)
}

/// Whether a joint's effort is constant to the last bit while the joint moves, so it is not measured.
pub fn is_unmeasured(recording: &Recording, joint: usize, n: usize) -> bool {
    let mut efforts = recording.effort.iter().skip(joint).step_by(n);
    let first = efforts.next();
    range(recording, joint, n) > LEAST_RANGE && efforts.all(|effort| Some(effort) == first)
}

/// Returns the range of a joint's positions in a recording \[rad or m\].
fn range(recording: &Recording, joint: usize, n: usize) -> f64 {
    let positions = recording.position.iter().skip(joint).step_by(n);
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = positions.fold(ends, |(low, high), q| (low.min(*q), high.max(*q)));
    high - low
}

/// Returns the faults of each recording, one sentence each: the findings on reading, the unused parts, and the clock
/// on which the samples were placed.
pub fn losses(input: &Input) -> Vec<String> {
    let recordings = || input.fit.iter().chain(&input.holdout);
    let found: Vec<_> = recordings()
        .map(|recording| (recording.name.clone(), recording.findings.clone()))
        .collect();
    let mut notes = by_recording(&found);
    for recording in recordings() {
        let name = &recording.name;
        let losses = &recording.losses;
        let counted = [
            (losses.repeated, "rows repeat a stamp and its values"),
            (
                losses.stale,
                "rows repeat the measurement of the row before under a new stamp",
            ),
            (
                losses.unmeasured,
                "rows hold no effort, or zeros at all joints, and are not used: another publisher, or drives that were off",
            ),
            (
                losses.damaged,
                "parts of the file cannot be read, e.g. a torn tail",
            ),
        ];
        for (count, what) in counted.into_iter().filter(|(count, _)| *count > 0) {
            notes.push(format!("{name}: {count} {what}."));
        }
        if let Some(clock) = &recording.clock {
            notes.push(clock.note(name, recording.is_timed_by_log()));
        }
    }
    for recording in &input.holdout {
        let lost = recording.sample_of_row.iter().filter(|it| it.is_none());
        let lost = lost.count();
        if lost > 0 {
            notes.push(format!(
                "{}: the predictions of the {lost} rows that were left out are NaN in the table of predictions.",
                recording.name
            ));
        }
    }
    notes
}
