//! What bears an arm that stands: its friction holds a joint with any effort up to its own, and no more.

use std::collections::BTreeMap;

use serde_json::Value;
use tauscope_dynamics::terms::words::number;

use crate::data::problem::Problem;
use crate::data::track::{FitTrack, STANDSTILL_RAD_S};
use crate::report::schema::{Finding, Remaining};
use crate::report::sentences::unit_at;

use super::held::ABOVE_NOISE;
use super::{Left, Remainders};

/// At standstill more than this many times the friction in motion is missing before something else bears the joint.
/// Physical: static friction of gears is up to twice that in motion.
const STICKS: f64 = 2.0;
/// The joint must stand for at least this share of the held-out time: fewer rows are the edges of standstills.
/// Tuned: by hand, with practice sets in view; not swept.
const LEAST_SHARE: f64 = 0.05;
/// And for at least this share of the time that does not count: the rest are ends, gaps and reversals.
/// Tuned: as [`LEAST_SHARE`].
const LEAST_OF_LEFT_OUT: f64 = 0.5;
/// And this share of the largest effort must be missing.
/// Tuned: as [`LEAST_SHARE`].
const LEAST_OF_LARGEST: f64 = 0.1;

impl Remainders {
    /// Adds what is missing while a joint stands. `after` are the errors over all held-out samples \[effort unit\].
    pub(super) fn add_standing(
        &mut self,
        found: Left<'_>,
        held: Left<'_>,
        unit_nm: &[f64],
        (after, findings): (&[f64], &[Finding]),
        unit: &str,
    ) {
        for (j, joint) in found.problem.model.joint_names().enumerate() {
            // Of a joint whose effort nobody measures nothing is said.
            if found.problem.weight[found.problem.joint_rows(j)]
                .iter()
                .all(|weight| *weight == 0.0)
            {
                continue;
            }
            let after_nm = after[j] * unit_nm[j];
            let Some([missing, friction]) = unborne(held, j, joint, after_nm, findings) else {
                continue;
            };
            let unit = unit_at(unit, &found.problem.model.joints()[j]);
            let told = |nm: f64| format!("{} {unit}", number(nm / unit_nm[j]));
            let said = format!(
                "While joint {joint} stands on the held-out recordings, {} are missing, more than its friction of {} holds: \
                 something else bears it there, such as a brake, or its effort is not measured then.",
                told(missing),
                told(friction)
            );
            match self.all.iter_mut().find(|one| one.joint == joint) {
                Some(one) => one.sentence = format!("{} {said}", one.sentence),
                None => self.all.push(Remaining {
                    joint: joint.to_owned(),
                    rms: found.rms(j) / unit_nm[j],
                    holdout_rms: Some(missing / unit_nm[j]),
                    noise: found.problem.white_noise[j] / unit_nm[j],
                    sentence: said,
                }),
            }
        }
    }
}

/// The effort that is missing while a joint stands, as root mean square, and the friction that it has \[N m or N\], if that is
/// more than the friction can hold. `after` is the error over all held-out samples \[N m or N\].
fn unborne(
    held: Left<'_>,
    joint: usize,
    name: &str,
    after: f64,
    findings: &[Finding],
) -> Option<[f64; 2]> {
    let problem = held.problem;
    let rows = problem.joint_rows(joint);
    let moving = problem.weight[rows]
        .iter()
        .filter(|weight| **weight > 0.0)
        .count() as f64;
    let moves = moving / problem.rows.max(1) as f64;
    let left_out = 1.0 - moves;
    // What is left out beside a gap or an end does not stand; a standstill that counts is compared like motion.
    let stands = standing(problem, joint) / problem.rows.max(1) as f64;
    if left_out < LEAST_SHARE || stands < LEAST_OF_LEFT_OUT * left_out {
        return None;
    }
    let noise = problem.unfiltered_noise[joint];
    let while_moving = held.rms(joint).powi(2) + noise * noise;
    let square = (after * after - moves * while_moving) / left_out;
    let missing = square.max(0.0).sqrt();
    let friction = friction(problem, joint, name, findings);
    let is_seen = missing > LEAST_OF_LARGEST * problem.largest_effort[joint];
    (is_seen && missing > STICKS * friction + ABOVE_NOISE * noise).then_some([missing, friction])
}

/// The number of rows in which a joint stands.
fn standing(problem: &Problem, joint: usize) -> f64 {
    let stands = |velocity: f64| velocity.abs() < STANDSTILL_RAD_S;
    let of = |track: &FitTrack| {
        let velocities =
            (track.compared.iter()).map(|k| track.track.velocity[k * problem.joints + joint]);
        velocities.filter(|velocity| stands(*velocity)).count()
    };
    problem.tracks.iter().map(of).sum::<usize>() as f64
}

/// The most that the friction of a joint holds, as far as it is known \[N m or N\].
fn friction(problem: &Problem, joint: usize, name: &str, findings: &[Finding]) -> f64 {
    let known: f64 = problem.known_friction[joint]
        .values()
        .copied()
        .fold(0.0, f64::max);
    let here = findings
        .iter()
        .filter(|finding| finding.joint.as_deref() == Some(name));
    let found = here.map(|finding| largest(&finding.parameters, problem.largest_effort[joint]));
    known + found.sum::<f64>()
}

/// The largest dry friction among the parameters of an effect, on a joint with this largest effort.
fn largest(parameters: &BTreeMap<String, Value>, largest_effort: f64) -> f64 {
    let of = |(name, value): (&String, &Value)| {
        let value = value.as_f64()?.abs();
        if name.contains("coulomb") || name.contains("static") || name.starts_with("largest_n") {
            Some(value)
        } else {
            (name == "coefficient").then_some(value * largest_effort)
        }
    };
    parameters.iter().filter_map(of).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn an_arm_in_motion_stands_in_hardly_any_row_and_one_at_rest_in_all() {
        let model = fixture::model();
        let mut recording = fixture::recording(&model, 4, |_, _, _| {});
        let moving = fixture::problem(&model, std::slice::from_ref(&recording));
        assert!(standing(&moving, 0) < 0.05 * moving.rows as f64);
        for rows in [&mut recording.position, &mut recording.velocity] {
            rows.fill(0.0);
        }
        let resting = fixture::problem(&model, &[recording]);
        assert!(standing(&resting, 0) > 0.99 * resting.rows as f64);
    }

    #[test]
    fn the_most_that_an_effect_holds_is_its_largest_dry_friction() {
        let of = |all: &[(&str, f64)]| {
            let parameters = all
                .iter()
                .map(|(name, value)| ((*name).to_owned(), Value::from(*value)));
            largest(&parameters.collect(), 20.0)
        };
        assert!(
            (of(&[
                ("coulomb_nm", 1.5),
                ("static_nm", 2.5),
                ("stribeck_velocity_rad_s", 9.0)
            ]) - 2.5)
                .abs()
                < 1e-12
        );
        assert!((of(&[("coefficient", 0.1)]) - 2.0).abs() < 1e-12);
        assert!(of(&[("viscous_nms_per_rad", 7.0)]) < 1e-12);
    }
}
