//! Effects that contain a simpler one. The simpler one is reported unless the other is much likelier.

use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::fit::covariance::covariance;
use crate::fit::fitted::Fit;
use crate::fit::interval::half_width_95;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::select::evidence::{LEAST_EVIDENCE, independent, overwhelming, tie, worse_joints};
use crate::select::explanation::{Explanation, describe};
use crate::select::explanation::{pieces, place_of};
use crate::select::plausible::at_bound;
use crate::select::propose::penalty;

use crate::select::search::Search;

/// Whether the effect at `index` in `best` is not worth its further number: it only divides what the simple one sums up, as
/// friction of each direction does, and leaves no less at any joint. Gears of all makes turn a little harder one way.
fn is_slight(best: &Explanation, simple: &Explanation, index: usize) -> bool {
    let hypothesis = &best.fit.actives[index].hypothesis;
    let divides = hypothesis.is_linear() && hypothesis.time_kind() == TimeKind::Always;
    divides && worse_joints(&simple.fit, &best.fit).is_empty()
}

impl Search<'_> {
    /// Replaces an effect by the simpler one that it contains, unless it is ahead by `enough` \[nats\], a function of
    /// the evidence for the effect, and leaves less at some joint. An effect with a shape at the end of its range, or that
    /// nothing determines, must be ahead by [`tie`]. Where both hold, the effect is the simpler one: a gear that is as stiff
    /// as a gear can be, and perhaps infinitely so, is a rotor.
    pub fn simplified(&self, mut best: Explanation, enough: impl Fn(f64) -> f64) -> Explanation {
        for piece in pieces(&best) {
            let Some(index) = place_of(&best, piece) else {
                continue;
            };
            let less = self.without(&best, index);
            let own = best.fit.actives[index].hypothesis;
            let effective = &independent(self.problem, &best.fit, own);
            let evidence = best.ahead_of(&less, effective);
            let at_end = at_bound(&best.fit.actives[index]);
            let enough = match (at_end, self.is_vague(&best.fit, index)) {
                (true, true) => f64::INFINITY,
                (false, false) => enough(evidence),
                _ => tie(evidence),
            };
            if let Some(simple) = self.simpler(&best, &less, index)
                && (best.ahead_of(&simple, effective) < enough || is_slight(&best, &simple, index))
            {
                (self.say)(&describe(&simple));
                best = simple;
            }
        }
        best
    }

    /// Whether the interval of one of an effect's shapes with a logarithmic range reaches down to zero: the effect fits, but
    /// nothing shows its form.
    fn is_vague(&self, fit: &Fit, index: usize) -> bool {
        let active = &fit.actives[index];
        let of_form = |c: &usize| {
            let scale = Scale::Log;
            matches!(active.kind(*c), CoordinateKind::Shape { scale: s, .. } if s == scale)
        };
        let forms: Vec<usize> = (0..active.coordinates.len()).filter(of_form).collect();
        if forms.is_empty() || active.hypothesis.effect.simpler.is_none() {
            return false;
        }
        let before: usize = fit.actives[..index]
            .iter()
            .map(|a| a.coordinates.len())
            .sum();
        let spread = covariance(self.problem, fit);
        let half_width = half_width_95(self.problem);
        forms.into_iter().any(|c| {
            let deviation = spread[(before + c, before + c)].max(0.0).sqrt();
            half_width * deviation >= active.coordinates[c].abs()
        })
    }

    /// The explanation `less` plus the simpler effect that the effect at `index` in `best` contains, if there is
    /// evidence for it: friction that does not change in a step is still friction.
    pub fn simpler(
        &self,
        best: &Explanation,
        less: &Explanation,
        index: usize,
    ) -> Option<Explanation> {
        let Active {
            hypothesis,
            coordinates,
            ..
        } = &best.fit.actives[index];
        let simple = Hypothesis {
            effect: hypothesis.effect.simpler?.effect,
            place: hypothesis.place,
        };
        let there = |a: &Active| a.hypothesis == simple;
        if !self.hypotheses.contains(&simple) || less.fit.actives.iter().any(there) {
            return None;
        }
        let joints = Fit::joints_of(&simple, self.problem.joints);
        let library = (self.hypotheses.len() as f64).ln();
        let penalty = penalty(&less.fit, library, 1, simple.only_joint());
        let fit = less
            .fit
            .with(self.problem, simple.with(vec![coordinates[0]]));
        let with = Explanation {
            fit: fit.refined_at(self.problem, Some(&joints), less.fit.likelihood()),
            penalties: [&less.penalties[..], &[penalty]].concat(),
        };
        let effective = &self.problem.effective_samples;
        let evident = with.ahead_of(less, effective) >= LEAST_EVIDENCE || overwhelming(&with, less);
        evident.then_some(with)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    /// What is left of Stribeck's friction with so little more at rest than in motion, which falls off at this speed, however
    /// far ahead it seems to be.
    fn simplified(speed_rad_s: f64) -> &'static str {
        let problem = problem_with(7, |_, qd, effort| effort[1] += 1.5 * qd[1].signum());
        let hypotheses = ["stribeck_friction", "coulomb_friction"].map(|name| at_joint(name, 1));
        let search = Search {
            problem: &problem,
            hypotheses: &hypotheses,
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let stribeck = hypotheses[0].with(vec![1.5, 1e-3, speed_rad_s]);
        let best = Explanation {
            fit: Fit::new(&problem, vec![stribeck]),
            penalties: vec![-1e6],
        };
        let left = search.simplified(best, |_| 0.0);
        left.fit.actives[0].hypothesis.effect.name
    }

    #[test]
    fn a_shape_at_its_end_that_nothing_determines_is_the_simpler_effect() {
        assert_eq!(simplified(0.02), "coulomb_friction");
    }

    #[test]
    fn a_shape_within_its_range_stands_where_it_is_far_ahead() {
        assert_eq!(simplified(0.3), "stribeck_friction");
    }
}
