//! The search for the effects that together explain the residual.
//!
//! Effects are added one at a time, always the one with the most evidence. After each, the earlier ones are tested
//! again. In the end each effect is removed and every rival tried in its place.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::select::evidence::{LEAST_GAIN, MORE_THAN_SIMPLE, tie};
use crate::select::explanation::{Explanation, describe, left_out};
use crate::select::plausible::plausible;

/// Rounds of adding effects and exchanging all of them.
/// Tuned: by hand, for what it costs in time; not swept.
const MOST_ROUNDS: usize = 2;

/// Data and hypotheses of a search.
pub struct Search<'a> {
    /// The data.
    pub problem: &'a Problem,
    /// The hypotheses of the library.
    pub hypotheses: &'a [Hypothesis],
    /// Free bodies, one per link, which describe a residual that no effect of the library fits.
    pub unnamed_bodies: &'a [Hypothesis],
    /// Takes lines of progress.
    pub say: &'a (dyn Fn(&str) + Sync),
}

impl Search<'_> {
    /// Adds effects without exchanging any. That is enough to find the joints with dry friction.
    pub fn first_guess(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        self.simplified(self.forward(self.started(start, penalties)), tie)
    }

    /// Finds the explanation, starting from the effects `start` with their penalties.
    pub fn run(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        let mut best = self.started(start, penalties);
        best = self.with_names(best);
        if let Some(described) = self.with_curve_for_intervals(&best) {
            (self.say)(&describe(&described));
            best = self.with_names(self.pruned(described));
        }
        // Bounded: effects may replace a free body, which would then be proposed again without end.
        for _ in self.unnamed_bodies {
            let Some(described) = self.with_free_body(&best) else {
                break;
            };
            (self.say)(&describe(&described));
            best = self.with_names(described);
        }
        for joint in 0..self.problem.joints {
            if let Some(described) = self.with_curve_at(&best, joint) {
                (self.say)(&describe(&described));
                best = self.with_names(self.pruned(described));
            }
        }
        best = self.with_listed_names(self.with_drifts_named(best));
        best = self.fully_refined(best);
        self.without_hidden(self.with_split_pushes(self.with_names_that_hold(best)))
    }

    /// So far it was refined only as far as comparisons needed. Now its parameters are refined fully. What that carries to
    /// where no robot has it is removed.
    fn fully_refined(&self, mut best: Explanation) -> Explanation {
        best.fit = best.fit.refined(self.problem);
        let beyond = |active: &Active| !plausible(self.problem, active);
        while let Some(index) = best.fit.actives.iter().position(beyond) {
            (self.say)(&left_out(&best, index));
            best = self.without(&best, index);
            best.fit = best.fit.refined(self.problem);
        }
        best
    }

    fn started(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        let fit = Fit::new(self.problem, start).refined(self.problem);
        self.pruned(Explanation { fit, penalties })
    }

    /// Adds and exchanges effects until nothing is gained.
    fn with_names(&self, mut best: Explanation) -> Explanation {
        for _ in 0..MOST_ROUNDS {
            best = self.forward(best);
            let effective = &self.problem.effective_samples;
            let mut exchanged = self.restarted(self.exchange(best.clone()));
            if let Some(better) = self.with_one_zero(&exchanged) {
                (self.say)(&describe(&better));
                exchanged = better;
            }
            let gained = exchanged.ahead_of(&best, effective) > LEAST_GAIN;
            best = exchanged;
            if !gained {
                break;
            }
        }
        self.simplified(self.without_small(best), |_| MORE_THAN_SIMPLE)
    }
}
