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
        self.plainer(self.forward(self.begun(start, penalties)), tie)
    }

    /// Finds the explanation, from pieces of physics with their penalties that are taken for true at first.
    pub fn run(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        let mut best = self.begun(start, penalties);
        best = self.named(best);
        if let Some(described) = self.described_for_intervals(&best) {
            (self.say)(&format!("? {}", describe(&described)));
            best = self.named(self.pruned(described));
        }
        // A body that the names take back might be described again for ever.
        for _ in self.unnamed_bodies {
            let Some(described) = self.embodied(&best) else {
                break;
            };
            (self.say)(&format!("? {}", describe(&described)));
            best = self.named(described);
        }
        for joint in 0..self.problem.joints {
            if let Some(described) = self.described(&best, joint) {
                (self.say)(&format!("? {}", describe(&described)));
                best = self.named(self.pruned(described));
            }
        }
        // What it was compared with until now is no measure of how precise its numbers are to be.
        best.fit = best.fit.refined(self.problem);
        self.parted(self.upheld(best))
    }

    fn begun(&self, start: Vec<Active>, penalties: Vec<f64>) -> Explanation {
        let fit = Fit::new(self.problem, start).refined(self.problem);
        self.pruned(Explanation { fit, penalties })
    }

    /// Adds and exchanges names until nothing is gained.
    fn named(&self, mut best: Explanation) -> Explanation {
        for _ in 0..MOST_ROUNDS {
            best = self.forward(best);
            let worth = &self.problem.worth;
            let exchanged = self.exchange(best.clone());
            let gained = exchanged.ahead_of(&best, worth) > LEAST_GAIN;
            best = exchanged;
            if !gained {
                break;
            }
        }
        self.plainer(self.culled(best), |_| MORE_THAN_SIMPLE)
    }
}
