//! Curves for a residual that no effect of the library fits: beside the effects of a joint, or in their place.

use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::select::cross_validation::{carries_over, left_elsewhere};
use crate::select::curve_shapes;
use crate::select::evidence::{CURVE_EVIDENCE, CURVE_SIZE, LEAST_SIZE, PATCH, is_drawn_already};
use crate::select::evidence::{overwhelming, worse_joints};
use crate::select::explanation::Explanation;
use crate::select::plausible::is_open_wave;
use crate::select::propose::Base;
use crate::select::search::Search;
use tauscope_dynamics::kinematic_tree::bearing;

/// A curve is not tried at a joint whose residual variance is below this many times the variance of the white noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const CURVE_EXCESS: f64 = 1.6;
/// The effects of a joint hold if they leave at most this share of its variance on recordings that were left out.
/// Tuned: by hand, on no recorded seeds; not swept.
const MOST_LEFT: f64 = 0.1;
/// They also hold if that share is at most this many times the share that they leave on fitted recordings.
/// Tuned: by hand, on no recorded seeds; not swept.
const MOST_WORSE: f64 = 10.0;
/// More effects of one joint's position than this, each wave of a torque ripple counted, can imitate any curve.
/// Tuned: by hand, on no recorded seeds; not swept.
const MOST_OF_POSITION: usize = 3;
/// More springs than this in one joint draw the curve of another one.
/// Physical: a joint is balanced or tugged by a cable.
const MOST_SPRINGS: usize = 1;
/// The effects of a joint are checked on recordings left out only where the variance without them is at least this many
/// times that of the white noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const LOUD: f64 = 4.0;

impl Search<'_> {
    /// The explanation with a curve in a joint: in place of the joint's effects if it does better than they, else
    /// beside them if the residual is still large. `None` if neither has enough evidence.
    pub fn with_curve_at(&self, best: &Explanation, joint: usize) -> Option<Explanation> {
        let excess = |fit: &Fit| {
            fit.variance[joint]
                / (self.problem.white_noise[joint] * self.problem.white_noise[joint])
        };
        let own: Vec<usize> = (0..best.fit.actives.len())
            .filter(|&i| {
                let hypothesis = &best.fit.actives[i].hypothesis;
                hypothesis.only_joint() == Some(joint) && !hypothesis.is_torque_scale()
            })
            .collect();
        if own.iter().any(|&i| best.fit.actives[i].curve.is_some()) {
            return None;
        }
        // A curve must explain so much that each row may count as an independent sample.
        let white = vec![1.0; self.problem.joints];
        if !own.is_empty() {
            let bare = self.stripped(best, &own, joint);
            let mut instead = self.with_curve(&bare, joint);
            // Plain friction stays beside a curve of friction.
            let shaped = |i: &usize| !best.fit.actives[*i].hypothesis.is_plain_friction();
            let shaped: Vec<usize> = own.iter().copied().filter(shaped).collect();
            let plain = self.with_plain_friction(&self.stripped(best, &shaped, joint), joint);
            let bent = self.with_curve(&plain, joint);
            let bent = bent.filter(|e| e.fit.actives.last().is_some_and(Active::is_friction_curve));
            if let Some(bent) = bent
                && instead
                    .as_ref()
                    .is_none_or(|other| bent.ahead_of(other, &white) > 0.0)
            {
                instead = Some(bent);
            }
            if let Some(instead) = instead
                && instead.ahead_of(best, &white) > CURVE_EVIDENCE
            {
                return Some(instead);
            }
        }
        if excess(&best.fit) < CURVE_EXCESS {
            return None;
        }
        let mut base = best.clone();
        let mut beside = self.with_curve(best, joint)?;
        let drawn = |i: &usize| is_drawn_already(&beside.fit, best.fit.actives[*i].hypothesis);
        let drawn: Vec<usize> = own.iter().copied().filter(drawn).collect();
        if !drawn.is_empty() {
            base = self.stripped(best, &drawn, joint);
            beside = self.with_curve(&base, joint)?;
        }
        let less = best.fit.variance[joint] / beside.fit.variance[joint];
        let repeats = curve_shapes::repeats(self.problem, &base.fit, beside.fit.actives.last()?);
        let least = if repeats {
            1.0 + LEAST_SIZE
        } else {
            CURVE_SIZE
        };
        let known = self.scaled(best).squares[joint] - best.fit.squares[joint];
        if best.fit.squares[joint] - beside.fit.squares[joint] < PATCH * known {
            return None;
        }
        (beside.ahead_of(best, &white) > CURVE_EVIDENCE && less > least).then_some(beside)
    }

    /// The twin as it was, with the torque scales of an explanation.
    fn scaled(&self, best: &Explanation) -> Fit {
        let scales = best.fit.actives.iter();
        let scales = scales.filter(|active| active.hypothesis.is_torque_scale());
        Fit::new(self.problem, scales.cloned().collect())
    }

    /// The explanation with a curve in one joint in place of all effects that act once, if that does better. A residual
    /// that returns at the same position, or periodically, looks like many pushes.
    pub fn with_curve_for_intervals(&self, best: &Explanation) -> Option<Explanation> {
        let once = |&i: &usize| best.fit.actives[i].hypothesis.time_kind() == TimeKind::Once;
        let intervals: Vec<usize> = (0..best.fit.actives.len()).filter(once).collect();
        if intervals.len() < 2 {
            return None;
        }
        let less = |from: Explanation, index: &usize| self.without(&from, *index);
        let bare = intervals.iter().rev().fold(best.clone(), less);
        let white = vec![1.0; self.problem.joints];
        let joints = worse_joints(&bare.fit, &best.fit);
        // A force on a link acts on all joints that carry it. If only one joint shows it, it is no force.
        let model = &self.problem.model;
        let is_borne =
            |&i: &usize| bearing(model, best.fit.actives[i].hypothesis.place.link).len() > 1;
        let local = joints.len() == 1 && intervals.iter().all(is_borne);
        let with = joints.iter().filter_map(|&joint| {
            let with = self.curved(&bare, joint)?;
            let most = with.fit.variance[joint] < MOST_LEFT * bare.fit.variance[joint];
            let does = with.ahead_of(best, &white) > CURVE_EVIDENCE;
            (does || (local && most && self.is_evident(&with, &bare))).then_some(with)
        });
        with.max_by(|a, b| a.ahead_of(b, &white).total_cmp(&0.0))
    }

    /// The explanation with the best curve in a joint, if there is evidence for it and it predicts recordings left out.
    fn with_curve(&self, from: &Explanation, joint: usize) -> Option<Explanation> {
        let with = self.curved(from, joint)?;
        self.is_evident(&with, from).then_some(with)
    }

    /// Whether there is evidence for the curve that `with` has and `without` lacks.
    fn is_evident(&self, with: &Explanation, without: &Explanation) -> bool {
        let curve = with.fit.actives.last();
        with.ahead_of(without, &self.problem.effective_samples) > CURVE_EVIDENCE
            || overwhelming(with, without)
            || curve.is_some_and(|curve| curve_shapes::repeats(self.problem, &without.fit, curve))
    }

    /// The explanation with the best curve in a joint, if it predicts recordings left out.
    fn curved(&self, from: &Explanation, joint: usize) -> Option<Explanation> {
        let base = Base::new(self.problem, &from.fit, self.hypotheses.len());
        let curve = base.propose_curve(joint)?;
        let fit = from.fit.with(self.problem, curve.active);
        let fit = fit.refined_at(self.problem, Some(&[joint]), from.fit.likelihood());
        let mut actives = fit.actives;
        if let Some(curve) = actives.last_mut()
            && !curve.is_friction_curve()
        {
            curve_shapes::keep_what_is_evident(curve);
        }
        let fit = Fit::new(self.problem, actives);
        let penalties = [&from.penalties[..], &[curve.penalty]].concat();
        let with = Explanation { fit, penalties };
        carries_over(self.problem, &with.fit, &from.fit, &[joint]).then_some(with)
    }

    /// The explanation with Coulomb and viscous friction in a joint, to stand beside a curve of friction.
    fn with_plain_friction(&self, from: &Explanation, joint: usize) -> Explanation {
        let plain = self.hypotheses.iter().filter(|h| {
            let missing = from.fit.actives.iter().all(|a| a.hypothesis != **h);
            h.place.joint == joint && h.is_plain_friction() && missing
        });
        let add = |from: Explanation, hypothesis: &Hypothesis| {
            let base = Base::new(self.problem, &from.fit, self.hypotheses.len());
            let proposal = base.propose(*hypothesis);
            proposal.map_or_else(
                || from.clone(),
                |proposal| self.joined(&from, &proposal, from.fit.likelihood()),
            )
        };
        plain.fold(from.clone(), add)
    }

    /// The explanation without some of its effects, refined at the joint that they act in.
    pub(super) fn stripped(
        &self,
        best: &Explanation,
        pieces: &[usize],
        joint: usize,
    ) -> Explanation {
        let mut bare = best.clone();
        for &i in pieces.iter().rev() {
            bare.fit.actives.remove(i);
            bare.penalties.remove(i);
        }
        let fit = Fit::new(self.problem, bare.fit.actives);
        bare.fit = fit.refined_at(self.problem, Some(&[joint]), best.fit.likelihood());
        bare
    }

    /// Removes the effects of a joint that together only imitate a curve, and puts a curve in their place. Such are
    /// more than `MOST_OF_POSITION` effects of position, waves that no gear makes, and effects that leave much more
    /// of the variance on recordings left out than on fitted ones. Waves that do as well with whole numbers of cycles as a
    /// curve does get these.
    pub fn with_names_that_hold(&self, found: Explanation) -> Explanation {
        let pieces = found.fit.actives.len();
        let mut best = found;
        for joint in 0..self.problem.joints {
            let local = |&i: &usize| {
                let active = &best.fit.actives[i];
                active.hypothesis.only_joint() == Some(joint)
                    && active.curve.is_none()
                    && !active.hypothesis.is_torque_scale()
            };
            let names: Vec<usize> = (0..best.fit.actives.len()).filter(local).collect();
            let of = |i: usize| best.fit.actives[i].hypothesis;
            let lasting = names.iter().all(|&i| of(i).time_kind() == TimeKind::Always);
            let shaped = names.iter().any(|&i| !of(i).is_linear());
            if !lasting || !shaped {
                continue;
            }
            let bare = self.stripped(&best, &names, joint);
            let of_position = names.iter().filter(|&&i| of(i).is_of_position()).count();
            let open = names.iter().any(|&i| is_open_wave(&best.fit.actives[i]));
            let springs = names.iter().filter(|&&i| of(i).is_spring()).count();
            if (of_position > MOST_OF_POSITION || springs > MOST_SPRINGS || open)
                && let Some(curve) = self.in_place_of_waves(&best, &names, &bare, joint)
            {
                best = curve;
                continue;
            }
            let noise = self.problem.white_noise[joint] * self.problem.white_noise[joint];
            if bare.fit.variance[joint] < LOUD * noise {
                continue;
            }
            let left_here = best.fit.squares[joint] / bare.fit.squares[joint];
            let left_there = left_elsewhere(self.problem, &best.fit, joint)
                / left_elsewhere(self.problem, &bare.fit, joint);
            (self.say)(&format!("proving what was found at joint {}", joint + 1));
            if left_there > MOST_LEFT.max(MOST_WORSE * left_here) {
                best = self.with_curve(&bare, joint).unwrap_or(bare);
            }
        }
        if best.fit.actives.len() < pieces {
            // Effects that corrected the removed ones may not be needed any more.
            best = self.pruned(best);
        }
        best
    }

    /// What does best in the place of effects of a joint's position that no gear makes: a curve instead of all effects `names`
    /// of the joint, which `bare` lacks; a curve beside those that are no function of position, or nothing where it would only
    /// patch these; or waves that close.
    fn in_place_of_waves(
        &self,
        best: &Explanation,
        names: &[usize],
        bare: &Explanation,
        joint: usize,
    ) -> Option<Explanation> {
        let of_position = |i: &usize| best.fit.actives[*i].hypothesis.is_of_position();
        let waves: Vec<usize> = names.iter().copied().filter(of_position).collect();
        let mut able = vec![self.with_curve(bare, joint)];
        if waves.len() < names.len() {
            let beside = self.stripped(best, &waves, joint);
            let known = self.scaled(best).squares[joint] - best.fit.squares[joint];
            let is_patch = |with: &Explanation| {
                beside.fit.squares[joint] - with.fit.squares[joint] < PATCH * known
            };
            let curve = self
                .with_curve(&beside, joint)
                .filter(|with| !is_patch(with));
            let needs_none = is_patch(best);
            able.push(curve.or_else(|| needs_none.then_some(beside)));
        }
        if waves.len() <= MOST_OF_POSITION {
            able.push(self.with_closed_waves(best, names, joint));
        }
        let white = vec![1.0; self.problem.joints];
        let able = able.into_iter().flatten();
        able.max_by(|a, b| a.ahead_of(b, &white).total_cmp(&0.0))
    }
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::Against;

    use super::*;
    use crate::fixture::{at_joint, problem_with};
    use crate::select::evidence::needs;

    #[test]
    fn an_effort_of_no_name_is_drawn_against_what_it_depends_on() {
        for (against, of) in [
            (
                Against::Position,
                (|q, _| (2.5 * q - 0.4).cos().powi(3)) as fn(f64, f64) -> f64,
            ),
            (Against::Acceleration, |_, _| 0.0),
        ] {
            let problem = problem_with(1, |q, qd, effort| effort[1] += 2.0 * of(q[1], qd[1]));
            let nothing = Fit::new(&problem, Vec::new());
            let base = Base::new(&problem, &nothing, 40);
            let curve = base.propose_curve(1).unwrap();
            let drawn = curve.active.curve.as_ref().unwrap();
            if against == Against::Position {
                assert_eq!((drawn.against, drawn.of_joint), (against, 1));
                assert!(curve.evidence() > CURVE_EVIDENCE);
            } else {
                // There is no effort that a curve could describe.
                assert!(curve.evidence() < CURVE_EVIDENCE);
            }
        }
    }

    #[test]
    fn beside_a_curve_of_position_other_functions_of_position_are_not_tried() {
        let problem = problem_with(2, |q, _, effort| {
            effort[1] += 2.0 * (3.0 * q[1]).sin().powi(3);
        });
        let nothing = Fit::new(&problem, Vec::new());
        let curve = Base::new(&problem, &nothing, 40).propose_curve(1).unwrap();
        let with = nothing.with(&problem, curve.active);
        assert!(is_drawn_already(&with, at_joint("cable_spring", 1)));
        assert!(!is_drawn_already(&with, at_joint("cable_spring", 0)));
        assert!(!is_drawn_already(&with, at_joint("viscous_friction", 1)));
        // An effect of the library must explain much more beside a curve.
        let beside = needs(at_joint("viscous_friction", 1), &with).1;
        assert!(beside > needs(at_joint("viscous_friction", 1), &nothing).1);
    }

    #[test]
    fn a_wave_that_no_gear_makes_does_not_take_friction_with_it() {
        let problem = problem_with(4, |q, qd, effort| {
            let bump = (-0.5 * ((q[1] - 0.3) / 0.2).powi(2)).exp();
            effort[1] += 2.0 * qd[1].signum() + 1.5 * qd[1] + 0.4 * bump;
        });
        let plain = ["coulomb_friction", "viscous_friction"].map(|name| at_joint(name, 1));
        let search = Search {
            problem: &problem,
            hypotheses: &plain,
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let wave = at_joint("torque_ripple", 1).with(vec![0.1, 0.1, 2.6]);
        let friction = plain.map(|h| h.with(vec![1.0]));
        let actives = [&friction[..], &[wave]].concat();
        let found = search.with_names_that_hold(Explanation {
            fit: Fit::new(&problem, actives).refined(&problem),
            penalties: vec![10.0; 3],
        });
        let holds = |h: &Hypothesis| found.fit.actives.iter().any(|a| a.hypothesis == *h);
        assert!(plain.iter().all(holds));
        assert!(!found.fit.actives.iter().any(is_open_wave));
    }
}
