//! Excerpts of long sessions: computing time grows with the length of the data, findings hardly do.

use crate::read::recording::Recording;

/// Length of a session above which only excerpts are fitted \[s\].
/// Resolution: bounds the computing time.
const LONGEST_S: f64 = 400.0;
/// Length of an excerpt \[s\].
/// Physical: some strokes of a pick-and-place motion, between rests.
const EXCERPT_S: f64 = 20.0;

/// Length of a session and of its excerpts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excerpts {
    /// Length of the session \[s\].
    pub whole_s: f64,
    /// Total length of the excerpts \[s\].
    pub kept_s: f64,
}

/// Keeps excerpts of recordings that together are longer than [`LONGEST_S`], spread evenly over each of them. `None`
/// if they are shorter.
pub fn excerpts(recordings: &mut [Recording]) -> Option<Excerpts> {
    let length_s =
        |recordings: &[Recording]| recordings.iter().map(Recording::duration_s).sum::<f64>();
    let whole_s = length_s(recordings);
    if whole_s <= LONGEST_S || recordings.iter().any(Recording::is_of_poses) {
        return None;
    }
    // One of `one_in` stretches of an excerpt's length is kept.
    let one_in = whole_s / LONGEST_S;
    for recording in &mut *recordings {
        let is_kept = |time_s: &f64| {
            let stretch = (time_s / EXCERPT_S).floor();
            // The first one, then each that crosses the next multiple.
            (stretch / one_in).ceil() * one_in < stretch + 1.0
        };
        let kept: Vec<bool> = recording.time_s.iter().map(is_kept).collect();
        recording.keep(&kept);
    }
    let gaps_s = |recording: &Recording| -> f64 {
        let steps = recording.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        steps.filter(|step| *step > 0.5 * EXCERPT_S).sum()
    };
    let kept_s = length_s(recordings) - recordings.iter().map(gaps_s).sum::<f64>();
    Some(Excerpts { whole_s, kept_s })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{model, recording};

    /// Simulates recordings of these lengths at 5 Hz \[s\].
    fn session(lengths_s: &[usize]) -> Vec<Recording> {
        let of = |length: &usize| {
            let mut one = recording(&model(), 1, |_, _, _| {});
            let last = 5 * length;
            one.time_s = (0..=last).map(|k| 0.2 * k as f64).collect();
            for column in [&mut one.position, &mut one.velocity, &mut one.effort] {
                column.resize(2 * (last + 1), 0.0);
            }
            one.sample_of_row = (0..=last).map(Some).collect();
            one
        };
        lengths_s.iter().map(of).collect()
    }

    #[test]
    fn a_session_of_minutes_is_fitted_whole() {
        let mut all = session(&[100, 200]);
        assert_eq!(excerpts(&mut all), None);
        assert_eq!(all[1].len(), 1001);
    }

    #[test]
    fn of_an_hour_stretches_of_every_recording_are_kept() {
        let mut all = session(&[1800, 1200, 600]);
        let said = excerpts(&mut all).unwrap();
        assert!((said.whole_s - 3600.0).abs() < 1e-9);
        assert!((300.0..500.0).contains(&said.kept_s), "{said:?}");
        for (recording, whole_s) in all.iter().zip([1800.0, 1200.0, 600.0]) {
            let share = recording.len() as f64 / (5.0 * whole_s);
            assert!((0.08..0.16).contains(&share), "{share} of {whole_s} s");
            assert!(recording.time_s.last().unwrap() > &(0.6 * whole_s));
            assert_eq!(recording.position.len(), 2 * recording.len());
            assert_eq!(recording.losses.lost(), 0);
        }
    }
}
