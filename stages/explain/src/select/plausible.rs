//! Which parameters a robot may have, and which times can be told apart from an effect that always acts.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::problem::Problem;
use crate::physics::active::{Active, TimeKind};

/// An interval covers at most this share of its recording: a longer one cannot be told from an offset.
/// Tuned: by hand, on no recorded seeds; not swept.
const LONGEST_SHARE: f64 = 0.75;
/// An interval may begin this much before its recording and end this much after it \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const BESIDE_S: f64 = 0.5;

/// Whether the times of an effect can be told: an effect that acts once begins and ends within one recording.
pub fn is_timely(problem: &Problem, active: &Active) -> bool {
    let x = &active.coordinates;
    match active.hypothesis.time_kind() {
        TimeKind::Once => {
            let [.., start_s, end_s] = x[..] else {
                return true;
            };
            problem.tracks.iter().map(|t| &t.track).any(|track| {
                let first_s = track.session_s;
                let length_s = track.time_s.last().copied().unwrap_or(0.0);
                let within = start_s > first_s - BESIDE_S && end_s < first_s + length_s + BESIDE_S;
                within && end_s - start_s <= LONGEST_SHARE * length_s
            })
        }
        TimeKind::Always | TimeKind::Step | TimeKind::EveryRecording => true,
    }
}

/// Whether an effect is a wave over a joint's position that no gear makes, because it does not close after a
/// revolution.
pub fn is_open_wave(active: &Active) -> bool {
    let is_made_by_gears = active.hypothesis.effect.traits.is_made_by_gears;
    !is_made_by_gears(&active.coordinates)
}

/// A shape counts as at the end of its range if it is nearer than this share of the range.
/// Tuned: by hand, on no recorded seeds; not swept.
const AT_BOUND: f64 = 1e-3;

/// Whether one of the shapes with a logarithmic range is at an end of it: then the effect may imitate another one.
pub fn at_bound(active: &Active) -> bool {
    (0..active.coordinates.len()).any(|c| match active.kind(c) {
        CoordinateKind::Shape {
            lower,
            upper,
            scale: Scale::Log,
            ..
        } => {
            let share = (active.coordinates[c] / lower).ln() / (upper / lower).ln();
            !(AT_BOUND..=1.0 - AT_BOUND).contains(&share)
        }
        _ => false,
    })
}

/// Whether a robot may have these parameters, by the effect's own limits.
pub fn plausible(active: &Active, model: &Model) -> bool {
    let hypothesis = active.hypothesis;
    let site = hypothesis.place.site(model);
    hypothesis.effect.is_plausible(&site, &active.coordinates)
}
