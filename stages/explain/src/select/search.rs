//! The contest: which pieces of physics, together, explain what the twin leaves.
//!
//! Forward, one piece at a time, always the one with the most evidence; after each the earlier ones must prove
//! themselves again; in the end each is taken out and every rival tried in its place.

use std::collections::BTreeSet;

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Layer, Time};

use crate::data::effective_samples;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::physics::torque_scale::is_drive;
use crate::select::cross_validation::carries_over;
use crate::select::parallel;
use crate::select::propose::{Base, Proposal};

use crate::select::curves::{CURVE_EVIDENCE, CURVE_SIZE, is_drawn_already};
use crate::select::evidence::{
    Explanation, LEAST_EVIDENCE, LEAST_GAIN, LEAST_SIZE, REFINED, describe, is_timely, matters,
    needs, overwhelming, plausible, tie, wald, worse_joints,
};
use crate::select::nested::MORE_THAN_SIMPLE;

/// Where much is left that no name fits, what a name must explain of it while there is more to be found, and in the end.
const LOUD_SIZE: f64 = 0.25;
const NAMED_SIZE: f64 = 0.5;
/// More pieces of physics than this are not looked for.
const MOST_PIECES: usize = 48;
/// So often pieces are added and all exchanged again.
const MOST_ROUNDS: usize = 2;
/// A joint whose variance is below this many times its white noise is not tried with costly effects.
const QUIET: f64 = 1.15;

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

/// The joints that carry a link.
pub fn bearing(model: &Model, link: usize) -> BTreeSet<usize> {
    let links = std::iter::successors(Some(link), |&link| model.links()[link].parent);
    links.filter_map(|link| model.links()[link].joint).collect()
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

    /// Takes out the names that explain less than half of what is left where they are and that is far above the noise: there
    /// something is that no name fits, and it could be what they seem to be. The smallest go first.
    fn culled(&self, mut best: Explanation) -> Explanation {
        loop {
            let names: Vec<usize> = (0..best.fit.actives.len())
                .filter(|&i| {
                    let active = &best.fit.actives[i];
                    let once = active.hypothesis.effect.time() == Time::Once;
                    !active.is_unnamed() && !once && !is_drive(&active.hypothesis)
                })
                .collect();
            let without = parallel::map(&names, |&i| self.less(&best, i));
            let size = |less: &Explanation| {
                let each = less.fit.variance.iter().zip(&best.fit.variance);
                each.map(|(less, best)| less / best).fold(0.0, f64::max)
            };
            let small = names.iter().zip(without).filter(|(_, less)| {
                !matters(self.problem, &best.fit, &less.fit, LEAST_SIZE, NAMED_SIZE)
            });
            let Some((&index, less)) = small.min_by(|(_, a), (_, b)| size(a).total_cmp(&size(b)))
            else {
                return best;
            };
            (self.say)(&format!(
                "- {}",
                best.fit.actives[index].hypothesis.effect.name
            ));
            best = less;
        }
    }

    /// Every hypothesis that could change the effort of one of `joints`, beside what `fit` holds, most evidence
    /// first.
    pub fn proposals(&self, fit: &Fit, joints: &[usize]) -> Vec<Proposal> {
        self.proposals_for(fit, |h| {
            h.only_joint().is_none_or(|joint| joints.contains(&joint))
        })
    }

    /// The rivals of one piece of physics, once it is taken out of `without`: friction has rivals in its joint alone.
    pub fn rivals(&self, without: &Fit, best: &Fit, active: &Active) -> Vec<Proposal> {
        let worse = worse_joints(without, best);
        let own = active.hypothesis.only_joint();
        let friction = active.is_set_valued(&self.problem.model)
            || active.hypothesis.effect.is_plain_friction();
        self.proposals_for(without, |h| match h.only_joint() {
            Some(joint) => worse.contains(&joint),
            None => !(friction && own.is_some()),
        })
    }

    fn proposals_for(&self, fit: &Fit, touches: impl Fn(&Hypothesis) -> bool) -> Vec<Proposal> {
        let base = Base::new(self.problem, fit, self.hypotheses.len());
        let wanted: Vec<Hypothesis> = self
            .hypotheses
            .iter()
            .filter(|h| touches(h) && self.is_worth_a_try(fit, **h))
            .copied()
            .collect();
        // A joint split in rotor and link is costly to try: where the rotor alone is no help, it is not.
        let simpler_helps = |split: &Hypothesis| {
            let Some(simpler) = split.effect.simpler else {
                return true;
            };
            let is =
                |h: &&Hypothesis| h.effect == simpler.effect && h.place.joint == split.place.joint;
            let hypothesis = self.hypotheses.iter().find(is);
            hypothesis.is_none_or(|h| base.propose(*h).is_some_and(|p| p.gain > LEAST_EVIDENCE))
                || fit.actives.iter().any(|a| is(&&a.hypothesis))
        };
        let wanted: Vec<Hypothesis> = wanted
            .into_iter()
            .filter(|h| !h.effect.splits_joint() || simpler_helps(h))
            .collect();
        let mut all: Vec<Proposal> = parallel::map(&wanted, |h| base.propose_in_time(*h))
            .into_iter()
            .flatten()
            .collect();
        all.sort_by(|a, b| {
            let place = |p: &Proposal| (p.active.hypothesis.effect.name, p.active.hypothesis.place);
            b.evidence()
                .total_cmp(&a.evidence())
                .then_with(|| place(a).cmp(&place(b)))
        });
        all
    }

    fn is_worth_a_try(&self, fit: &Fit, hypothesis: Hypothesis) -> bool {
        let same = fit
            .actives
            .iter()
            .filter(|active| active.hypothesis == hypothesis)
            .count();
        if same >= hypothesis.effect.traits.most_at_one_place || is_drawn_already(fit, hypothesis) {
            return false;
        }
        let excess = |j: usize| {
            fit.variance[j] > QUIET * self.problem.white_noise[j] * self.problem.white_noise[j]
        };
        match hypothesis.only_joint() {
            Some(joint) => excess(joint),
            None if hypothesis.effect.layer == Layer::Body
                && hypothesis.effect.place == tauscope_dynamics::terms::PlaceKind::Joint =>
            {
                excess(hypothesis.place.joint)
            }
            None => (0..self.problem.joints).any(excess),
        }
    }

    /// Adds pieces of physics while there is evidence for more.
    fn forward(&self, mut best: Explanation) -> Explanation {
        let pieces = |e: &Explanation| {
            e.fit
                .actives
                .iter()
                .filter(|a| !is_drive(&a.hypothesis))
                .count()
        };
        let all: Vec<usize> = (0..self.problem.joints).collect();
        // What is added and taken out again would be added for ever.
        let mut barred: Vec<Hypothesis> = Vec::new();
        while pieces(&best) < MOST_PIECES {
            let mut proposals = self.proposals(&best.fit, &all);
            proposals.retain(|p| !barred.contains(&p.active.hypothesis));
            let Some(next) = self.best_of(&best, &proposals, best.fit.likelihood()) else {
                break;
            };
            (self.say)(&format!("+ {}", describe(&next)));
            let new = next.fit.actives.last().map(|active| active.hypothesis);
            let next = self.pruned(next);
            let once = new.is_some_and(|new| new.effect.time() == Time::Once);
            // What lasts for a while makes noise look correlated as long as it is not explained.
            let worth = if once {
                effective_samples::at_least(self.problem, &next.fit)
            } else {
                self.problem.worth.clone()
            };
            let evident = next.ahead_of(&best, &worth) >= LEAST_EVIDENCE;
            if !evident && (once || !overwhelming(&next, &best)) {
                barred.extend(new);
            } else {
                best = next;
            }
        }
        best
    }

    /// The best explanation with one of the proposals, if there is evidence enough for any, refined to be compared with a
    /// `rival` likelihood.
    pub fn best_of(
        &self,
        now: &Explanation,
        proposals: &[Proposal],
        rival: f64,
    ) -> Option<Explanation> {
        let worthy = proposals.iter().filter(|p| {
            let (evidence, size) = needs(p.active.hypothesis, &now.fit);
            let possible =
                is_timely(self.problem, &p.active) && plausible(&p.active, &self.problem.model);
            p.evidence() > evidence && p.size > size && possible
        });
        let mut worthy: Vec<&Proposal> = worthy.collect();
        // Where those with the most promise do not keep it, as beside a piece that is stuck at its joint, those elsewhere may.
        while !worthy.is_empty() {
            let tried: Vec<&Proposal> = worthy.iter().take(REFINED).copied().collect();
            if let Some(found) = self.able(now, &tried, rival) {
                return Some(found);
            }
            let joints = |p: &Proposal| Fit::joints_of(&p.active.hypothesis, self.problem.joints);
            let spent: Vec<Vec<usize>> = tried.iter().map(|p| joints(p)).collect();
            worthy.retain(|p| !spent.contains(&joints(p)));
        }
        None
    }

    /// The best explanation with one of these proposals, as they are once they are refined.
    fn able(&self, now: &Explanation, worthy: &[&Proposal], rival: f64) -> Option<Explanation> {
        let worth = &self.problem.worth;
        let mut able: Vec<(Explanation, &Proposal)> = Vec::new();
        let joined = parallel::map(worthy, |proposal| self.joined(now, proposal, rival));
        for (next, &proposal) in joined.into_iter().zip(worthy) {
            let (evidence, _) = needs(proposal.active.hypothesis, &now.fit);
            let evident = next.ahead_of(now, worth) >= evidence || overwhelming(&next, now);
            let once = proposal.active.hypothesis.effect.time() == Time::Once;
            if evident && (once || matters(self.problem, &next.fit, &now.fit, 0.0, LOUD_SIZE)) {
                able.push((next, proposal));
            }
        }
        able.sort_by(|(a, _), (b, _)| b.ahead_of(a, worth).total_cmp(&0.0));
        let mut able = able.into_iter();
        able.find(|(next, proposal)| {
            let joints = Fit::joints_of(&proposal.active.hypothesis, self.problem.joints);
            carries_over(self.problem, &next.fit, &now.fit, &joints)
        })
        .map(|(next, _)| next)
    }

    /// An explanation with a proposal, refined where it touches to be compared with a `rival` likelihood.
    pub fn joined(&self, now: &Explanation, proposal: &Proposal, rival: f64) -> Explanation {
        let joints = Fit::joints_of(&proposal.active.hypothesis, self.problem.joints);
        let fit = now.fit.with(self.problem, proposal.active.clone());
        Explanation {
            fit: fit.refined_at(self.problem, Some(&joints), rival),
            penalties: [&now.penalties[..], &[proposal.penalty]].concat(),
        }
    }

    /// Takes out what is no longer needed.
    pub fn pruned(&self, mut best: Explanation) -> Explanation {
        'again: loop {
            let sure = self.sure(&best.fit);
            let doubtful = |&i: &usize| !sure[i] && !is_drive(&best.fit.actives[i].hypothesis);
            let doubtful: Vec<usize> = (0..sure.len()).filter(doubtful).collect();
            for some in doubtful.chunks(parallel::threads()) {
                let without = parallel::map(some, |&index| self.less(&best, index));
                for (&index, less) in some.iter().zip(without) {
                    if self.is_needed(&best, &less, index) {
                        continue;
                    }
                    (self.say)(&format!(
                        "- {}",
                        best.fit.actives[index].hypothesis.effect.name
                    ));
                    best = self.simpler(&best, &less, index).unwrap_or(less);
                    continue 'again;
                }
            }
            return best;
        }
    }

    /// Whether one of the pieces is needed, to judge by the explanation without it.
    fn is_needed(&self, best: &Explanation, less: &Explanation, index: usize) -> bool {
        let active = &best.fit.actives[index];
        let (evidence, least) = if active.is_unnamed() {
            (CURVE_EVIDENCE, CURVE_SIZE - 1.0)
        } else {
            needs(active.hypothesis, &best.fit)
        };
        let worth = &self.problem.worth;
        let strong = best.ahead_of(less, worth) >= evidence || overwhelming(best, less);
        let matters = matters(self.problem, &best.fit, &less.fit, least, least);
        let possible = is_timely(self.problem, active) && plausible(active, &self.problem.model);
        possible && strong && matters
    }

    /// Which pieces are beyond doubt by their own numbers, to first order: Wald's test, with much to spare.
    fn sure(&self, fit: &Fit) -> Vec<bool> {
        let wald = wald(self.problem, fit);
        let worth = &self.problem.worth;
        let each = fit.actives.iter().zip(wald);
        each.map(|(active, chi_square)| {
            let joints = Fit::joints_of(&active.hypothesis, self.problem.joints);
            let rows: f64 = joints.iter().map(|&j| fit.count[j]).sum();
            let worth = joints.iter().map(|&j| worth[j]).fold(1.0, f64::min);
            let (evidence, size) = needs(active.hypothesis, fit);
            is_timely(self.problem, active)
                && plausible(active, &self.problem.model)
                && !active.is_unnamed()
                && 0.5 * worth * chi_square > 4.0 * evidence + 60.0
                && chi_square > 4.0 * size * rows
        })
        .collect()
    }

    /// The explanation without one of its pieces, refined.
    pub fn less(&self, from: &Explanation, index: usize) -> Explanation {
        let mut penalties = from.penalties.clone();
        penalties.remove(index);
        let joints = Fit::joints_of(&from.fit.actives[index].hypothesis, self.problem.joints);
        Explanation {
            fit: from.fit.without(self.problem, index).refined_at(
                self.problem,
                Some(&joints),
                from.fit.likelihood(),
            ),
            penalties,
        }
    }
}
