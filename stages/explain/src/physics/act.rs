//! Runs terms over the recordings.

use tauscope_dynamics::terms::{MotionSample, Physics, Term};

use crate::data::efforts::TrackEfforts;
use crate::data::problem::Problem;

/// The efforts `start` after `terms` have acted on them.
pub fn run(problem: &Problem, terms: Vec<Box<dyn Term>>, start: &[Vec<f64>]) -> TrackEfforts {
    if terms.is_empty() {
        return start.to_vec();
    }
    let mut physics = Physics::new(terms, problem.joints);
    let tracks = problem.tracks.iter().zip(start);
    tracks
        .map(|(track, start)| track.track.run(&mut physics, start))
        .collect()
}

/// The efforts `start` over all tracks after a term has acted on them, with the efforts that the gears transmit.
pub fn act_over(
    problem: &Problem,
    term: &mut dyn Term,
    start: &[Vec<f64>],
    transmitted: &[Vec<f64>],
) -> TrackEfforts {
    let n = problem.joints;
    let mut out = start.to_vec();
    for ((track, effort), transmitted) in problem.tracks.iter().zip(&mut out).zip(transmitted) {
        term.reset();
        track.track.each(|k, at| {
            let row = k * n..(k + 1) * n;
            let at = MotionSample {
                transmitted: &transmitted[row.clone()],
                ..*at
            };
            term.act(&at, &mut effort[row]);
        });
    }
    out
}
