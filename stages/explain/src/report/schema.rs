//! What an explanation says: `report.json`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use tauscope_dynamics::terms::words;

use crate::report::sentences::in_amperes;

/// Everything that was found, as files and people get it.
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
    /// The physics that was left out, that which explains most first.
    pub findings: Vec<Finding>,
    /// What was considered and not named, and why.
    pub rejected: Vec<Rejected>,
    /// Where the mismatch sits, without a hypothesis; the largest first.
    pub located: Vec<Located>,
    /// What could have hidden: the smallest effect that would have been found.
    pub undetectable: Vec<Undetectable>,
    /// Motions that would tell apart what this data cannot.
    pub next_motions: Vec<NextMotion>,
    /// What else a reader should know: lost samples, gains that cannot be identified, standstill.
    pub notes: Vec<String>,
    /// The joints, in URDF order.
    pub joints: Vec<String>,
    /// RMS of measured effort minus the twin's over all hold-out samples, unfiltered, by joint \[effort unit\].
    pub holdout_rms_before: Vec<f64>,
    /// The same of the corrected twin.
    pub holdout_rms_after: Vec<f64>,
    /// White noise of the measured effort, by joint \[effort unit\], estimated from its fastest changes on the fitted recordings.
    pub noise_floor: Vec<f64>,
    /// By hold-out recording, the file with the corrected twin's effort.
    pub holdout_predictions: BTreeMap<String, String>,
}

/// What an explanation comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// What was left out has names, and nothing else is left.
    Explained,
    /// The twin is right as it is.
    NothingMissing,
    /// Something is left that no name fits.
    UnknownRemains,
    /// The data does not allow a verdict.
    NotEvaluated,
}

/// A piece of physics that the twin leaves out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Whether its efforts are in A and not in N m, whatever the names of its numbers say: nobody knows the scale of its joint.
    #[serde(default, skip_serializing_if = "is_false")]
    pub in_amperes: bool,
    /// Probability that effect and place are right, up to what no recording can tell apart.
    pub confidence: f64,
    /// The recording that the times hold for; all if absent, or the session for a change that lasts.
    pub recording: Option<String>,
    /// When it begins \[s\].
    pub t_start: Option<f64>,
    /// When it ends \[s\].
    pub t_end: Option<f64>,
    /// Share of the mismatch's variance, over all joints in units of their noise, that needs it.
    pub explains: f64,
    /// What it explains over what is left beside it: squares, at the joint where that is most.
    #[serde(default)]
    pub over_rest: f64,
    /// Evidence for it rather than for leaving it out, each row counted as a fraction of an independent sample \[nats\].
    #[serde(default)]
    pub evidence_nats: f64,
    /// How much effort it is: what is left without it less what is left with it, as root mean square at the joint where
    /// that is most \[effort unit\].
    #[serde(default)]
    pub effort_rms: f64,
    /// Rivals that this data cannot tell apart, most probable first.
    pub equivalent_to: Vec<Rival>,
    /// In words.
    pub sentence: String,
}

impl Finding {
    /// A parameter's name without its unit, and the unit that its number is in.
    pub fn label_and_unit<'n>(&self, name: &'n str) -> (&'n str, String) {
        match words::unit(name) {
            Some((stem, unit)) if self.in_amperes => (stem, in_amperes(unit)),
            Some((stem, unit)) => (stem, unit.to_owned()),
            None => (name, String::new()),
        }
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

/// A hypothesis that was not taken.
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

/// Where the mismatch sits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Located {
    /// The joint.
    pub joint: String,
    /// In which state or at which time, in words.
    #[serde(rename = "where")]
    pub place: String,
    /// Share of the joint's mismatch (sum of squares before correction) that is there.
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
}

/// A motion that would tell a class apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextMotion {
    /// The effects it separates.
    pub separates: Vec<Rival>,
    /// What to do, in words.
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
