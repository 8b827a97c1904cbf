//! What differs from one recording to the next, all of them at once.

use crate::physics::active::Hypothesis;
use crate::select::evidence::overwhelming;
use crate::select::explanation::Explanation;
use crate::select::propose::Base;
use crate::select::search::Search;

/// Share of a joint's variance that is left at most.
/// Tuned: by hand, on no recorded seeds; not swept. Slow noise differs from recording to recording, too, but by less.
const MOST_LEFT: f64 = 0.25;

impl Search<'_> {
    /// `now` with an effect of one recording in each of them, if there is evidence for it in two at least. Taken from one
    /// recording alone it shows little, as what the others leave counts as slow noise: a vehicle that is parked elsewhere
    /// each time, another workpiece in each.
    pub fn in_each_recording(
        &self,
        now: &Explanation,
        hypothesis: Hypothesis,
    ) -> Option<Explanation> {
        let is_same = |explanation: &Explanation| {
            let actives = explanation.fit.actives.iter();
            actives
                .filter(|active| active.hypothesis == hypothesis)
                .count()
        };
        let mut next = now.clone();
        for track in 0..self.problem.tracks.len() {
            let base = Base::new(self.problem, &next.fit, self.hypotheses.len());
            if let Some(proposal) = base.propose_recording(hypothesis, track) {
                next = self.joined(&next, &proposal, next.fit.likelihood());
            }
        }
        let next = self.pruned(next);
        let mut variances = next.fit.variance.iter().zip(&now.fit.variance);
        let takes_most = variances.any(|(after, before)| *after < MOST_LEFT * before);
        let is_evident = takes_most && overwhelming(&next, now);
        (is_evident && is_same(&next) >= is_same(now) + 2).then_some(next)
    }
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, at_joint, model, problem, recording};
    use crate::physics::active::Whereabouts;

    /// Recordings of the small arm on a base that is pitched by so much in each \[rad\].
    fn pitches_said(pitch_rad: [f64; 4]) -> Vec<f64> {
        let level = model();
        let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
        let recordings: Vec<_> = (1..)
            .zip(pitch_rad)
            .map(|(seed, pitch)| {
                let mut leans = level.clone();
                leans.set_gravity([9.81 * pitch.sin(), 0.0, -9.81 * pitch.cos()]);
                recording(&leans, seed, |_, _, effort| {
                    for effort in effort {
                        *effort += 0.05 * noise.next();
                    }
                })
            })
            .collect();
        let problem = problem(&level, &recordings);
        let tilt = Hypothesis {
            effect: effect("base_tilt_in_recording").unwrap(),
            place: Whereabouts::default(),
        };
        let search = Search {
            problem: &problem,
            hypotheses: &[tilt, at_joint("coulomb_friction", 0)],
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let bare = Explanation {
            fit: Fit::new(&problem, Vec::new()),
            penalties: Vec::new(),
        };
        let found = search.in_each_recording(&bare, tilt);
        let actives = found.into_iter().flat_map(|found| found.fit.actives);
        actives.map(|active| active.coordinates[1]).collect()
    }

    #[test]
    fn a_base_that_stands_otherwise_each_time_is_told_for_each_recording() {
        let truth = [0.04, -0.03, 0.05, -0.06];
        let said = pitches_said(truth);
        assert_eq!(said.len(), truth.len(), "{said:?}");
        for (said, truth) in said.iter().zip(truth) {
            assert!((said - truth).abs() < 0.002, "{said} for {truth}");
        }
    }

    #[test]
    fn a_base_that_stands_level_or_leans_once_is_not_told_so() {
        assert!(pitches_said([0.0; 4]).is_empty());
        // One of them is an effect by itself.
        assert!(pitches_said([0.0, 0.0, 0.05, 0.0]).is_empty());
    }
}
