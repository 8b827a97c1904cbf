//! Forward selection: adds one effect at a time, always the one with the most evidence.

use crate::data::work::Untried;
use crate::fit::fitted::Fit;
use crate::physics::active::{Hypothesis, TimeKind};
use crate::select::cross_validation::carries_over;
use crate::select::evidence::{
    LEAST_EVIDENCE, LEAST_GAIN, REFINED, independent, matters, needs, overwhelming,
};
use crate::select::explanation::{Explanation, describe};
use crate::select::parallel;
use crate::select::plausible::{is_timely, plausible};
use crate::select::propose::Proposal;
use crate::select::search::Search;

/// Where the residual is far above the noise, share of it that an effect must explain to be added.
/// Tuned: by hand, on no recorded seeds; not swept.
const LOUD_SIZE: f64 = 0.25;
/// Proposals of effects that the list of names lacks that are refined beside those of the list before one is taken.
/// Tuned: by hand, for what it costs in time; not swept.
const REFINED_UNLISTED: usize = 2;
/// Most effects in an explanation, torque scales not counted.
/// Tuned: by hand, for what it costs in time; not swept.
const MOST_PIECES: usize = 48;

/// An explanation that the search has come by.
struct Seen {
    hypotheses: Vec<Hypothesis>,
    likelihood: f64,
}

impl Seen {
    fn of(explanation: &Explanation) -> Self {
        let actives = explanation.fit.actives.iter();
        Self {
            hypotheses: actives.map(|active| active.hypothesis).collect(),
            likelihood: explanation.fit.likelihood(),
        }
    }

    /// Whether it has the effects of an `earlier` one and explains no more: then the search goes in circles.
    fn repeats(&self, earlier: &Self) -> bool {
        let count = |all: &[Hypothesis], one: &Hypothesis| all.iter().filter(|h| *h == one).count();
        let as_many = |h: &Hypothesis| count(&self.hypotheses, h) == count(&earlier.hypotheses, h);
        self.hypotheses.len() == earlier.hypotheses.len()
            && self.hypotheses.iter().all(as_many)
            && self.likelihood < earlier.likelihood + LEAST_GAIN
    }
}

impl Search<'_> {
    /// Adds effects while there is evidence for more.
    pub fn forward(&self, mut best: Explanation) -> Explanation {
        let pieces = |e: &Explanation| {
            e.fit
                .actives
                .iter()
                .filter(|a| !a.hypothesis.is_torque_scale())
                .count()
        };
        // An effect that was added and removed again would be added without end, and so would several in turn.
        let mut barred: Vec<Hypothesis> = Vec::new();
        let mut seen = vec![Seen::of(&best)];
        while pieces(&best) < MOST_PIECES {
            let mut proposals = self.proposals(&best.fit);
            proposals.retain(|p| !barred.contains(&p.active.hypothesis));
            let Some(next) = self.best_of(&best, &proposals, best.fit.likelihood()) else {
                break;
            };
            if self.problem.work.is_spent(Untried::FurtherEffects) {
                break;
            }
            (self.say)(&describe(&next));
            let new = next.fit.actives.last().map(|active| active.hypothesis);
            let next = self.pruned(next);
            let once = new.is_some_and(|new| new.time_kind() == TimeKind::Once);
            let counted = |new| independent(self.problem, &next.fit, new);
            let effective = new.map_or_else(|| self.problem.effective_samples.clone(), counted);
            let evident = next.ahead_of(&best, &effective) >= LEAST_EVIDENCE;
            let now = Seen::of(&next);
            let is_old = seen.iter().any(|seen| now.repeats(seen));
            if is_old || !evident && (once || !overwhelming(&next, &best)) {
                barred.extend(new);
                let fills = new.filter(|new| !is_old && new.effect.traits.fills_recording);
                if let Some(next) = fills.and_then(|new| self.in_each_recording(&best, new)) {
                    (self.say)(&describe(&next));
                    best = next;
                }
            } else {
                seen.push(now);
                best = next;
            }
        }
        best
    }

    /// The best explanation with one of the proposals, if one has enough evidence. It is refined as far as the
    /// comparison with the log-likelihood `rival` needs.
    pub fn best_of(
        &self,
        now: &Explanation,
        proposals: &[Proposal],
        rival: f64,
    ) -> Option<Explanation> {
        let promising = proposals.iter().filter(|p| {
            let (evidence, size) = needs(p.active.hypothesis, &now.fit);
            let possible = is_timely(self.problem, &p.active) && plausible(self.problem, &p.active);
            p.evidence() > evidence && p.size > size && possible
        });
        let mut promising: Vec<&Proposal> = promising.collect();
        // If the most promising proposals fail when refined, those at other joints are tried.
        while !promising.is_empty() {
            let tried = to_refine(&promising);
            if let Some(found) = self.best_refined(now, &tried, rival) {
                return Some(found);
            }
            let joints = |p: &Proposal| Fit::joints_of(&p.active.hypothesis, self.problem.joints);
            let spent: Vec<Vec<usize>> = tried.iter().map(|p| joints(p)).collect();
            promising.retain(|p| !spent.contains(&joints(p)));
        }
        None
    }

    /// The best explanation with one of these proposals, compared after refinement.
    fn best_refined(
        &self,
        now: &Explanation,
        promising: &[&Proposal],
        rival: f64,
    ) -> Option<Explanation> {
        let effective = &self.problem.effective_samples;
        let mut able: Vec<(Explanation, &Proposal)> = Vec::new();
        let joined = parallel::map(promising, |proposal| self.joined(now, proposal, rival));
        for (next, &proposal) in joined.into_iter().zip(promising) {
            let (evidence, _) = needs(proposal.active.hypothesis, &now.fit);
            let evident = next.ahead_of(now, effective) >= evidence || overwhelming(&next, now);
            let once = proposal.active.hypothesis.time_kind() == TimeKind::Once;
            if evident && (once || matters(self.problem, &next.fit, &now.fit, 0.0, LOUD_SIZE)) {
                able.push((next, proposal));
            }
        }
        able.sort_by(|(a, _), (b, _)| b.ahead_of(a, effective).total_cmp(&0.0));
        let mut able = able.into_iter();
        able.find(|(next, proposal)| {
            let joints = Fit::joints_of(&proposal.active.hypothesis, self.problem.joints);
            carries_over(self.problem, &next.fit, &now.fit, &joints)
        })
        .map(|(next, _)| next)
    }

    /// An explanation with a proposal, refined at the joints that it touches, as far as the comparison with the
    /// log-likelihood `rival` needs.
    pub fn joined(&self, now: &Explanation, proposal: &Proposal, rival: f64) -> Explanation {
        let joints = Fit::joints_of(&proposal.active.hypothesis, self.problem.joints);
        let fit = now.fit.with(self.problem, proposal.active.clone());
        Explanation {
            fit: fit.refined_at(self.problem, Some(&joints), rival),
            penalties: [&now.penalties[..], &[proposal.penalty]].concat(),
        }
    }
}

/// Proposals of a round that are refined before one is taken: the first of the list of names, and of those that come
/// before them the first that the list lacks. Rarer effects that fail must not crowd out the usual ones.
fn to_refine<'a>(promising: &[&'a Proposal]) -> Vec<&'a Proposal> {
    let (mut listed, mut unlisted) = (REFINED, REFINED_UNLISTED);
    let mut tried = Vec::new();
    for &proposal in promising {
        let is_off_list = proposal.active.hypothesis.effect.traits.is_off_list;
        let left = if is_off_list {
            &mut unlisted
        } else {
            &mut listed
        };
        if *left > 0 {
            *left -= 1;
            tried.push(proposal);
        }
        if listed == 0 {
            break;
        }
    }
    tried
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::work::Work;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn the_same_effects_that_explain_no_more_are_a_circle_in_any_order() {
        let seen = |effects: &[&str], likelihood: f64| Seen {
            hypotheses: effects.iter().map(|name| at_joint(name, 0)).collect(),
            likelihood,
        };
        let earlier = seen(&["coulomb_friction", "torque_bias"], 100.0);
        assert!(seen(&["torque_bias", "coulomb_friction"], 100.1).repeats(&earlier));
        assert!(!seen(&["torque_bias", "coulomb_friction"], 120.0).repeats(&earlier));
        assert!(!seen(&["torque_bias"], 90.0).repeats(&earlier));
        assert!(!seen(&["torque_bias", "torque_bias"], 90.0).repeats(&earlier));
    }

    #[test]
    fn a_search_at_its_bound_says_that_it_left_out_an_effect_for_which_there_was_evidence() {
        let found = |most: u64, friction_nm: f64| {
            let mut problem = problem_with(3, |_, qd, effort| effort[1] += friction_nm * qd[1]);
            problem.work = Work::bounded(most).into();
            let search = Search {
                problem: &problem,
                hypotheses: &[at_joint("viscous_friction", 1)],
                unnamed_bodies: &[],
                say: &|_| {},
            };
            // What a step costs before the search.
            problem.work.add(1);
            let found = search.first_guess(Vec::new(), Vec::new());
            (found.fit.actives.len(), problem.work.untried())
        };
        assert_eq!(found(u64::MAX, 2.0), (1, [].into()));
        assert_eq!(found(0, 2.0), (0, [Untried::FurtherEffects].into()));
        assert_eq!(found(0, 0.0), (0, [].into()), "nothing was left out");
    }

    #[test]
    fn effects_that_the_list_lacks_do_not_crowd_out_those_of_the_list() {
        let proposal = |effect: &str| Proposal {
            active: at_joint(effect, 0).with(Vec::new()),
            gain: 1.0,
            penalty: 0.0,
            size: 1.0,
        };
        let unlisted = ["friction_drift", "late_brake", "gear_efficiency"];
        let listed = [
            "coulomb_friction",
            "viscous_friction",
            "torque_bias",
            "torque_gain",
        ];
        let all: Vec<Proposal> = unlisted.into_iter().chain(listed).map(proposal).collect();
        let tried = to_refine(&all.iter().collect::<Vec<_>>());
        let tried = tried.iter().map(|p| p.active.hypothesis.effect.name);
        let expected = [&unlisted[..2], &listed[..3]].concat();
        assert_eq!(tried.collect::<Vec<_>>(), expected);
    }
}
