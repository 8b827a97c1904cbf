//! Numbers that a robot may have, and times that tell something.

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::problem::Problem;
use crate::physics::active::{Active, TimeKind};

/// What lasts for an interval of one recording lasts at most for this share of it; what lasts longer is not told from an offset.
const LONGEST_SHARE: f64 = 0.75;
/// What began or ended so much beside a recording began or ended with it \[s\].
const BESIDE_S: f64 = 0.5;
/// Whether the times of a piece of physics are ones that tell something: what comes and goes does both within a
/// recording.
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

/// Whether it is a wave over a joint's position that no gear makes: it does not close after a revolution.
pub fn is_open_wave(active: &Active) -> bool {
    let is_made_by_gears = active.hypothesis.effect.traits.is_made_by_gears;
    !is_made_by_gears(&active.coordinates)
}

/// Nearer than this to the end of its range, as a share of it, a shape is there.
const AT_BOUND: f64 = 1e-3;

/// Whether one of the shapes is where its range ends: then the effect may only be a way to say something else.
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

/// Whether the numbers are ones that a robot may have, as the effect itself knows them.
pub fn plausible(active: &Active, model: &Model) -> bool {
    let hypothesis = active.hypothesis;
    let site = hypothesis.place.site(model);
    hypothesis.effect.is_plausible(&site, &active.coordinates)
}
