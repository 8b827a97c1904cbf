//! Whether the size of what remains at a joint goes with the motion, where no function of the motion predicts its sign.
//!
//! Noise, however slow, is as large while the arm moves as while it rests. What swells with a speed or a load is no noise:
//! something rubs, jams or comes loose. The test is that of `select/carried.rs`, on the size of the remainder: a recording's
//! sizes must be predicted from the others, better than in surrogates.

use tauscope_dynamics::terms::MotionSample;

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::select::carried::Carried;

/// Share of the squares of the size, about its mean, that must be predicted in recordings left out.
/// Tuned: as for sums over the last moments; not swept.
const LEAST_SHARE: f64 = 0.1;
/// A joint moves if it is faster than this share of its usual speed.
/// Resolution: slower, its direction is as uncertain as the sign of friction.
const MOVES: f64 = 0.1;
/// The remainder must be this many times the white noise, as root mean square.
/// Tuned: first_sight.py, seeds 41 and 42; errors of derivatives grow with speed, too, and are about as large as the noise.
const ABOVE_NOISE: f64 = 3.0;

/// What the size of a remainder goes with.
#[derive(Debug, Clone, PartialEq)]
pub struct Swell {
    /// Share of the squares of its size about its mean that is predicted in recordings left out.
    pub share: f64,
    /// When it is larger, in words.
    pub when: String,
}

/// What makes the remainder of `fit` at a joint larger, if that is more than chance. `joints` are the names of all.
pub fn swells(problem: &Problem, fit: &Fit, joint: usize, joints: &[String]) -> Option<Swell> {
    let noise = ABOVE_NOISE * problem.white_noise[joint];
    if fit.variance[joint] < noise * noise {
        return None;
    }
    let own = problem.joint_rows(joint);
    let mut size = vec![0.0; problem.joints * problem.rows];
    for (size, residual) in size[own.clone()].iter_mut().zip(&fit.residual[own.clone()]) {
        *size = residual.abs();
    }
    centre(problem, joint, &mut size[own.clone()]);
    let mut tried = Vec::new();
    for (when, mut values) in readings(problem, fit, joint, joints) {
        centre(problem, joint, &mut values);
        let rises: f64 = values
            .iter()
            .zip(&size[own.clone()])
            .map(|(x, y)| x * y)
            .sum();
        let column = Column {
            joint: Some(joint),
            values,
        };
        if let Some(carried) = Carried::of(problem, &size, joint, &[column]) {
            tried.push((when, carried, rises > 0.0));
        }
    }
    let by_chance = Carried::largest_by_chance(tried.iter().map(|(_, carried, _)| carried));
    // What is larger while a joint is slow may be friction whose direction is uncertain there.
    let rising = tried.into_iter().filter(|(_, _, rises)| *rises);
    let (when, carried, _) = rising.max_by(|(_, a, _), (_, b, _)| a.share.total_cmp(&b.share))?;
    let share = carried.share;
    (share > by_chance.max(LEAST_SHARE)).then_some(Swell { share, when })
}

/// Takes the mean over each recording from values at the rows of a joint, where they count; the others become zero.
fn centre(problem: &Problem, joint: usize, values: &mut [f64]) {
    let weight = &problem.weight[problem.joint_rows(joint)];
    for track in &problem.tracks {
        let rows = || track.rows().filter(|&row| weight[row] > 0.0);
        let mean = rows().map(|row| values[row]).sum::<f64>() / rows().count().max(1) as f64;
        for row in track.rows() {
            values[row] = if weight[row] > 0.0 {
                values[row] - mean
            } else {
                0.0
            };
        }
    }
}

/// What the size may go with, in words, and its values at the rows of the joint.
fn readings(
    problem: &Problem,
    fit: &Fit,
    joint: usize,
    joints: &[String],
) -> Vec<(String, Vec<f64>)> {
    let n = problem.joints;
    let read = |of: &dyn Fn(&MotionSample<'_>) -> f64| {
        let mut efforts = Vec::new();
        for track in &problem.tracks {
            let mut values = Vec::with_capacity(track.track.time_s.len() * n);
            track.track.each(|_, at| {
                let value = of(at);
                values.extend((0..n).map(|j| if j == joint { value } else { 0.0 }));
            });
            efforts.push(values);
        }
        problem.column(&efforts, Some(joint)).values
    };
    let load = fit.load(problem);
    let heavy: Vec<Vec<f64>> = load
        .iter()
        .map(|one| one.iter().map(|x| x.abs()).collect())
        .collect();
    let mut all = vec![(
        "while its load is high".to_owned(),
        problem.column(&heavy, Some(joint)).values,
    )];
    for (other, name) in joints.iter().enumerate() {
        let whose = if other == joint {
            "it".to_owned()
        } else {
            format!("joint {name}")
        };
        let (mut square, mut count) = (0.0, 0.0_f64);
        for track in &problem.tracks {
            track.track.each(|_, at| {
                square += at.velocity[other] * at.velocity[other];
                count += 1.0;
            });
        }
        let usual = (square / count.max(1.0)).sqrt();
        let moves =
            move |at: &MotionSample<'_>| f64::from(at.velocity[other].abs() > MOVES * usual);
        all.push((format!("while {whose} moves"), read(&moves)));
        let speed = move |at: &MotionSample<'_>| at.velocity[other].abs();
        all.push((format!("the faster {whose} moves"), read(&speed)));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Noise, model, problem, recording};

    /// What is said of three recordings of two joints where `add` is added to the first one's effort, given both speeds.
    fn said(mut add: impl FnMut(&[f64]) -> f64) -> Option<Swell> {
        let model = model();
        let mut noise = Noise(3);
        let recordings = [1, 2, 3].map(|seed| {
            recording(&model, seed, |_, qd, effort| {
                effort[0] += add(qd) + 0.02 * noise.next();
                effort[1] += 0.02 * noise.next();
            })
        });
        let problem = problem(&model, &recordings);
        let nothing = Fit::new(&problem, Vec::new());
        let joints = ["shoulder".to_owned(), "elbow".to_owned()];
        swells(&problem, &nothing, 0, &joints)
    }

    #[test]
    fn slow_noise_that_grows_with_a_speed_is_told_with_the_joint() {
        let mut noise = Noise(7);
        let mut slow = 0.0;
        let said = said(|qd| {
            slow = 0.9 * slow + 0.44 * noise.next();
            slow * qd[1].abs()
        });
        let said = said.expect("its size follows the elbow");
        assert!(said.when.contains("elbow"), "{}", said.when);
    }

    #[test]
    fn slow_noise_of_the_same_size_all_the_time_goes_with_nothing() {
        let mut noise = Noise(9);
        let mut slow = 0.0;
        let said = said(|_| {
            slow = 0.98 * slow + 0.2 * noise.next();
            slow
        });
        assert_eq!(said, None);
    }

    #[test]
    fn what_is_larger_while_joints_are_slow_is_not_told() {
        let mut noise = Noise(9);
        let mut slow = 0.0;
        let said = said(|qd| {
            slow = 0.9 * slow + 0.44 * noise.next();
            slow / (0.2 + qd[0].abs() + qd[1].abs())
        });
        assert_eq!(said, None);
    }
}
