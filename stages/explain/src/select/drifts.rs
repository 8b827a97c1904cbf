//! Friction that is drawn as a straight line over the session has a name: it is the law of an effect that drifts.

use tauscope_dynamics::terms::Against;

use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::select::explanation::{Explanation, describe};
use crate::select::plausible::is_timely;
use crate::select::search::Search;

impl Search<'_> {
    /// The explanation with friction that drifts in the place of each straight line over the session that turns its sign
    /// with the direction of motion. The effort is the same.
    pub fn with_drifts_named(&self, mut best: Explanation) -> Explanation {
        let mut actives = best.fit.actives.clone();
        let mut is_named = false;
        for active in &mut actives {
            if let Some(drift) = self.drift_of(active) {
                *active = drift;
                is_named = true;
            }
        }
        if is_named {
            best.fit = Fit::new(self.problem, actives);
            (self.say)(&describe(&best));
        }
        best
    }

    /// The friction that drifts as a line over the session does, if friction may do so.
    fn drift_of(&self, active: &Active) -> Option<Active> {
        let line = active.curve.as_ref()?;
        let &[first_s, last_s] = &line.knots[..] else {
            return None;
        };
        if line.against != Against::SessionTime || !line.by_direction {
            return None;
        }
        let joint = active.hypothesis.place.joint;
        let mut all = self.hypotheses.iter();
        let is_friction = |h: &Hypothesis| {
            let simpler = h.effect.simpler;
            simpler.is_some_and(|simpler| simpler.effect.is_plain_friction())
        };
        let drifts = all.find(|h| {
            h.effect.traits.drifts.is_some() && is_friction(h) && h.place.joint == joint
        })?;
        let ends = active.values_at_knots(line);
        let growth = (ends[1] - ends[0]) / (last_s - first_s);
        let drift = drifts.with(vec![ends[0] - growth * first_s, growth]);
        is_timely(self.problem, &drift).then_some(drift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};
    use tauscope_dynamics::terms::Table;

    #[test]
    fn a_line_over_the_session_is_named_with_the_same_effort() {
        let problem = problem_with(1, |_, _, _| {});
        let (first_s, last_s) = problem.session_s();
        let hypotheses = [at_joint("friction_drift", 1)];
        let search = Search {
            problem: &problem,
            hypotheses: &hypotheses,
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let line = |ends: [f64; 2]| {
            let mut line = at_joint("unknown", 1).with(ends.to_vec());
            line.curve = Some(Table {
                against: Against::SessionTime,
                of_joint: 1,
                by_direction: true,
                period: None,
                knots: vec![first_s, last_s],
                values: vec![0.0; 2],
            });
            let fit = Fit::new(&problem, vec![line]);
            let penalties = vec![0.0];
            Explanation { fit, penalties }
        };
        let drawn = line([1.0, 2.0]);
        let named = search.with_drifts_named(drawn.clone());
        assert_eq!(named.fit.actives[0].hypothesis, hypotheses[0]);
        let off = (named.fit.squares[1] - drawn.fit.squares[1]).abs();
        assert!(off < 1e-6 * drawn.fit.squares[1]);
        // Friction that changes by so little from day to day keeps its curve.
        let steady = search.with_drifts_named(line([1.0, 1.1]));
        assert!(steady.fit.actives[0].curve.is_some());
    }
}
