//! The contest: which pieces of physics, together, explain what the twin leaves.
//!
//! Forward, one piece at a time, always the one with the most evidence; after each the earlier ones must prove
//! themselves again; in the end each is taken out and every rival tried in its place.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::select::evidence::{LEAST_GAIN, MORE_THAN_SIMPLE, tie};
use crate::select::explanation::{Explanation, describe};

/// So often pieces are added and all exchanged again.
const MOST_ROUNDS: usize = 2;

/// What can be tried, and on what.
pub struct Search<'a> {
    /// The data.
    pub problem: &'a Problem,
    /// The library.
    pub hypotheses: &'a [Hypothesis],
    /// Links whose bodies may be described where no name fits.
    pub unnamed_bodies: &'a [Hypothesis],
    /// Called now and then with a text.
    pub say: &'a (dyn Fn(&str) + Sync),
}

impl Search<'_> {
    /// Adds names one at a time, without a second look at any: enough to tell which joints have dry friction.
    pub fn first_guess(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        self.simplified(self.forward(self.started(start, penalties)), tie)
    }

    /// Finds the explanation, from pieces of physics with their penalties that are taken for true at first.
    pub fn run(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        let mut best = self.started(start, penalties);
        best = self.with_names(best);
        if let Some(described) = self.with_curve_for_intervals(&best) {
            (self.say)(&format!("? {}", describe(&described)));
            best = self.with_names(self.pruned(described));
        }
        // A body that the names take back might be described again for ever.
        for _ in self.unnamed_bodies {
            let Some(described) = self.with_free_body(&best) else {
                break;
            };
            (self.say)(&format!("? {}", describe(&described)));
            best = self.with_names(described);
        }
        for joint in 0..self.problem.joints {
            if let Some(described) = self.with_curve_at(&best, joint) {
                (self.say)(&format!("? {}", describe(&described)));
                best = self.with_names(self.pruned(described));
            }
        }
        // What it was compared with until now is no measure of how precise its numbers are to be.
        best.fit = best.fit.refined(self.problem);
        self.with_split_pushes(self.with_names_that_hold(best))
    }

    fn started(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        let fit = Fit::new(self.problem, start).refined(self.problem);
        self.pruned(Explanation { fit, penalties })
    }

    /// Adds and exchanges names until nothing is gained.
    fn with_names(&self, mut best: Explanation) -> Explanation {
        for _ in 0..MOST_ROUNDS {
            best = self.forward(best);
            let effective = &self.problem.effective_samples;
            let exchanged = self.exchange(best.clone());
            let gained = exchanged.ahead_of(&best, effective) > LEAST_GAIN;
            best = exchanged;
            if !gained {
                break;
            }
        }
        self.simplified(self.without_small(best), |_| MORE_THAN_SIMPLE)
    }
}
