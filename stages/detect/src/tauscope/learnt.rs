//! State learnt from contact-free recordings, as a pipeline file holds it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spans::WINDOWS_S;
use super::tail::Tail;
use super::usual::LearntUsual;
use crate::frame::joints;

pub use crate::frame::Discriminant as Kinds;

/// Boundaries of the speed classes, as shares of the joint's reference speed.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const EDGES: [f64; BINS - 1] = [0.02, 0.05, 0.12, 0.3];
/// Number of speed classes.
pub(super) const BINS: usize = 5;
/// Contact-free time below which neither a tail nor a rate of false alarms can be estimated \[s\].
/// Statistical: 20 blocks of a second, of which 15 % are three peaks; the mean of fewer peaks is meaningless.
pub(super) const ENOUGH_S: f64 = 20.0;
/// Number of measurements for the classification of contacts.
pub(super) const MEASURED: usize = 3;

/// State learnt from contact-free recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Learnt {
    /// Sample rate of the recordings \[Hz\].
    pub rate_hz: f64,
    /// Reference speed and baseline by joint, in URDF order.
    pub joints: Vec<LearntJoint>,
    /// Noise by window, the shortest window first.
    pub windows: Vec<LearntWindow>,
    /// Noise of the stationary arm; absent if the recordings contain too little standstill.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<LearntRest>,
    /// Tail of the contact-free score, from which the threshold follows.
    pub tail: Tail,
    /// Square roots of the largest scores of the newest seconds in which the arm moved while the detector ran; at
    /// most an hour of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub peaks_since: Vec<f32>,
    /// Contact-free time from which the state was learnt \[s\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_s: Option<f64>,
    /// By link, the smallest force that reaches a score of 1; empty if there is no model of the robot.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub smallest: Vec<Smallest>,
    /// Discriminant between collisions and cooperations, if the labels distinguish them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kinds: Option<Kinds>,
    /// Statistics of the contacts from which `kinds` was learnt.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind_contacts: Option<KindContacts>,
}

/// Reference speed and baseline of a joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntJoint {
    /// Name of the joint.
    pub name: String,
    /// Reference speed \[rad/s\]: the 95 % quantile of the joint's speed. The speed classes are shares of it.
    pub fast_rad_s: f64,
    /// Baseline of its residual; absent if there was too little data or it did not predict held-out recordings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usual: Option<LearntUsual>,
}

/// Noise of the mean residual over one window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntWindow {
    /// Root mean square by joint and speed class, while the efforts do not change \[effort unit\].
    pub noise: Vec<Vec<f64>>,
    /// By joint, the noise per recent change that both efforts have in common; added as a root sum of squares.
    pub unquiet: Vec<f64>,
    /// Inverse of the joints' correlation matrix, row by row.
    pub inverse_correlation: Vec<f64>,
    /// Squared Mahalanobis length that one of a thousand contact-free samples exceeds: the unit of the score.
    pub usual: f64,
}

/// Returns the class of a speed.
pub(crate) fn bin(joint: &LearntJoint, speed_rad_s: f64) -> usize {
    let share = speed_rad_s / joint.fast_rad_s;
    EDGES.iter().filter(|edge| share >= **edge).count()
}

/// Noise of a stationary arm: changes of its mean effort while nothing touches it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntRest {
    /// By window and joint, the 68.3 % quantile of the absolute changes \[effort unit\].
    pub noise: Vec<Vec<f64>>,
    /// Squared length of the changes, in units of that noise, that one of a hundred contact-free samples exceeds.
    pub usual: f64,
    /// Tail of the contact-free score at standstill.
    pub tail: Tail,
}

/// Force on a link that reaches a score of 1 once it has lasted as long as the longest window. The force for another
/// score is proportional to the square root of the score.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Smallest {
    /// Name of the link.
    pub link: String,
    /// Force that is sufficient in half of the postures and directions \[N\]; absent if the joints do not sense it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_n: Option<f64>,
    /// Force that is sufficient in nine of ten postures and directions \[N\]; absent if the joints do not sense it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_n: Option<f64>,
}

/// Statistics of the contacts from which the kinds were learnt, without the prior. The measurements are the agreement
/// of the residual with a force against the tool's motion (-1 to 1), the logarithm of the tool's speed, and the
/// logarithm of the force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KindContacts {
    /// Number of collisions and of cooperations.
    pub counts: [f64; 2],
    /// Mean measurements of collisions and of cooperations.
    pub means: [[f64; MEASURED]; 2],
    /// Covariance of the measurements within a kind.
    pub covariance: [[f64; MEASURED]; MEASURED],
}

impl Learnt {
    /// Returns the reason why the state does not fit a robot with these joints, as a clause.
    pub(super) fn fault(&self, joint_names: &[String]) -> Option<String> {
        let found = self.joints.iter().map(|joint| &joint.name);
        if let Some(reason) = joints::in_other_order(found, joint_names) {
            return Some(reason);
        }
        let n = joint_names.len();
        let fits = |window: &LearntWindow| {
            window.inverse_correlation.len() == n * n
                && window.unquiet.len() == n
                && window.noise.len() == n
                && window.noise.iter().all(|noise| noise.len() == BINS)
        };
        let whole = (WINDOWS_S.len() - 1..=WINDOWS_S.len()).contains(&self.windows.len())
            && self.windows.iter().all(fits);
        if !whole {
            let windows = WINDOWS_S.len();
            return Some(format!(
                "is not whole: it needs noise by {n} joints and {BINS} speeds for each of {windows} windows"
            ));
        }
        if self.rest.as_ref().is_some_and(|rest| !rest.is_whole(n)) {
            return Some(format!(
                "is not whole: at rest it needs noise by {n} joints for each window"
            ));
        }
        let is_rate = self.rate_hz > 0.0;
        if !is_rate {
            return Some("has a rate that is not above 0".to_owned());
        }
        let mut usual = self.joints.iter().filter_map(|joint| joint.usual.as_ref());
        (!usual.all(LearntUsual::is_whole))
            .then(|| "is not whole: a joint's `usual` is incomplete or invalid".to_owned())
    }
}

impl LearntRest {
    /// Returns whether it holds the noise of this number of `joints`.
    pub(super) fn is_whole(&self, joints: usize) -> bool {
        self.noise.len() == WINDOWS_S.len() && self.noise.iter().all(|noise| noise.len() == joints)
    }
}
