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
    /// Why nothing was evaluated, if so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The verdict in a sentence.
    pub summary: String,
    /// Unit of the recordings' effort: `Nm` or `A`.
    pub effort_unit: String,
    /// The effects that the twin leaves out. The one that explains most comes first.
    pub findings: Vec<Finding>,
    /// Hypotheses that were rejected, with the reason.
    pub rejected: Vec<Rejected>,
    /// Where the mismatch is, without a hypothesis; the largest first.
    pub located: Vec<Located>,
    /// The smallest effects that would have been found. Smaller ones may be present.
    pub undetectable: Vec<Undetectable>,
    /// Motions that would tell apart what this data cannot.
    pub next_motions: Vec<NextMotion>,
    /// What the corrected twin leaves beyond the noise, by joint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remaining: Vec<Remaining>,
    /// Notes: lost samples, gains that are not identifiable, standstill.
    pub notes: Vec<String>,
    /// The joints, in URDF order.
    pub joints: Vec<String>,
    /// Those of them that slide: their efforts are in N where those of the others are in N m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sliding_joints: Vec<String>,
    /// RMS of measured effort minus the twin's over all hold-out samples, unfiltered, by joint \[effort unit\].
    pub holdout_rms_before: Vec<f64>,
    /// The same of the corrected twin.
    pub holdout_rms_after: Vec<f64>,
    /// White noise of the measured effort, by joint \[effort unit\], estimated from its fastest changes on the fitted recordings.
    pub noise_floor: Vec<f64>,
    /// By hold-out recording, the file with the corrected twin's effort.
    pub holdout_predictions: BTreeMap<String, String>,
}

impl Report {
    /// The unit of the recordings' effort in text: at a joint, or at most of them.
    pub fn effort_unit_at(&self, joint: Option<&str>) -> &str {
        let slides = |joint| self.sliding_joints.iter().any(|other| other == joint);
        match (self.effort_unit.as_str(), joint.is_some_and(slides)) {
            ("Nm", true) => "N",
            ("Nm", false) => "N m",
            (unit, _) => unit,
        }
    }

    /// Whether all but the faults that are listed first is of the recordings without these faults.
    pub fn is_of_mended(&self) -> bool {
        self.findings.iter().any(Finding::is_slip)
    }

    /// The motions to record next, a sentence and its motions each; a motion that is the same for several joints has one
    /// sentence.
    pub fn grouped_motions(&self) -> Vec<(String, Vec<&NextMotion>)> {
        // Stands for the joint in a sentence.
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

    /// Whether there is a corrected twin for a pipeline. One of mended recordings would not fit what the robot publishes.
    pub fn hands_out_twin(&self) -> bool {
        self.verdict != Verdict::NotEvaluated && self.mended().next().is_none()
    }

    /// The faults of the recordings that were mended and that a pipeline would meet again. It does not use a velocity that
    /// is not the derivative of the position, and leaves efforts out that drop to zero.
    pub fn mended(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| {
            finding.is_slip() && !finding.is_of_velocity() && finding.known_as() != "effort_dropout"
        })
    }
}

/// The answer of an explanation in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// All mismatch has named causes.
    Explained,
    /// The twin is right as it is.
    NothingMissing,
    /// Some mismatch is explained by no effect of the library.
    UnknownRemains,
    /// The data does not allow a verdict.
    NotEvaluated,
}

/// What the corrected twin leaves at a joint beyond the noise. Efforts are compared below the cutoff of the fit, without the
/// joint's standstills.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Remaining {
    /// The joint.
    pub joint: String,
    /// RMS on the fitted recordings \[effort unit\].
    pub rms: f64,
    /// RMS on the held-out ones \[effort unit\].
    pub holdout_rms: Option<f64>,
    /// The measurement's white noise there \[effort unit\].
    pub noise: f64,
    /// What it goes with, when and where.
    pub sentence: String,
}

impl Remaining {
    /// RMS on the fitted or the held-out recordings, where it is larger \[effort unit\].
    pub fn largest_rms(&self) -> f64 {
        self.rms.max(self.holdout_rms.unwrap_or(0.0))
    }

    /// The same in units of the measurement's white noise.
    pub fn over_noise(&self) -> f64 {
        self.largest_rms() / self.noise.max(f64::MIN_POSITIVE)
    }
}

/// The `kind` of an `unknown` that says only where something remains.
pub const WITHOUT_LAW: &str = "without_law";
/// The parameter of an absent tool that is its share of what the twin has there.
pub const SHARE_OF_CARRIED: &str = "share_of_carried";

/// An effect that the twin leaves out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Finding {
    /// Canonical name.
    pub effect: String,
    /// The joint it is in, for effects of a joint.
    pub joint: Option<String>,
    /// The link it is in, for effects of a link.
    pub link: Option<String>,
    /// Numbers (and names, e.g. `source_joint`) by canonical name.
    pub parameters: BTreeMap<String, Value>,
    /// 95 % intervals of the numbers.
    pub intervals_95: BTreeMap<String, [f64; 2]>,
    /// Whether its efforts are in A, although the names of its parameters say N m: the torque scale of its joint is not
    /// known.
    #[serde(default, skip_serializing_if = "is_false")]
    pub in_amperes: bool,
    /// Whether its joint slides: its numbers are in N and m, although the names of its parameters say N m and rad.
    #[serde(default, skip_serializing_if = "is_false")]
    pub slides: bool,
    /// Probability that effect and place are right, up to what no recording can tell apart.
    pub confidence: f64,
    /// The recording that the times refer to. If absent: each recording or, for a lasting change, the session.
    pub recording: Option<String>,
    /// When it begins \[s\].
    pub t_start: Option<f64>,
    /// When it ends \[s\].
    pub t_end: Option<f64>,
    /// Share of the mismatch's variance that it explains, over all joints in units of their noise.
    pub explains: f64,
    /// Logarithm of the odds of the explanation with it against the best one without it \[nats\].
    #[serde(default)]
    pub evidence_nats: f64,
    /// How much effort it is: what is left without it less what is left with it, as root mean square at the joint where
    /// that is most \[effort unit\].
    #[serde(default)]
    pub effort_rms: f64,
    /// Rivals that this data cannot tell apart, most probable first.
    pub equivalent_to: Vec<Rival>,
    /// The finding as a sentence.
    pub sentence: String,
}

impl Finding {
    /// The effect, by the name that [`tauscope_dynamics::terms`] knows it by: that of an `unknown` with a law is its `kind`.
    pub fn known_as(&self) -> &str {
        let kind = self.parameters.get("kind").and_then(Value::as_str);
        let is_law = |kind: &str| effect(kind).is_some_and(|e| e.said() == self.effect);
        kind.filter(|kind| is_law(kind) || slip_words::words(kind).is_some())
            .unwrap_or(&self.effect)
    }

    /// Whether it says only that something remains at its joint: the correction has nothing for it.
    pub fn is_without_law(&self) -> bool {
        self.parameters.get("kind").and_then(Value::as_str) == Some(WITHOUT_LAW)
    }

    /// Whether it is a body that is off by as much as those of a URDF are.
    pub fn is_body_off(&self) -> bool {
        let share = self
            .parameters
            .get(SHARE_OF_CARRIED)
            .and_then(Value::as_f64);
        share.is_some_and(|share| share < LEAST_ABSENT)
    }

    /// Whether it is a fault of the recordings, or of what is said of them, and no physics.
    pub fn is_slip(&self) -> bool {
        slip_words::words(self.known_as()).is_some()
    }

    /// Whether it is such a fault of the recorded velocity alone.
    pub(crate) fn is_of_velocity(&self) -> bool {
        self.known_as() == "velocity_scale"
    }

    /// A parameter's name without its unit, and the unit that its number is in.
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
    /// The joint it is in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<String>,
    /// The link it is in.
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
    /// Why.
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
    /// Share of the joint's mismatch (sum of squares before correction) that lies there.
    pub share_of_residual: f64,
    /// RMS of the mismatch there over RMS of the noise.
    pub over_noise: f64,
}

/// The smallest effect that would have been found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Undetectable {
    /// Canonical name.
    pub effect: String,
    /// The joint.
    pub joint: Option<String>,
    /// The link.
    pub link: Option<String>,
    /// By parameter.
    pub smallest_findable: BTreeMap<String, f64>,
    /// Whether its efforts are in A and not in N m, whatever the names of its numbers say.
    #[serde(default, skip_serializing_if = "is_false")]
    pub in_amperes: bool,
    /// Whether its joint slides: its numbers are in N and m, whatever their names say.
    #[serde(default, skip_serializing_if = "is_false")]
    pub slides: bool,
}

/// A motion that would separate rivals that tie.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextMotion {
    /// The effects it separates.
    pub separates: Vec<Rival>,
    /// The instruction as text.
    pub sentence: String,
    /// A file with the trajectory: header `t,` and joint names, positions in rad or m.
    pub trajectory: Option<String>,
}

/// Series for the pictures: one recording, one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointPicture {
    /// The joint.
    pub joint: String,
    /// \[s\]
    pub time_s: Vec<f64>,
    /// Position \[rad or m\].
    pub position: Vec<f64>,
    /// Velocity \[rad/s or m/s\].
    pub velocity: Vec<f64>,
    /// Measured effort \[effort unit\].
    pub measured: Vec<f64>,
    /// The twin's effort before.
    pub before: Vec<f64>,
    /// The corrected twin's effort.
    pub after: Vec<f64>,
}

/// Everything that is drawn of one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordingPicture {
    /// The recording.
    pub recording: String,
    /// Whether nothing was fitted on it.
    pub held_out: bool,
    /// Stamp of its first sample \[ns since the epoch\].
    pub start_ns: i64,
    /// By joint, in URDF order; thinned to at most 2000 samples.
    pub joints: Vec<JointPicture>,
}
