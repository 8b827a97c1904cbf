//! `twin.yaml`: the corrected twin that `tauscope calibrate` and `tauscope explain` write and a
//! pipeline's `twin` stage loads.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_dynamics::terms::TermSpec;

/// The only version of the format so far.
pub const TWIN_FILE_VERSION: u32 = 1;

/// A corrected twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TwinFile {
    /// Version of this format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// The robot it was made for.
    pub robot: Robot,
    /// Unit of the measured effort that it predicts: `Nm` or `A`.
    pub effort_unit: String,
    /// Filters with which the residual was computed; noise and scores are valid for these filters only.
    pub filters: Filters,
    /// Correction by joint name. A joint that is not listed keeps gain 1 and offset 0.
    pub joints: BTreeMap<String, JointCorrection>,
    /// Physical effects that the rigid-body model lacks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<TermSpec>,
    /// Statistics of each detector's score on contact-free data, by detector. Its threshold is the mean plus k
    /// standard deviations.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub scores: BTreeMap<String, ScoreStatistics>,
    /// Origin of this file: program version, recordings and their hashes.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub provenance: BTreeMap<String, String>,
}

/// The robot a twin was made for.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// The robot's name in its URDF; empty where the twin is a topic.
    pub name: String,
    /// SHA-256 of the URDF file; empty where the twin is a topic.
    #[serde(default)]
    pub urdf_sha256: String,
}

/// The filters of the twin stage, see its configuration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Filters {
    /// Low-pass on the velocity before it is differentiated \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub velocity_cutoff_hz: f64,
    /// Low-pass on measured and expected effort of joints that have none of their own \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub effort_cutoff_hz: f64,
}

impl Default for Filters {
    fn default() -> Self {
        Self {
            velocity_cutoff_hz: 12.0,
            effort_cutoff_hz: 4.5,
        }
    }
}

/// Linear relation between one joint's measured effort and the model's:
/// `measured = gain * model + offset` (Tajiri and Iwamoto, equation 4).
///
/// The model's effort is in N m, or in A where the cell gives torque constants. If there are terms, the
/// gain applies to the effort of the bodies; the joint terms are added to it, and the recording terms follow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointCorrection {
    /// Gain \[effort unit per model unit\].
    pub gain: f64,
    /// Standard deviation of the gain, where the gain replaces a torque constant that is not given. As large as the
    /// gain where the motion does not identify it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_deviation: Option<f64>,
    /// Offset \[effort unit\].
    pub offset: f64,
    /// Standard deviation of the filtered residual on the contact-free recordings \[effort unit\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Share of the measured effort's variance that the corrected model explains, 0 to 1. Where it is
    /// small, the gain is not identifiable from these motions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explained: Option<f64>,
    /// Low-pass on this joint's measured and expected effort \[Hz\]. Default: that of the `filters`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub effort_cutoff_hz: Option<f64>,
}

/// Share of the effort's variance that a line must explain for its slope to be treated as the drive's gain.
/// Statistical: above it, the model explains more of the effort than everything else together.
const EXPLAINED: f64 = 0.5;
/// Ratio of a fitted gain to its standard deviation above which it is treated as the drive's gain.
/// Statistical: five standard deviations exclude 0 with odds of a million to one.
const KNOWN: f64 = 5.0;

impl JointCorrection {
    /// Returns whether the gain determines the measured effort per N m, in place of a torque constant.
    pub fn tells_torque(&self) -> bool {
        match (self.gain_deviation, self.explained) {
            (Some(deviation), _) => self.gain > KNOWN * deviation,
            (None, Some(explained)) => explained > EXPLAINED,
            (None, None) => false,
        }
    }
}

impl Default for JointCorrection {
    fn default() -> Self {
        Self {
            gain: 1.0,
            gain_deviation: None,
            offset: 0.0,
            noise: None,
            explained: None,
            effort_cutoff_hz: None,
        }
    }
}

/// A detector's score on contact-free data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScoreStatistics {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub standard_deviation: f64,
    /// Number of samples.
    pub samples: u64,
}

/// Mismatch between a `twin.yaml` and the robot.
#[derive(Debug, thiserror::Error)]
pub enum TwinFileError {
    /// A correction of a joint that the robot does not have.
    #[error(
        "the twin corrects joint `{joint}`, which the robot does not have; its joints: {known}"
    )]
    UnknownJoint {
        /// The joint in the file.
        joint: String,
        /// The robot's joints.
        known: String,
    },
    /// A file made for another effort unit.
    #[error("the twin predicts effort in {found}, but the cell's effort is in {expected}")]
    Unit {
        /// The file's unit.
        found: String,
        /// The cell's unit.
        expected: String,
    },
}

/// The corrections of a [`TwinFile`] in a robot's joint order.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// By joint in URDF order.
    pub joints: Vec<JointCorrection>,
    /// Physical effects that the rigid-body model lacks.
    pub terms: Vec<TermSpec>,
}

impl Correction {
    /// No correction: the rigid-body model as it is.
    pub fn none(joint_count: usize) -> Self {
        Self {
            joints: vec![JointCorrection::default(); joint_count],
            terms: Vec::new(),
        }
    }
}

impl TwinFile {
    /// Returns a message if the file was made for another robot than `robot` and both have a name.
    pub fn made_for_other(&self, robot: &str) -> Option<String> {
        let made_for = &self.robot.name;
        let other = !made_for.is_empty() && !robot.is_empty() && made_for != robot;
        other.then(|| format!("this twin was made for the robot `{made_for}`, not for `{robot}`"))
    }

    /// Returns the corrections in the order of `joint_names`.
    ///
    /// # Errors
    /// If the file names an unknown joint or was made for another effort unit.
    pub fn resolve(
        &self,
        joint_names: &[String],
        effort_unit: &str,
    ) -> Result<Correction, TwinFileError> {
        if self.effort_unit != effort_unit {
            return Err(TwinFileError::Unit {
                found: self.effort_unit.clone(),
                expected: effort_unit.to_owned(),
            });
        }
        let mut correction = Correction::none(joint_names.len());
        for (joint, values) in &self.joints {
            let Some(index) = joint_names.iter().position(|name| name == joint) else {
                return Err(TwinFileError::UnknownJoint {
                    joint: joint.clone(),
                    known: joint_names.join(", "),
                });
            };
            correction.joints[index] = *values;
        }
        correction.terms.clone_from(&self.terms);
        Ok(correction)
    }
}
