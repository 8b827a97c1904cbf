//! Each piece of physics is taken out in turn, and every rival tried in its place.

use super::{Explanation, Search, describe};
use crate::drive::is_drive;
use crate::propose::Proposal;

/// A rival may gain this much less to first order than what it is to replace.
const COULD_DO_BETTER: f64 = 0.85;

/// Beyond so many pieces of physics they are no longer exchanged two at a time: that grows with the square of them.
const MOST_PAIRED: usize = 12;

impl Search<'_> {
    /// The best of the proposals that could be better than `best`, by what they gain to first order.
    fn rival_of(
        &self,
        best: &Explanation,
        without: &Explanation,
        proposals: &[Proposal],
    ) -> Option<Explanation> {
        let gain = best.fit.likelihood() - without.fit.likelihood();
        let able: Vec<Proposal> = proposals
            .iter()
            .filter(|p| p.gain > COULD_DO_BETTER * gain)
            .cloned()
            .collect();
        self.best_of(without, &able)
    }

    /// Takes each piece out, and each two at one joint, and tries all rivals in their place.
    pub(super) fn exchange(&self, mut best: Explanation) -> Explanation {
        let mut index = 0;
        while index < best.fit.actives.len() {
            if is_drive(&best.fit.actives[index].hypothesis) {
                index += 1;
                continue;
            }
            let without = self.less(&best, index);
            let proposals = self.rivals(&without.fit, &best.fit, &best.fit.actives[index]);
            let worth = &self.problem.worth;
            if let Some(other) = self.rival_of(&best, &without, &proposals)
                && other.ahead_of(&best, worth) > 0.5
            {
                (self.say)(&format!("= {}", describe(&other)));
                let other = self.pruned(other);
                if other.ahead_of(&best, worth) > 0.5 {
                    best = other;
                    index = 0;
                    continue;
                }
            }
            index += 1;
        }
        let joint = |i: usize, best: &Explanation| {
            let hypothesis = &best.fit.actives[i].hypothesis;
            if is_drive(hypothesis) {
                None
            } else {
                hypothesis.only_joint()
            }
        };
        let mut pair = (0, 1);
        if best.fit.actives.len() > MOST_PAIRED {
            return best;
        }
        while pair.1 < best.fit.actives.len() {
            let (a, b) = pair;
            if joint(a, &best).is_some() && joint(a, &best) == joint(b, &best) {
                let without = self.less(&self.less(&best, b), a);
                let proposals = self.rivals(&without.fit, &best.fit, &best.fit.actives[a]);
                let worth = &self.problem.worth;
                if let Some(other) = self.rival_of(&best, &without, &proposals)
                    && other.ahead_of(&best, worth) > 0.5
                {
                    (self.say)(&format!("== {}", describe(&other)));
                    let other = self.pruned(other);
                    if other.ahead_of(&best, worth) > 0.5 {
                        best = other;
                        pair = (0, 1);
                        continue;
                    }
                }
            }
            pair.0 += 1;
            if pair.0 == pair.1 {
                pair = (0, pair.1 + 1);
            }
        }
        best
    }
}
