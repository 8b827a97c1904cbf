//! Evaluation of terms and robots over the recordings.

use std::sync::Arc;

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{MotionSample, Physics, Term};

use crate::data::efforts::TrackEfforts;
use crate::data::problem::Problem;
use crate::data::track::FitTrack;

/// Returns the efforts `start` after `terms` have acted on them.
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

/// Returns the efforts `start` over all tracks after a term has acted on them, with the efforts that the gears
/// transmit.
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

/// Computes the effort of a model over the motion of all tracks or, if not `moving`, the effort against gravity
/// alone.
pub fn over_tracks(problem: &Problem, model: &Model, moving: bool) -> TrackEfforts {
    let of = |track: &FitTrack| track.track.rigid_effort(model, moving);
    problem.tracks.iter().map(of).collect()
}

/// Computes the effort of a robot along the recorded motion, for [`Term::know_recorded`].
pub fn recorded(problem: &Problem, model: &Model) -> Arc<Vec<f64>> {
    Arc::new(over_tracks(problem, model, true).concat())
}
