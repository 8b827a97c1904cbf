//! Compares a finding with its rivals: each takes its place in the explanation.

use crate::physics::active::{Active, Hypothesis};
use crate::report::sentences;
use crate::select::evidence::{independent, tie};
use crate::select::explanation::Explanation;
use crate::select::search::Search;

/// How many rivals of a finding are refined and reported.
/// Tuned: for what it costs in time, on no recorded seeds; not swept.
const RIVALS: usize = 5;

/// The result of the comparison.
pub struct Contest {
    /// Rivals that this data cannot tell from the finding.
    pub ties: Vec<Hypothesis>,
    /// Rivals that fit worse, each with the reason.
    pub rejected: Vec<(Hypothesis, String)>,
}

impl Contest {
    /// The same where an effect is told as `plain`, and is a rival itself.
    pub fn told_as(mut self, plain: &Active, active: &Active) -> Self {
        let is_other = |h: &Hypothesis| *h != plain.hypothesis;
        self.rejected.retain(|(rejected, _)| is_other(rejected));
        self.ties.retain(is_other);
        self.ties.insert(0, active.hypothesis);
        self
    }
}

/// Compares one effect with its rivals.
pub fn contest(
    search: &Search<'_>,
    found: &Explanation,
    less: &Explanation,
    active: &Active,
) -> Contest {
    let mut result = Contest {
        ties: Vec::new(),
        rejected: Vec::new(),
    };
    if active.is_unnamed() {
        return result;
    }
    let effective = &independent(search.problem, &found.fit, active.hypothesis);
    let evidence = found.ahead_of(less, effective);
    let proposals = search.rivals(&less.fit, &found.fit, active);
    // A rarer law that contains the effect is no other answer: with the rest of it at nothing it is the effect.
    let contains = |rival: &Hypothesis| {
        let simpler = rival.effect.simpler.map(|simpler| simpler.effect);
        rival.effect.traits.is_off_list
            && rival.place == active.hypothesis.place
            && simpler == Some(active.hypothesis.effect)
    };
    let is_rival = |h: &Hypothesis| *h != active.hypothesis && !contains(h);
    let rivals = proposals
        .iter()
        .filter(|p| is_rival(&p.active.hypothesis) && p.evidence() > 0.0);
    for proposal in rivals.take(RIVALS) {
        let other = search.joined(less, proposal, found.fit.likelihood());
        let behind = found.ahead_of(&other, effective);
        let hypothesis = proposal.active.hypothesis;
        if behind < tie(evidence) {
            result.ties.push(hypothesis);
            continue;
        }
        let share = ((other.fit.likelihood() - less.fit.likelihood())
            / (found.fit.likelihood() - less.fit.likelihood()).max(1e-9))
        .clamp(0.0, 1.0);
        let reason = format!(
            "in place of {} it explains {:.0} % of what that explains; the recordings are {} times less likely with it",
            active.hypothesis.effect.words.noun,
            100.0 * share,
            sentences::odds(behind)
        );
        result.rejected.push((hypothesis, reason));
    }
    result
}
