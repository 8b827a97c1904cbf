//! What contact-free recordings have taught, as a pipeline file holds it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::spans::WINDOWS_S;
use super::tail::Tail;
use super::usual::LearntUsual;
use crate::frame::joints;

pub use crate::frame::Discriminant as Kinds;

/// Where speeds are divided, as shares of a joint's usual highest speed.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const EDGES: [f64; BINS - 1] = [0.02, 0.05, 0.12, 0.3];
/// How many classes of speed there are.
pub(super) const BINS: usize = 5;
/// With less than this a tail cannot be told, nor how often a threshold is exceeded \[s\].
/// Statistical: 20 blocks of a second, of which 15 % are three peaks; fewer have no mean worth the name.
pub(super) const ENOUGH_S: f64 = 20.0;
/// How many measurements tell the kinds.
pub(super) const MEASURED: usize = 3;

/// What contact-free recordings taught.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Learnt {
    /// Samples a second that it was learnt from.
    pub rate_hz: f64,
    /// By joint in URDF order.
    pub joints: Vec<LearntJoint>,
    /// By window.
    pub windows: Vec<LearntWindow>,
    /// Of a standing arm, where there was enough of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<LearntRest>,
    /// How often the score exceeds what by chance.
    pub tail: Tail,
    /// Roots of the largest scores of the newest seconds in which the arm moved while the detector ran, at most an hour of
    /// them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub peaks_since: Vec<f32>,
    /// How much of contact-free time all of it is from \[s\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_s: Option<f64>,
    /// By link, the smallest force that reaches a score of 1; empty where the robot is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub smallest: Vec<Smallest>,
    /// What parts collisions from cooperations, where the labels told them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kinds: Option<Kinds>,
    /// The contacts that `kinds` was learnt from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind_contacts: Option<KindContacts>,
}

/// A joint's speeds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntJoint {
    /// Its name.
    pub name: String,
    /// Its usual highest speed \[rad/s\], by which speeds are classed.
    pub fast_rad_s: f64,
    /// What of its residual is usual, where that was told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usual: Option<LearntUsual>,
}

/// The mean residual over one window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntWindow {
    /// Root mean square by joint and class of speed, where the expected effort does not change \[effort unit\].
    pub noise: Vec<Vec<f64>>,
    /// By joint, the share of what the expected effort has changed by of late that adds to it.
    pub unquiet: Vec<f64>,
    /// Inverse of the joints' correlation, row by row.
    pub inverse_correlation: Vec<f64>,
    /// Squared Mahalanobis length that one of a thousand contact-free samples exceeds.
    pub usual: f64,
}

/// The class of a speed.
pub(crate) fn bin(joint: &LearntJoint, speed_rad_s: f64) -> usize {
    let share = speed_rad_s / joint.fast_rad_s;
    EDGES.iter().filter(|edge| share >= **edge).count()
}

/// How the mean effort of a standing arm changes while nothing touches it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntRest {
    /// By window and joint, what two of three changes stay below \[effort unit\].
    pub noise: Vec<Vec<f64>>,
    /// Squared length in units of that noise that one of a hundred contact-free samples exceeds.
    pub usual: f64,
    /// How often the score exceeds what by chance.
    pub tail: Tail,
}

/// The force on a link that reaches a score of 1 once it has lasted as long as the longest window; it grows with the root of the score.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Smallest {
    /// The link.
    pub link: String,
    /// In half of the postures and directions no more is needed \[N\]; none where they are not felt.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_n: Option<f64>,
    /// In nine of ten of them \[N\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_n: Option<f64>,
}

/// The contacts that the kinds were learnt from, without the prior. Measurements are those of `kinds.rs`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KindContacts {
    /// How many collisions and cooperations there were.
    pub counts: [f64; 2],
    /// Mean measurements of either.
    pub means: [[f64; MEASURED]; 2],
    /// Covariance of the measurements within a kind.
    pub covariance: [[f64; MEASURED]; MEASURED],
}

impl Learnt {
    /// What is wrong with it for a robot with these joints, as a clause.
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
            .then(|| "is not whole: what of a joint's residual is usual".to_owned())
    }
}

impl LearntRest {
    /// Whether it holds what `joints` need.
    pub(super) fn is_whole(&self, joints: usize) -> bool {
        self.noise.len() == WINDOWS_S.len() && self.noise.iter().all(|noise| noise.len() == joints)
    }
}
