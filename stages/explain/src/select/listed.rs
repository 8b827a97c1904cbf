//! Names of the list in the place of what the list lacks: an unknown is told only where no name does as well.

use tauscope_dynamics::terms::Family;

use crate::physics::active::Hypothesis;
use crate::select::evidence::{overwhelming, tie};
use crate::select::explanation::{Explanation, describe, pieces, place_of};
use crate::select::propose::Proposal;
use crate::select::search::Search;

/// Whether a report calls it unknown although it has a law.
fn is_unlisted(hypothesis: &Hypothesis) -> bool {
    hypothesis.effect.traits.is_off_list || hypothesis.is_unnamed_body()
}

impl Search<'_> {
    /// Puts an effect of the list in the place of each that the list lacks, unless the data tell the two apart.
    pub fn with_listed_names(&self, mut best: Explanation) -> Explanation {
        for piece in pieces(&best) {
            let unlisted = |&index: &usize| is_unlisted(&best.fit.actives[index].hypothesis);
            let Some(index) = place_of(&best, piece).filter(unlisted) else {
                continue;
            };
            let effective = &self.problem.effective_samples;
            let less = self.without(&best, index);
            let active = &best.fit.actives[index];
            let mut proposals: Vec<Proposal> = self.rivals(&less.fit, &best.fit, active);
            // A body that no name describes is at least the body of the same link.
            let own = active.hypothesis;
            let body = own.is_unnamed_body();
            proposals.retain(|p| {
                let hypothesis = p.active.hypothesis;
                let same = hypothesis.place.link == own.place.link
                    && hypothesis.effect.family == Family::Body;
                let is_worse_name = own.is_zero_offset() && self.is_moved_centre(hypothesis);
                !is_unlisted(&hypothesis) && !is_worse_name && (!body || same)
            });
            let Some(listed) = self.best_of(&less, &proposals, best.fit.likelihood()) else {
                continue;
            };
            let listed = self.pruned(listed);
            let enough = tie(best.ahead_of(&less, effective));
            let behind = best.ahead_of(&listed, effective);
            if behind < enough && !overwhelming(&best, &listed) {
                (self.say)(&describe(&listed));
                best = listed;
            }
        }
        best
    }
}
