//! Begins a joint anew from another first effect.
//!
//! Forward selection takes the strongest effect first. Where that one stands for a part of another (a gain for a
//! transmission coupling, Coulomb friction for one that depends on the direction), weaker effects then draw what is left,
//! and no exchange of one or two of them leads out. So the joint is emptied and begun with each of its next best effects.

use crate::data::work::Untried;
use crate::physics::active::Active;
use crate::select::evidence::LEAST_GAIN;
use crate::select::explanation::{Explanation, describe};
use crate::select::propose::Proposal;
use crate::select::search::Search;

/// A joint is begun anew if it has so many effects beside plain friction.
/// Tuned: by hand, for what it costs in time; not swept.
const LEAST_PIECES: usize = 2;
/// First effects that are tried.
/// Tuned: by hand, for what it costs in time; not swept.
const BEGINNINGS: usize = 3;

impl Search<'_> {
    /// The explanation with the effects of each joint chosen anew, where that is better.
    pub(super) fn restarted(&self, mut best: Explanation) -> Explanation {
        for joint in 0..self.problem.joints {
            if self.problem.work.is_spent(Untried::OtherNames) {
                break;
            }
            if let Some(better) = self.restarted_at(&best, joint) {
                (self.say)(&describe(&better));
                best = better;
            }
        }
        best
    }

    fn restarted_at(&self, best: &Explanation, joint: usize) -> Option<Explanation> {
        let is_own = |active: &Active| {
            active.hypothesis.only_joint() == Some(joint) && !active.hypothesis.is_torque_scale()
        };
        let actives = &best.fit.actives;
        let own: Vec<usize> = (0..actives.len())
            .filter(|&i| is_own(&actives[i]))
            .collect();
        let special = own
            .iter()
            .filter(|&&i| !actives[i].hypothesis.is_plain_friction());
        // A curve may draw anything, and was judged beside all names already.
        if special.count() < LEAST_PIECES || own.iter().any(|&i| actives[i].curve.is_some()) {
            return None;
        }
        let bare = self.stripped(best, &own, joint);
        let is_new = |p: &Proposal| {
            own.iter()
                .all(|&i| actives[i].hypothesis != p.active.hypothesis)
        };
        let mut beginnings = self.proposals_at(&bare.fit, joint);
        beginnings.retain(is_new);
        beginnings.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let effective = &self.problem.effective_samples;
        let tried = beginnings.iter().take(BEGINNINGS).map(|beginning| {
            let begun = self.joined(&bare, beginning, best.fit.likelihood());
            self.pruned(self.filled(begun, joint, own.len()))
        });
        let ahead = tried.map(|other| (other.ahead_of(best, effective), other));
        let (gain, other) = ahead.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (gain > LEAST_GAIN).then_some(other)
    }

    /// Adds up to `most` effects of a joint, each that with the most evidence.
    fn filled(&self, mut best: Explanation, joint: usize, most: usize) -> Explanation {
        for _ in 0..most {
            let proposals = self.proposals_at(&best.fit, joint);
            match self.best_of(&best, &proposals, best.fit.likelihood()) {
                Some(next) => best = next,
                None => break,
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, at_joint, problem_with};
    use crate::physics::active::Hypothesis;

    /// Friction that depends on the direction, in a joint that also bears a share of the other joint's effort; explained by
    /// what forward selection takes for it.
    #[test]
    fn a_joint_that_was_begun_with_the_wrong_effect_is_begun_anew() {
        let mut noise = Noise(7);
        let problem = problem_with(4, |_, qd, effort| {
            let friction = if qd[1] > 0.0 { 1.6 } else { -0.6 };
            effort[1] += friction + 0.08 * effort[0];
            for effort in effort {
                *effort += 0.02 * noise.next();
            }
        });
        let mut coupling: Hypothesis = at_joint("transmission_coupling", 1);
        coupling.place.source = 0;
        let names = [
            "coulomb_friction",
            "torque_gain",
            "counterbalance_spring",
            "asymmetric_coulomb",
        ];
        let library: Vec<Hypothesis> = (names.iter().map(|name| at_joint(name, 1)))
            .chain([coupling])
            .collect();
        let search = Search {
            problem: &problem,
            hypotheses: &library,
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let start = [vec![0.0], vec![0.0], vec![0.0; 2]];
        let wrong = library
            .iter()
            .zip(start)
            .map(|(h, at)| h.with(at))
            .collect();
        let best = Explanation {
            fit: Fit::new(&problem, wrong).refined(&problem),
            penalties: vec![5.0; 3],
        };
        let found = search.restarted(best);
        let mut told: Vec<&str> = found
            .fit
            .actives
            .iter()
            .map(|a| a.hypothesis.effect.name)
            .collect();
        told.sort_unstable();
        assert_eq!(told, ["asymmetric_coulomb", "transmission_coupling"]);
    }
}
