//! Which corrections are handed out: none that makes a joint worse.
//!
//! The predictions of held-out recordings must not depend on their efforts. So there a joint keeps the twin as it was if its
//! correction does worse than none on fitted recordings, each left out in turn. The written twin may be judged by the
//! held-out recordings, too.

use tauscope_dynamics::terms::UNKNOWN;

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::track::Track;
use crate::fit::fitted::Fit;
use crate::read::recording::Recording;
use crate::report::findings::Named;
use crate::report::schema::{Finding, Rejected};
use crate::report::sentences::UNCHANGED;
use crate::select::cross_validation::left_elsewhere;

/// A correction is handed out if it leaves at most this share of the squares of recordings left out: less is what one
/// recording differs from another by.
/// Tuned: by hand, on no recorded seeds; not swept.
const MOST_LEFT: f64 = 0.97;

/// The joints whose correction predicts recordings left out of the fit no better than the twin `before` it.
pub fn not_carried(problem: &Problem, before: &Fit, found: &Fit) -> Vec<usize> {
    if problem.tracks.len() < 2 {
        return Vec::new();
    }
    // What acts once is not part of the prediction of other recordings.
    let lasts = |j: usize| {
        let mut all = found.actives.iter().map(|active| &active.hypothesis);
        all.any(|h| h.lasts() && !h.is_torque_scale() && h.only_joint().is_none_or(|own| own == j))
    };
    let changed = |&j: &usize| lasts(j) && found.squares[j] < UNCHANGED * before.squares[j];
    let no_better = |&j: &usize| {
        left_elsewhere(problem, found, j) > MOST_LEFT * left_elsewhere(problem, before, j)
    };
    let all = (0..problem.joints).filter(changed);
    all.filter(no_better).collect()
}

/// Moves the effects of one joint that are `withheld` from the findings to what is rejected, and returns the fit without
/// them. They fit what is peculiar to single recordings, as slow noise is. `unknown` names no cause that could be wrong.
pub fn reject(
    withheld: &[Withheld],
    named: &mut Named,
    problem: &Problem,
    found: &Fit,
    joints: &[String],
) -> Fit {
    let mut kept = found.clone();
    let mut refuted: Vec<usize> = withheld.iter().map(|one| one.effect).collect();
    refuted.sort_unstable();
    for &index in refuted.iter().rev() {
        let hypothesis = found.actives[index].hypothesis;
        let Some(joint) = hypothesis.only_joint().map(|joint| &joints[joint]) else {
            continue;
        };
        let is_it = |finding: &mut Finding| {
            finding.effect == hypothesis.said()
                && finding.effect != UNKNOWN.name
                && finding.joint.as_ref() == Some(joint)
        };
        let rejected: Vec<Finding> = named.findings.extract_if(.., is_it).collect();
        if !rejected.is_empty() {
            kept = kept.without(problem, index);
        }
        named
            .rejected
            .extend(rejected.into_iter().map(|finding| Rejected {
                effect: finding.effect,
                joint: finding.joint,
                link: finding.link,
                reason: "the held-out recordings are predicted better without it".to_owned(),
            }));
    }
    kept
}

/// A correction that is left out of the written twin.
pub struct Withheld {
    /// Index of the effect in the fit.
    pub effect: usize,
    /// The joint that it makes worse.
    pub joint: usize,
}

/// Errors on the held-out recordings, by effects that are kept.
pub struct HeldOut<'a> {
    /// The input and its units.
    pub context: &'a Context<'a>,
    /// The fitted recordings.
    pub problem: &'a Problem,
    /// The held-out recordings and their motion.
    pub tracks: Vec<(&'a Recording, Track)>,
}

impl HeldOut<'_> {
    /// RMS error by joint with some effects of `found` \[effort unit\].
    fn rms(&self, found: &Fit, keep: &[bool]) -> Vec<f64> {
        let n = self.problem.joints;
        let mut fit = found.clone();
        let kept = found.actives.iter().zip(keep).filter(|(_, keep)| **keep);
        fit.actives = kept.map(|(active, _)| active.clone()).collect();
        let (mut squares, mut count) = (vec![0.0; n], 0.0);
        for (recording, track) in &self.tracks {
            let twin = self.context.predict(self.problem, &fit, track);
            for (k, (measured, twin)) in recording.effort.iter().zip(&twin).enumerate() {
                squares[k % n] += (measured - twin) * (measured - twin);
            }
            count += recording.effort.len() as f64 / n as f64;
        }
        squares
            .iter()
            .map(|square| (square / count).sqrt())
            .collect()
    }

    /// The effects that are withheld, so that no joint is worse than `before`. An effect on several joints stays if they
    /// would lose more than the one gains.
    pub fn withheld(&self, found: &Fit, before: &[f64]) -> Vec<Withheld> {
        let mut keep = vec![true; found.actives.len()];
        let mut withheld = Vec::new();
        loop {
            let now = self.rms(found, &keep);
            let worse = |j: &usize| now[*j] * UNCHANGED > before[*j];
            let best = (0..self.problem.joints).filter(worse).find_map(|joint| {
                let without = |index: usize| {
                    let mut fewer = keep.clone();
                    fewer[index] = false;
                    (index, self.rms(found, &fewer))
                };
                let free = (0..keep.len())
                    .filter(|&i| keep[i] && !found.actives[i].hypothesis.is_torque_scale());
                let helps = |(_, rms): &(usize, Vec<f64>)| {
                    let change = rms.iter().zip(&now).map(|(rms, now)| (rms / now).ln());
                    rms[joint] < now[joint] && change.sum::<f64>() < 0.0
                };
                let able = free.map(without).filter(helps);
                let best = able.min_by(|(_, a), (_, b)| a[joint].total_cmp(&b[joint]));
                best.map(|(index, _)| Withheld {
                    effect: index,
                    joint,
                })
            });
            let Some(next) = best else { return withheld };
            keep[next.effect] = false;
            withheld.push(next);
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::fixture::{at_joint, model, problem_with};

    #[test]
    fn what_the_held_out_recordings_refute_is_rejected_and_what_only_describes_stays() {
        let problem = problem_with(3, |_, _, _| ());
        let joints: Vec<String> = model().joint_names().map(str::to_owned).collect();
        let bias = at_joint("torque_bias", 1);
        let found = Fit::new(&problem, vec![bias.with(vec![0.1])]);
        let finding = |effect: &str| -> Finding {
            serde_json::from_value(json!({
                "effect": effect, "joint": "elbow", "link": null, "parameters": {}, "intervals_95": {},
                "confidence": 0.6, "recording": null, "t_start": null, "t_end": null, "explains": 1.0,
                "equivalent_to": [], "sentence": "",
            }))
            .unwrap()
        };
        let mut named = Named {
            findings: vec![finding("torque_bias"), finding("unknown")],
            ..Named::default()
        };
        let withheld = [Withheld {
            effect: 0,
            joint: 1,
        }];
        let kept = reject(&withheld, &mut named, &problem, &found, &joints);
        let left: Vec<&str> = named.findings.iter().map(|f| &*f.effect).collect();
        assert_eq!(left, ["unknown"]);
        assert_eq!(named.rejected[0].joint.as_deref(), Some("elbow"));
        assert!(named.rejected[0].reason.contains("held-out"));
        assert!(kept.actives.is_empty());
    }
}
