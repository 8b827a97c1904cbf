//! The report of an explanation: `report.json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use tauscope_dynamics::terms::{LEAST_ABSENT, effect, words};

use crate::report::sentences::in_units;
use crate::report::slip_words;

/// The report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Name of the case.
    pub case: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The reason why nothing was evaluated, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The verdict in a sentence.
    pub summary: String,
    /// Unit of the recordings' effort: `Nm` or `A`.
    pub effort_unit: String,
    /// The effects that the twin lacks. The one that explains most comes first.
    pub findings: Vec<Finding>,
    /// Hypotheses that were rejected, with the reason.
    pub rejected: Vec<Rejected>,
    /// Location of the mismatch, without a hypothesis; the largest first.
    pub located: Vec<Located>,
    /// Detection limits of the effects. Smaller effects may be present.
    pub undetectable: Vec<Undetectable>,
    /// Motions that would distinguish effects that this data does not.
    pub next_motions: Vec<NextMotion>,
    /// Remaining residual of the corrected twin beyond the noise, by joint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remaining: Vec<Remaining>,
    /// Notes: lost samples, gains that are not identifiable, standstill.
    pub notes: Vec<String>,
    /// The joints, in URDF order.
    pub joints: Vec<String>,
    /// Prismatic joints: their efforts are in N where those of the others are in N m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sliding_joints: Vec<String>,
    /// RMS of measured effort minus the twin's over all held-out samples, unfiltered, by joint \[effort unit\].
    pub holdout_rms_before: Vec<f64>,
    /// RMS of measured effort minus the corrected twin's over the same samples, by joint \[effort unit\].
    pub holdout_rms_after: Vec<f64>,
    /// White noise of the measured effort, by joint \[effort unit\], estimated from its fastest changes on the fitted
    /// recordings.
    pub noise_floor: Vec<f64>,
    /// File with the corrected twin's effort, by held-out recording.
    pub holdout_predictions: BTreeMap<String, String>,
    /// Motion of the simulated arm under the recorded commands, if there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated: Option<Simulated>,
}

/// Errors of the simulated arm under the commands of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Simulated {
    /// The recording.
    pub recording: String,
    /// RMS of simulated minus measured position of the robot's model as it is, by joint \[rad or m\].
    pub rms_before: Vec<f64>,
    /// RMS of simulated minus measured position of the corrected model, by joint \[rad or m\].
    pub rms_after: Vec<f64>,
}

impl Report {
    /// Returns the unit of the recordings' effort in text: at a joint, or at most of them.
    pub fn effort_unit_at(&self, joint: Option<&str>) -> &str {
        let slides = |joint| self.sliding_joints.iter().any(|other| other == joint);
        match (self.effort_unit.as_str(), joint.is_some_and(slides)) {
            ("Nm", true) => "N",
            ("Nm", false) => "N m",
            (unit, _) => unit,
        }
    }

    /// Whether the recordings have faults, so that all other content is that of the corrected recordings.
    pub fn is_of_mended(&self) -> bool {
        self.findings.iter().any(Finding::is_slip)
    }

    /// Returns the motions to record next, grouped by sentence; a motion that is the same for several joints has one
    /// sentence.
    pub fn grouped_motions(&self) -> Vec<(String, Vec<&NextMotion>)> {
        // Placeholder of the joint in a sentence.
        const ITS: &str = "joint \0 ";
        let joint_of = |motion: &NextMotion| {
            let first = motion.separates.first();
            first.and_then(|it| it.joint.clone()).unwrap_or_default()
        };
        let mut groups: Vec<(String, Vec<&NextMotion>)> = Vec::new();
        for motion in &self.next_motions {
            let of_joint = format!("joint {} ", joint_of(motion));
            let sentence = motion.sentence.replace(&of_joint, ITS);
            match groups.iter_mut().find(|(same, _)| *same == sentence) {
                Some((_, motions)) => motions.push(motion),
                None => groups.push((sentence, vec![motion])),
            }
        }
        let all = self.joints.len();
        let groups = groups.into_iter();
        let in_words = groups.map(|(sentence, motions)| {
            let mut joints: Vec<String> = Vec::new();
            for joint in motions.iter().map(|motion| joint_of(motion)) {
                if !joints.contains(&joint) {
                    joints.push(joint);
                }
            }
            let its = match &joints[..] {
                joints if joints.len() > 1 && joints.len() == all => "every joint ".to_owned(),
                [first @ .., last] if !first.is_empty() => {
                    format!("each of the joints {} and {last} ", first.join(", "))
                }
                one => format!("joint {} ", one.concat()),
            };
            (sentence.replace(ITS, &its), motions)
        });
        in_words.collect()
    }

    /// Whether a corrected twin is written for a pipeline. That of corrected recordings would not match what the
    /// robot publishes.
    pub fn hands_out_twin(&self) -> bool {
        self.verdict != Verdict::NotEvaluated && self.mended().next().is_none()
    }

    /// Returns the corrected faults of the recordings that also affect a pipeline. A pipeline does not use a velocity
    /// that is not the derivative of the position, and it excludes efforts that drop to zero.
    pub fn mended(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| {
            finding.is_slip() && !finding.is_of_velocity() && finding.known_as() != "effort_dropout"
        })
    }
}

/// The verdict of an explanation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// All mismatch has named causes.
    Explained,
    /// The twin needs no correction.
    NothingMissing,
    /// No effect of the library explains part of the mismatch.
    UnknownRemains,
    /// The data does not allow a verdict.
    NotEvaluated,
}

/// The remaining residual of the corrected twin at a joint beyond the noise. Efforts are compared below the cutoff of
/// the fit, without the joint's standstills.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Remaining {
    /// The joint.
    pub joint: String,
    /// RMS on the fitted recordings \[effort unit\].
    pub rms: f64,
    /// RMS on the held-out recordings \[effort unit\].
    pub holdout_rms: Option<f64>,
    /// White noise of the measurement there \[effort unit\].
    pub noise: f64,
    /// A sentence with the quantity on which it depends, and where.
    pub sentence: String,
}

impl Remaining {
    /// Returns the larger RMS of the fitted and the held-out recordings \[effort unit\].
    pub fn largest_rms(&self) -> f64 {
        self.rms.max(self.holdout_rms.unwrap_or(0.0))
    }

    /// Returns the larger RMS in units of the measurement's white noise.
    pub fn over_noise(&self) -> f64 {
        self.largest_rms() / self.noise.max(f64::MIN_POSITIVE)
    }
}

/// The `kind` of an `unknown` that gives only the place of a remaining residual.
pub const WITHOUT_LAW: &str = "without_law";
/// Parameter of an absent tool: its share of the body that the twin has there.
pub const SHARE_OF_CARRIED: &str = "share_of_carried";

/// An effect that the twin lacks.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Finding {
    /// Canonical name.
    pub effect: String,
    /// The joint, for effects of a joint.
    pub joint: Option<String>,
    /// The link, for effects of a link.
    pub link: Option<String>,
    /// Parameters by canonical name: numbers, and names such as `source_joint`.
    pub parameters: BTreeMap<String, Value>,
    /// 95 % intervals of the numeric parameters.
    pub intervals_95: BTreeMap<String, [f64; 2]>,
    /// Whether its efforts are in A, although the names of its parameters say N m, because the torque scale of its
    /// joint is unknown.
    #[serde(default, skip_serializing_if = "is_false")]
    pub in_amperes: bool,
    /// Whether its joint is prismatic: its parameters are in N and m, although their names say N m and rad.
    #[serde(default, skip_serializing_if = "is_false")]
    pub slides: bool,
    /// Probability that effect and place are right, except for alternatives that no recording can distinguish.
    pub confidence: f64,
    /// The recording that the times refer to. If absent: each recording or, for a lasting change, the session.
    pub recording: Option<String>,
    /// Time at which it begins \[s\].
    pub t_start: Option<f64>,
    /// Time at which it ends \[s\].
    pub t_end: Option<f64>,
    /// Share of the variance of the mismatch that it explains, over all joints in units of their noise.
    pub explains: f64,
    /// Log-odds of the explanation with it against the best one without it \[nats\].
    #[serde(default)]
    pub evidence_nats: f64,
    /// RMS of its effort: the residual without it minus the residual with it, at the joint with the largest
    /// difference \[effort unit\].
    #[serde(default)]
    pub effort_rms: f64,
    /// Alternatives that this data does not distinguish, most probable first.
    pub equivalent_to: Vec<Rival>,
    /// The finding as a sentence.
    pub sentence: String,
}

impl Finding {
    /// Returns the effect by its name in [`tauscope_dynamics::terms`]: for an `unknown` with a law, its `kind`.
    pub fn known_as(&self) -> &str {
        let kind = self.parameters.get("kind").and_then(Value::as_str);
        let is_law = |kind: &str| effect(kind).is_some_and(|e| e.said() == self.effect);
        kind.filter(|kind| is_law(kind) || slip_words::words(kind).is_some())
            .unwrap_or(&self.effect)
    }

    /// Whether it only reports a remaining residual at its joint, without a correction.
    pub fn is_without_law(&self) -> bool {
        self.parameters.get("kind").and_then(Value::as_str) == Some(WITHOUT_LAW)
    }

    /// Whether it is an error of a body within the usual accuracy of a URDF.
    pub fn is_body_off(&self) -> bool {
        let share = self
            .parameters
            .get(SHARE_OF_CARRIED)
            .and_then(Value::as_f64);
        share.is_some_and(|share| share < LEAST_ABSENT)
    }

    /// Whether it is a fault of the recordings or of their description, not physics.
    pub fn is_slip(&self) -> bool {
        slip_words::words(self.known_as()).is_some()
    }

    /// Whether it is a fault of the recorded velocity alone.
    pub(crate) fn is_of_velocity(&self) -> bool {
        self.known_as() == "velocity_scale"
    }

    /// Returns a parameter's name without its unit, and the unit of its value.
    pub fn label_and_unit<'n>(&self, name: &'n str) -> (&'n str, String) {
        let (stem, unit) = words::unit(name).unwrap_or((name, ""));
        (stem, in_units(unit, self.in_amperes, self.slides))
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_false(value: &bool) -> bool {
    !value
}

/// An effect at a place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// Canonical name.
    pub effect: String,
    /// The joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// The link.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
}

/// A hypothesis that was rejected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Canonical name.
    pub effect: String,
    /// The joint.
    pub joint: Option<String>,
    /// The link.
    pub link: Option<String>,
    /// The reason.
    pub reason: String,
}

/// A state or time in which a joint's mismatch is concentrated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Located {
    /// The joint.
    pub joint: String,
    /// The state or time as text.
    #[serde(rename = "where")]
    pub place: String,
    /// Share of the joint's mismatch (sum of squares before correction) in this state or time.
    pub share_of_residual: f64,
    /// RMS of the mismatch there relative to the RMS of the noise.
    pub over_noise: f64,
}

/// Detection limit of an effect: the smallest size that would have been found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Undetectable {
    /// Canonical name.
    pub effect: String,
    /// The joint.
    pub joint: Option<String>,
    /// The link.
    pub link: Option<String>,
    /// The smallest detectable value, by parameter.
    pub smallest_findable: BTreeMap<String, f64>,
    /// Whether its efforts are in A and not in N m, regardless of the names of its parameters.
    #[serde(default, skip_serializing_if = "is_false")]
    pub in_amperes: bool,
    /// Whether its joint is prismatic: its parameters are in N and m, regardless of their names.
    #[serde(default, skip_serializing_if = "is_false")]
    pub slides: bool,
}

/// A motion that would distinguish equally likely alternatives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextMotion {
    /// The effects that it distinguishes.
    pub separates: Vec<Rival>,
    /// The instruction as text.
    pub sentence: String,
    /// File with the trajectory: header `t,` and joint names, positions in rad or m.
    pub trajectory: Option<String>,
}

/// Series for the plots: one recording, one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointPicture {
    /// The joint.
    pub joint: String,
    /// Time \[s\].
    pub time_s: Vec<f64>,
    /// Position \[rad or m\].
    pub position: Vec<f64>,
    /// Velocity \[rad/s or m/s\].
    pub velocity: Vec<f64>,
    /// Measured effort \[effort unit\].
    pub measured: Vec<f64>,
    /// The twin's effort before the correction \[effort unit\].
    pub before: Vec<f64>,
    /// The corrected twin's effort \[effort unit\].
    pub after: Vec<f64>,
}

/// The plots of one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingPicture {
    /// The recording.
    pub recording: String,
    /// Whether the recording was held out of the fit.
    pub held_out: bool,
    /// Stamp of its first sample \[ns since the epoch\].
    pub start_ns: i64,
    /// Series by joint, in URDF order; thinned to at most 2000 samples.
    pub joints: Vec<JointPicture>,
}
