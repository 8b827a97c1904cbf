//! One shifted joint zero in the place of several bodies, which together may look like it.

use tauscope_dynamics::terms::{Family, LINK_COM};

use crate::physics::active::{Active, Hypothesis};
use crate::select::evidence::{LEAST_GAIN, tie};
use crate::select::explanation::Explanation;
use crate::select::search::Search;

/// Fewer bodies than this are one story already.
/// Statistical: one number in the place of at least two effects.
const SEVERAL: usize = 2;

/// Beside a twin that was fitted to the arm, a zero may be so far behind a centre of mass that has moved \[nats\].
/// Physical: parts of a link do not move between two days, but arms crash and encoders are changed; odds of a thousand.
const MOVES_LESS_OFTEN: f64 = 6.9;

impl Search<'_> {
    /// Whether an effect says that the centre of a link has moved since the twin was fitted to the arm, its mass being the
    /// same.
    pub fn is_moved_centre(&self, hypothesis: Hypothesis) -> bool {
        self.problem.is_beside_fitted_twin() && hypothesis.effect == &LINK_COM
    }

    /// The explanation with one shifted zero in the place of all bodies, or of a centre that has moved since the twin was
    /// fitted, with those added again that are still needed, if it is better.
    pub fn with_one_zero(&self, best: &Explanation) -> Option<Explanation> {
        let is_body =
            |a: &Active| a.hypothesis.lasts() && a.hypothesis.effect.family == Family::Body;
        let bodies: Vec<usize> = (0..best.fit.actives.len())
            .filter(|&i| is_body(&best.fit.actives[i]))
            .collect();
        let moved = match bodies[..] {
            [only] => self.is_moved_centre(best.fit.actives[only].hypothesis),
            _ => false,
        };
        if bodies.len() < SEVERAL && !moved {
            return None;
        }
        let less = |from: Explanation, index: &usize| self.without(&from, *index);
        let without = bodies.iter().rev().fold(best.clone(), less);
        let is_lasting = |h: &Hypothesis| h.is_zero_offset() && h.lasts();
        let proposals = self.proposals_of(&without.fit, is_lasting);
        let with = self.best_of(&without, &proposals, best.fit.likelihood())?;
        let offset = with.fit.actives.last()?.hypothesis;
        let with = self.pruned(self.forward(with));
        let stands = with.fit.actives.iter().any(|a| a.hypothesis == offset);
        let effective = &self.problem.effective_samples;
        let enough = if moved {
            -MOVES_LESS_OFTEN - tie(best.ahead_of(&without, effective))
        } else {
            LEAST_GAIN
        };
        let moves = |a: &Active| self.is_moved_centre(a.hypothesis);
        let still = moved && with.fit.actives.iter().any(moves);
        (stands && !still && with.ahead_of(best, effective) > enough).then_some(with)
    }
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::data::problem::Problem;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, at_joint, model, problem, recording};
    use crate::physics::active::Whereabouts;

    /// What takes the place of a moved centre where the zero of the elbow is off by 0.03 rad, beside a URDF or beside a
    /// twin that was fitted to the arm.
    fn said(beside_fitted_twin: bool) -> Vec<&'static str> {
        let plain = model();
        let mut real = plain.clone();
        real.shift_zero(1, 0.03);
        let mut noise = Noise(7);
        let recordings = [1, 2, 3].map(|seed| {
            recording(&real, seed, |_, _, effort| {
                for effort in effort {
                    *effort += 0.05 * noise.next();
                }
            })
        });
        let mut problem: Problem = problem(&plain, &recordings);
        if beside_fitted_twin {
            problem.known_friction[0].insert("coulomb_friction", 1.0);
        }
        let centre = Hypothesis {
            effect: effect("link_com").unwrap(),
            place: Whereabouts {
                link: plain.link_index("lower").unwrap(),
                ..Whereabouts::default()
            },
        };
        let search = Search {
            problem: &problem,
            hypotheses: &[centre, at_joint("joint_zero_offset", 1)],
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let moved = vec![centre.with(vec![0.0; 3])];
        let best = Explanation {
            fit: Fit::new(&problem, moved).refined(&problem),
            penalties: vec![0.0],
        };
        let zero = search.with_one_zero(&best);
        let actives = zero.into_iter().flat_map(|zero| zero.fit.actives);
        actives
            .map(|active| active.hypothesis.effect.name)
            .collect()
    }

    #[test]
    fn a_zero_shifts_more_often_than_a_centre_moves_beside_a_twin_of_the_arm() {
        assert_eq!(said(true), ["joint_zero_offset"]);
        // Of a URDF nobody knows whether its centre is right.
        assert!(said(false).is_empty());
    }
}
