//! Faults of the recordings or of their description, as findings.
//!
//! A fault is an `unknown` with a `kind`: it is not physics of the arm. The verdict is then not `explained`, unless
//! the fault is of the velocity alone. All other content of the report is that of the recordings without the faults.

use std::collections::BTreeMap;

use serde_json::Value;
use tauscope_dynamics::terms::UNKNOWN;
use tauscope_dynamics::terms::words::number;

use crate::data::remedies::{Remedy, Slip};
use crate::report::holdout::Proof;
use crate::report::schema::Finding;

/// Probability that a reported fault is present.
/// Tuned: by hand, on no recorded seeds; not swept.
const CONFIDENCE: f64 = 0.97;

/// The faults of the recordings, which are corrected before the recordings are explained.
#[derive(Debug, Default)]
pub struct Slips {
    /// Faults in the order of correction.
    pub all: Vec<Slip>,
    /// RMS error of the twin on the uncorrected held-out recordings, by joint \[effort unit\].
    as_recorded: Option<Vec<f64>>,
}

impl Slips {
    /// Creates a list of faults that do not concern the efforts.
    pub fn new(all: Vec<Slip>) -> Self {
        Self {
            all,
            as_recorded: None,
        }
    }

    /// Adds faults, and on the first call the errors before these corrections.
    pub fn add(&mut self, found: Vec<Slip>, errors: Vec<f64>) {
        self.all.extend(found);
        self.as_recorded.get_or_insert(errors);
    }

    /// Returns a finding for each fault. Its errors are in the recordings' `unit`; `unit_nm` are N m per unit, by
    /// joint.
    pub fn findings(&self, joints: &[String], unit: &str, unit_nm: &[f64]) -> Vec<Finding> {
        let as_recorded = |slip: &Slip| {
            let mut slip = slip.clone();
            for (joint, errors) in &mut slip.mended {
                *errors = errors.map(|error| error / unit_nm[*joint]);
            }
            slip
        };
        let all = self.all.iter().map(as_recorded);
        all.map(|slip| finding(&slip, joints, unit)).collect()
    }

    /// Returns the note that the rest of the report is that of the corrected recordings.
    pub fn note(&self) -> Option<String> {
        let of_velocity =
            |slip: &Slip| matches!(slip.remedy, Remedy::Velocity(..) | Remedy::DropsOut(..));
        let twin = if self.all.iter().all(of_velocity) {
            "A pipeline computes velocities from the positions, so the corrected twin holds there."
        } else {
            "No corrected twin was written: correct the faults, then explain again."
        };
        let before = if self.as_recorded.is_some() {
            "The error before is that of the recordings as they are. "
        } else {
            ""
        };
        (!self.all.is_empty()).then(|| {
            format!(
                "The recordings, or their description, have the faults that are listed first. All other findings and numbers are those \
                 of the recordings without these faults. {before}{twin}"
            )
        })
    }

    /// Converts predictions and errors back to the columns and the unit of the uncorrected recordings.
    pub fn undo(&self, proof: &mut Proof) {
        let n = proof.after.len();
        for slip in self.all.iter().rev() {
            for (_, rows) in &mut proof.predictions {
                slip.remedy.undo(rows, n);
            }
            slip.remedy.undo(&mut proof.after, n);
        }
        proof.after.iter_mut().for_each(|rms| *rms = rms.abs());
        if let Some(errors) = &self.as_recorded {
            proof.before.clone_from(errors);
        }
        // Nothing is corrected at a joint that was left out.
        for slip in &self.all {
            if let Remedy::Unmeasured(j, _) | Remedy::EffortWithoutSign(j) = slip.remedy {
                proof.after[j] = proof.before[j];
            }
        }
    }
}

fn finding(slip: &Slip, joints: &[String], unit: &str) -> Finding {
    let kind = slip.remedy.kind().unwrap_or(UNKNOWN.name);
    let (joint, other) = joints_of(&slip.remedy);
    let mut parameters = BTreeMap::from([("kind".to_owned(), Value::from(kind))]);
    if let Some(other) = other {
        parameters.insert(
            "source_joint".to_owned(),
            Value::from(joints[other].as_str()),
        );
    }
    let factor = match slip.remedy {
        Remedy::EffortScaled(factor)
        | Remedy::ConstantsScaled(factor)
        | Remedy::Velocity(_, factor) => Some(factor),
        _ => None,
    };
    if let Some(factor) = factor {
        parameters.insert("factor".to_owned(), Value::from(factor));
    }
    let fall = |(_, [before, after]): &(usize, [f64; 2])| (before * before - after * after).sqrt();
    Finding {
        effect: UNKNOWN.name.to_owned(),
        joint: joint.map(|j| joints[j].clone()),
        parameters,
        confidence: CONFIDENCE,
        explains: slip.share,
        effort_rms: slip.mended.iter().map(fall).fold(0.0, f64::max),
        sentence: sentence(slip, joints, unit),
        ..Finding::default()
    }
}

/// Returns the joint of a fault, and the other joint of a swap.
fn joints_of(remedy: &Remedy) -> (Option<usize>, Option<usize>) {
    match *remedy {
        Remedy::Swapped(a, b) | Remedy::NamesSwapped(a, b) => (Some(a), Some(b)),
        Remedy::EffortTurned(j)
        | Remedy::EffortWithoutSign(j)
        | Remedy::PositionTurned(j)
        | Remedy::JointTurned(j)
        | Remedy::Unmeasured(j, _)
        | Remedy::DropsOut(j, _) => (Some(j), None),
        Remedy::Velocity(joint, _) => (joint, None),
        _ => (None, None),
    }
}

/// Returns the fault, the evidence and the instruction.
fn sentence(slip: &Slip, joints: &[String], unit: &str) -> String {
    let name = |j: usize| joints[j].as_str();
    let (wrong, cure) = match slip.remedy {
        Remedy::Swapped(a, b) => (
            format!("The efforts of {} and {} are swapped.", name(a), name(b)),
            "Exchange them in the driver.".to_owned(),
        ),
        Remedy::NamesSwapped(a, b) => (
            format!("Joints {} and {} have each other's name.", name(a), name(b)),
            "Exchange the names in the driver, or in the URDF.".to_owned(),
        ),
        Remedy::EffortTurned(j) => (
            format!("The effort of {} has the other sign.", name(j)),
            "Turn it in the driver.".to_owned(),
        ),
        Remedy::EffortWithoutSign(j) => without_sign(name(j)),
        Remedy::PositionTurned(j) => (
            format!("The position of {} has the other sign.", name(j)),
            "Turn it in the driver.".to_owned(),
        ),
        Remedy::JointTurned(j) => (
            format!("Joint {} counts the other way than in the URDF.", name(j)),
            "Turn its axis there, or its position and effort in the driver.".to_owned(),
        ),
        Remedy::Degrees => (
            "The positions are in degrees.".to_owned(),
            "Convert them to rad in the driver.".to_owned(),
        ),
        Remedy::GravitySubtracted => (
            "Gravity is subtracted from the effort.".to_owned(),
            "Record the measured effort with gravity.".to_owned(),
        ),
        Remedy::IsCurrent => (
            "The effort is no torque in N m: it is motor current, or a torque on the motor's side of the gear.".to_owned(),
            "Give --effort-unit A.".to_owned(),
        ),
        Remedy::IsOfRating => (
            "The effort is no torque in N m: it is larger at every joint, and at each by another factor, as a share of the joint's \
             rated torque would be.".to_owned(),
            "Give --effort-unit A: a scale of each joint is then found from the recordings.".to_owned(),
        ),
        Remedy::IsTorque => (
            "The effort is torque in N m and not motor current in A. Drives of geared joints give 3 N m/A and more.".to_owned(),
            "Give --effort-unit Nm.".to_owned(),
        ),
        Remedy::EffortScaled(factor) => (
            format!("The effort is {} times the torque in N m at every joint.", number(factor)),
            format!("Divide it by {} in the driver, or find its unit.", number(factor)),
        ),
        Remedy::ConstantsScaled(factor) => (
            format!("The torque constants are {}.", times_off(factor)),
            format!("Multiply them by {}.", number(factor)),
        ),
        Remedy::ConstantsWrong => (
            "The torque constants are wrong, each by another factor.".to_owned(),
            "Leave them out: they are then found from the recordings.".to_owned(),
        ),
        Remedy::Velocity(joint, factor) => (
            format!(
                "The recorded velocity of {} is {} times the change of the recorded position.",
                joint.map_or("all joints", name),
                number(factor)
            ),
            format!("Divide it by {} in the driver.", number(factor)),
        ),
        Remedy::Unmeasured(joint, effort) => unmeasured(name(joint), effort, unit),
        Remedy::DropsOut(joint, messages) => drops_out(name(joint), messages),
        Remedy::BaseTurned(_) | Remedy::Payload(_) => (String::new(), String::new()),
    };
    let evidence = evidence(slip, joints, unit);
    format!("{wrong} {evidence}{cure}")
}

/// Returns fault and instruction for an effort that is recorded as a magnitude.
fn without_sign(joint: &str) -> (String, String) {
    let wrong = format!(
        "The effort of {joint} has no sign: it is never below zero, though the motion requires torques of both signs. The \
         joint is not evaluated further."
    );
    let cure = "Let the driver publish the effort with its sign.".to_owned();
    (wrong, cure)
}

/// Returns fault and instruction for an effort that never changes.
fn unmeasured(joint: &str, effort: f64, unit: &str) -> (String, String) {
    let wrong = format!(
        "The effort of {joint} stays the same through each recording, such as {} {unit}, while the joint moves: it is \
         not measured, and the joint is not evaluated further.",
        number(effort)
    );
    let cure = "Look at its sensor, or at what the driver fills in.";
    (wrong, cure.to_owned())
}

/// Returns fault and instruction for an effort that briefly drops to zero.
fn drops_out(joint: &str, messages: u64) -> (String, String) {
    let wrong = format!(
        "The effort of {joint} drops to exactly zero for moments, in {messages} messages; their rows are left out."
    );
    (
        wrong,
        "Check the plug and the cable of its sensor.".to_owned(),
    )
}

/// Returns the error of torque constants that must be multiplied by `factor`.
fn times_off(factor: f64) -> String {
    if factor > 1.0 {
        format!("{} times too small", number(factor))
    } else {
        format!("{} times too large", number(1.0 / factor))
    }
}

/// Returns the evidence: the tried correction and its result.
fn evidence(slip: &Slip, joints: &[String], unit: &str) -> String {
    let mut text = String::new();
    if !slip.mended.is_empty() {
        let of = |(j, [before, after]): &(usize, [f64; 2])| {
            let (before, after) = (number(*before), number(*after));
            format!("from {before} to {after} {unit} at {}", joints[*j])
        };
        let falls: Vec<String> = slip.mended.iter().map(of).collect();
        text += &format!(
            "Tried: with this corrected, the error after friction falls {}, in every recording. ",
            falls.join(", ")
        );
    }
    let is_effort = !matches!(slip.remedy, Remedy::Velocity(..));
    if is_effort && !slip.slopes.is_empty() {
        let of = |(j, slope): &(usize, f64)| format!("{} at {}", number(*slope), joints[*j]);
        let slopes: Vec<String> = slip.slopes.iter().map(of).collect();
        text += &format!(
            "Ratio of the measured to the required effort: {}. ",
            slopes.join(", ")
        );
    }
    text
}
