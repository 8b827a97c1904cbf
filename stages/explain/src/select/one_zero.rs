//! One shifted joint zero in the place of several bodies, which together may look like it.

use tauscope_dynamics::terms::Family;

use crate::physics::active::{Active, Hypothesis};
use crate::select::evidence::LEAST_GAIN;
use crate::select::explanation::Explanation;
use crate::select::search::Search;

/// Fewer bodies than this are one story already.
/// Statistical: one number in the place of at least two effects.
const SEVERAL: usize = 2;

impl Search<'_> {
    /// The explanation with one shifted zero in the place of all bodies, with those added again that are still needed, if
    /// it is better.
    pub fn with_one_zero(&self, best: &Explanation) -> Option<Explanation> {
        let is_body =
            |a: &Active| a.hypothesis.lasts() && a.hypothesis.effect.family == Family::Body;
        let bodies: Vec<usize> = (0..best.fit.actives.len())
            .filter(|&i| is_body(&best.fit.actives[i]))
            .collect();
        if bodies.len() < SEVERAL {
            return None;
        }
        let less = |from: Explanation, index: &usize| self.without(&from, *index);
        let without = bodies.iter().rev().fold(best.clone(), less);
        let is_lasting = |h: &Hypothesis| h.is_zero_offset() && h.lasts();
        let proposals = self.proposals_of(&without.fit, is_lasting);
        let with = self.best_of(&without, &proposals, best.fit.likelihood())?;
        let offset = with.fit.actives.last()?.hypothesis;
        let with = self.pruned(self.forward(with));
        let stands = with.fit.actives.iter().any(|a| a.hypothesis == offset);
        let effective = &self.problem.effective_samples;
        (stands && with.ahead_of(best, effective) > LEAST_GAIN).then_some(with)
    }
}
