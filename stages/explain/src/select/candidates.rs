//! Which hypotheses are tried beside a fit, sorted by their evidence.

use tauscope_dynamics::terms::{Layer, PlaceKind};

use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::select::evidence::{LEAST_EVIDENCE, is_drawn_already, worse_joints};
use crate::select::parallel;
use crate::select::propose::{Base, Proposal};
use crate::select::search::Search;

/// No effect is tried at a joint whose variance is at most this many times that of its white noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const QUIET: f64 = 1.15;

impl Search<'_> {
    /// Proposals of every hypothesis, beside the effects of `fit`. Most evidence first.
    pub fn proposals(&self, fit: &Fit) -> Vec<Proposal> {
        self.proposals_of(fit, |_| true)
    }

    /// Proposals of every hypothesis that changes the effort of this joint alone, as [`Search::proposals`].
    pub fn proposals_at(&self, fit: &Fit, joint: usize) -> Vec<Proposal> {
        self.proposals_of(fit, |h| h.only_joint() == Some(joint))
    }

    /// Rivals of `active`, an effect of `best` that `without` lacks. Rivals of friction act in its joint alone.
    pub fn rivals(&self, without: &Fit, best: &Fit, active: &Active) -> Vec<Proposal> {
        let worse = worse_joints(without, best);
        let own = active.hypothesis.only_joint();
        let friction =
            active.is_set_valued(&self.problem.model) || active.hypothesis.is_plain_friction();
        self.proposals_of(without, |h| match h.only_joint() {
            Some(joint) => worse.contains(&joint),
            None => !(friction && own.is_some()),
        })
    }

    /// Proposals of the hypotheses of one kind, as [`Search::proposals`].
    pub fn proposals_of(&self, fit: &Fit, is: impl Fn(&Hypothesis) -> bool) -> Vec<Proposal> {
        let base = Base::new(self.problem, fit, self.hypotheses.len());
        let wanted: Vec<Hypothesis> = self
            .hypotheses
            .iter()
            .filter(|h| is(h) && self.is_candidate(fit, **h))
            .copied()
            .collect();
        // An effect that splits a joint in rotor and link is costly to try. It is tried only where the rotor alone
        // helps.
        let simpler_helps = |split: &Hypothesis| {
            let Some(simpler) = split.effect.simpler else {
                return true;
            };
            let is_simpler =
                |h: &&Hypothesis| h.effect == simpler.effect && h.place.joint == split.place.joint;
            let hypothesis = self.hypotheses.iter().find(is_simpler);
            hypothesis.is_none_or(|h| base.propose(*h).is_some_and(|p| p.gain > LEAST_EVIDENCE))
                || fit.actives.iter().any(|a| is_simpler(&&a.hypothesis))
        };
        let wanted: Vec<Hypothesis> = wanted
            .into_iter()
            .filter(|h| !h.has_rotor() || simpler_helps(h))
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

    fn is_candidate(&self, fit: &Fit, hypothesis: Hypothesis) -> bool {
        let same = fit
            .actives
            .iter()
            .filter(|active| active.hypothesis == hypothesis)
            .count();
        if same >= hypothesis.effect.traits.most_at_one_place || is_drawn_already(fit, hypothesis) {
            return false;
        }
        // What is put on the tool and what is taken off it are one body.
        let is_tool = |h: Hypothesis| h.is_body() && h.lasts();
        let other = |a: &Active| is_tool(a.hypothesis) && a.hypothesis != hypothesis;
        if is_tool(hypothesis) && fit.actives.iter().any(other) {
            return false;
        }
        let excess = |j: usize| {
            fit.variance[j] > QUIET * self.problem.white_noise[j] * self.problem.white_noise[j]
        };
        match hypothesis.only_joint() {
            Some(joint) => excess(joint),
            None if hypothesis.effect.layer == Layer::Body
                && hypothesis.effect.place == PlaceKind::Joint =>
            {
                excess(hypothesis.place.joint)
            }
            None => (0..self.problem.joints).any(excess),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    /// Whether there is more evidence for the effect `name` in the second joint than for what else may act there.
    fn is_before_its_rivals(name: &str, add: impl FnMut(&[f64], &[f64], &mut [f64])) -> bool {
        let problem = problem_with(5, add);
        let nothing = Fit::new(&problem, Vec::new());
        let base = Base::new(&problem, &nothing, 40);
        let evidence = |name| {
            let proposal = base.propose(at_joint(name, 1));
            proposal.map_or(f64::NEG_INFINITY, |proposal| proposal.evidence())
        };
        let rivals = [
            "drive_deadband",
            "sensor_hysteresis",
            "friction_drift",
            "coulomb_friction",
            "asymmetric_coulomb",
            "load_dependent_friction",
            "gear_efficiency",
            "torque_bias",
            "torque_gain",
            "counterbalance_spring",
            "torque_saturation",
        ];
        let mut rivals = rivals.into_iter().filter(|rival| *rival != name);
        let own = evidence(name);
        own > LEAST_EVIDENCE && rivals.all(|rival| evidence(rival) < own)
    }

    #[test]
    fn what_a_drive_loses_is_told_from_what_turns_with_the_motion() {
        assert!(is_before_its_rivals("drive_deadband", |_, _, effort| {
            effort[1] += 0.4 * effort[1].signum();
        }));
    }

    #[test]
    fn a_sensor_that_lags_behind_its_torque_is_told_from_friction() {
        let (mut before, mut stop) = (0.0, 0.0_f64);
        assert!(is_before_its_rivals("sensor_hysteresis", |_, _, effort| {
            let change = effort[1] - before;
            before = effort[1];
            stop = (stop + change).clamp(-1.5, 1.5);
            effort[1] -= 0.3 * stop;
        }));
    }
}
