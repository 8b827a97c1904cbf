//! Which parameters a robot may have, and which times can be told apart from an effect that always acts.

use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::problem::Problem;
use crate::physics::active::{Active, TimeKind};
use crate::physics::friction::with_known;

/// An interval covers at most this share of its recording: a longer one cannot be told from an offset.
/// Tuned: by hand, on no recorded seeds; not swept.
const LONGEST_SHARE: f64 = 0.75;
/// An interval may begin this much before its recording and end this much after it \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const BESIDE_S: f64 = 0.5;

/// What changes steadily changes over the session by at least this share of its larger end: less is what friction does from
/// day to day.
/// Tuned: as the least step of friction; not swept.
const LEAST_DRIFT: f64 = 0.3;
/// A gain that changes steadily changes by at least this share: less is what the fit of a wrong body does.
/// Physical: a motor that warms up by 10 K.
const LEAST_GAIN_DRIFT: f64 = 0.01;
/// And leaves at least this share of it: no friction comes from nothing or goes for good.
/// Tuned: as the least that a step of friction leaves; not swept.
const LEAST_LEFT: f64 = 0.1;

/// Whether the times of an effect can be told: an effect that acts once begins and ends within one recording, unless it
/// spans them, and one that changes steadily changes enough over the session.
pub fn is_timely(problem: &Problem, active: &Active) -> bool {
    let x = &with_known(problem, active);
    if let Some(at) = active.hypothesis.effect.traits.drifts {
        let (first_s, last_s) = problem.session_s();
        let (first, last) = (at(x, first_s), at(x, last_s));
        let (less, more) = (first.min(last), first.max(last));
        let least = if active.hypothesis.effect.traits.is_scale {
            LEAST_GAIN_DRIFT
        } else {
            LEAST_DRIFT
        };
        return more - less > least * more && less >= LEAST_LEFT * more;
    }
    match active.hypothesis.time_kind() {
        TimeKind::Once if active.hypothesis.effect.traits.in_session => true,
        TimeKind::Once => {
            let [.., start_s, end_s] = x[..] else {
                return true;
            };
            problem.tracks.iter().map(|t| &t.track).any(|track| {
                let first_s = track.session_s;
                let length_s = track.time_s.last().copied().unwrap_or(0.0);
                let within = start_s > first_s - BESIDE_S && end_s < first_s + length_s + BESIDE_S;
                let fills = active.hypothesis.effect.traits.fills_recording;
                within && (fills || end_s - start_s <= LONGEST_SHARE * length_s)
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
pub fn plausible(problem: &Problem, active: &Active) -> bool {
    let hypothesis = active.hypothesis;
    let site = hypothesis.place.site(&problem.model);
    let coordinates = with_known(problem, active);
    hypothesis.effect.is_plausible(&site, &coordinates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn friction_that_drifts_changes_by_a_third_and_does_not_vanish() {
        let problem = problem_with(1, |_, _, _| {});
        let (first_s, last_s) = problem.session_s();
        let drifts = |first: f64, last: f64| {
            let growth = (last - first) / (last_s - first_s);
            let drift = at_joint("friction_drift", 0);
            is_timely(
                &problem,
                &drift.with(vec![first - growth * first_s, growth]),
            )
        };
        assert!(drifts(1.0, 2.0) && drifts(2.0, 1.0));
        assert!(!drifts(1.0, 1.2) && !drifts(1.0, 0.05));
    }

    #[test]
    fn friction_that_a_twin_knows_may_grow_from_what_it_was() {
        let mut problem = problem_with(1, |_, _, _| {});
        let step = at_joint("friction_step", 0).with(vec![0.0, 2.0, 5.0]);
        // None comes from nothing.
        assert!(!plausible(&problem, &step));
        problem.known_friction[0].insert("coulomb_friction", 3.0);
        assert!(plausible(&problem, &step));
        // As much as it does from day to day.
        let small = at_joint("friction_step", 0).with(vec![0.0, 0.5, 5.0]);
        assert!(!plausible(&problem, &small));
    }
}
