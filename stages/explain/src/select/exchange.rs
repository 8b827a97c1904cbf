//! Removes each effect in turn and tries every rival in its place.

use crate::data::work::Untried;
use crate::physics::active::{Hypothesis, TimeKind};
use crate::select::curve_shapes::repeats;
use crate::select::evidence::{LEAST_GAIN, independent};
use crate::select::explanation::{Explanation, describe};
use crate::select::explanation::{Piece, pieces, place_of};
use crate::select::propose::{Base, Proposal};
use crate::select::search::Search;

/// A rival is refined only if its first-order gain is above this share of the gain of the effect that it would replace.
/// Tuned: by hand, on no recorded seeds; not swept.
const COULD_DO_BETTER: f64 = 0.85;

/// Explanations with more effects than this are not exchanged two effects at a time, which costs quadratic time.
/// Tuned: by hand, for what it costs in time; not swept.
const MOST_PAIRED: usize = 12;

impl Search<'_> {
    /// The best explanation with one of the proposals whose first-order gain suffices to compete with `best`.
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
        self.best_of(without, &able, best.fit.likelihood())
    }

    /// Removes each effect, then all pushes together, then each two effects at one joint, and tries all rivals in their
    /// place. One pass.
    pub fn exchange(&self, mut best: Explanation) -> Explanation {
        for piece in pieces(&best) {
            if self.problem.work.is_spent(Untried::OtherNames) {
                return best;
            }
            let Some(index) = place_of(&best, piece) else {
                continue;
            };
            let without = self.without(&best, index);
            if let Some(better) = self.replaced(&best, &without, index) {
                (self.say)(&describe(&better));
                best = better;
            }
        }
        // One wall can look like several pushes.
        let once = |&i: &usize| best.fit.actives[i].hypothesis.time_kind() == TimeKind::Once;
        let pushes: Vec<usize> = (0..best.fit.actives.len()).filter(once).collect();
        if pushes.len() > 1 {
            let less = |from: Explanation, index: &usize| self.without(&from, *index);
            let without = pushes.iter().rev().fold(best.clone(), less);
            let better = self.replaced(&best, &without, pushes[0]);
            if let Some(better) = better.or_else(|| self.with_wall(&best, &without)) {
                (self.say)(&describe(&better));
                best = better;
            }
        }
        let all = pieces(&best);
        if all.len() > MOST_PAIRED {
            return best;
        }
        for (i, a) in all.iter().enumerate() {
            for b in &all[..i] {
                if self.problem.work.is_spent(Untried::OtherNames) {
                    return best;
                }
                let joint = |piece: &Piece| piece.0.only_joint();
                let (Some(first), Some(second)) = (place_of(&best, *a), place_of(&best, *b)) else {
                    continue;
                };
                if joint(a).is_none() || joint(a) != joint(b) {
                    continue;
                }
                let (low, high) = (first.min(second), first.max(second));
                let without = self.without(&self.without(&best, high), low);
                if let Some(better) = self.replaced(&best, &without, low) {
                    (self.say)(&describe(&better));
                    best = better;
                }
            }
        }
        best
    }

    /// The explanation with a wall in place of all pushes, if it is better. Only a refinement finds the place of a
    /// wall, so its first-order gain is not asked for.
    fn with_wall(&self, best: &Explanation, without: &Explanation) -> Option<Explanation> {
        let wall = |h: &&Hypothesis| h.effect.is_surface();
        let hypothesis = self.hypotheses.iter().find(wall)?;
        let base = Base::new(self.problem, &without.fit, self.hypotheses.len());
        let proposal = base.propose_in_time(*hypothesis)?;
        let walled = self.joined(without, &proposal, best.fit.likelihood());
        // For pushes each row counts as one independent sample, so the wall must be better in this count, too.
        let white = vec![1.0; self.problem.joints];
        let is_better = |e: &Explanation| {
            let stands = e.fit.actives.iter().any(|a| wall(&&a.hypothesis));
            stands
                && e.ahead_of(best, &white) > LEAST_GAIN
                && e.ahead_of(best, &self.problem.effective_samples) > LEAST_GAIN
        };
        let walled = is_better(&walled).then(|| self.pruned(walled))?;
        is_better(&walled).then_some(walled)
    }

    /// The best explanation with a rival in place of the effects that `without` lacks, if it is better than `best`.
    /// `index` is the place in `best` of one of the removed effects.
    fn replaced(
        &self,
        best: &Explanation,
        without: &Explanation,
        index: usize,
    ) -> Option<Explanation> {
        // What carries over from one recording to the next is no slow noise.
        let removed = &best.fit.actives[index];
        let proposals = self.rivals(&without.fit, &best.fit, &best.fit.actives[index]);
        let other = self.rival_of(best, without, &proposals)?;
        let new = other.fit.actives.last()?.hypothesis;
        let effective = if removed.curve.is_some() && repeats(self.problem, &without.fit, removed) {
            vec![1.0; self.problem.joints]
        } else {
            independent(self.problem, &other.fit, new)
        };
        if other.ahead_of(best, &effective) <= LEAST_GAIN {
            return None;
        }
        let other = self.pruned(other);
        (other.ahead_of(best, &effective) > LEAST_GAIN).then_some(other)
    }
}
