//! Free bodies for a residual that no effect of the library fits: a link with other inertial parameters than in its
//! URDF.

use crate::physics::active::Active;
use crate::select::cross_validation::carries_over;
use crate::select::evidence::{CURVE_EVIDENCE, REFINED, overwhelming};
use crate::select::explanation::Explanation;
use crate::select::parallel;
use crate::select::propose::{Base, Proposal};

use crate::select::search::Search;

impl Search<'_> {
    /// The explanation with a free body for one link, if it is clearly better. Effects that only imitated the body are
    /// removed: couplings, gains and masses at many joints may together look like one body.
    pub fn with_free_body(&self, best: &Explanation) -> Option<Explanation> {
        let base = Base::new(self.problem, &best.fit, self.hypotheses.len());
        let there = |p: &Proposal| {
            let same = |a: &Active| a.hypothesis == p.active.hypothesis;
            best.fit.actives.iter().any(same)
        };
        let mut proposals: Vec<Proposal> = self
            .unnamed_bodies
            .iter()
            .filter_map(|hypothesis| base.propose(*hypothesis))
            .filter(|proposal| proposal.evidence() > CURVE_EVIDENCE && !there(proposal))
            .collect();
        proposals.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        proposals.truncate(REFINED);
        let effective = &self.problem.effective_samples;
        let with = parallel::map(&proposals, |proposal| {
            self.joined(best, proposal, best.fit.likelihood())
        });
        let better = with
            .into_iter()
            .max_by(|a, b| a.ahead_of(b, effective).total_cmp(&0.0))?;
        let body = better.fit.actives.last()?.hypothesis;
        let better = self.pruned(better);
        let stands = better.fit.actives.iter().any(|a| a.hypothesis == body);
        let evident =
            better.ahead_of(best, effective) > CURVE_EVIDENCE || overwhelming(&better, best);
        let all: Vec<usize> = (0..self.problem.joints).collect();
        (stands && evident && carries_over(self.problem, &better.fit, &best.fit, &all))
            .then_some(better)
    }
}
