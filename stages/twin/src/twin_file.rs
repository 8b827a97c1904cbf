//! `twin.yaml`: the corrected twin, as `tauscope calibrate` and `tauscope explain` write it and a
//! pipeline's `twin` stage loads it.

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
    /// How the residual was filtered when it was made; noise and scores hold for these filters only.
    pub filters: Filters,
    /// Correction by joint name. A joint that is not named keeps gain 1 and offset 0.
    pub joints: BTreeMap<String, JointCorrection>,
    /// Physics that the rigid-body model leaves out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<TermSpec>,
    /// By detector, what its score did on contact-free data: its threshold is mean + k standard
    /// deviations of it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub scores: BTreeMap<String, ScoreStatistics>,
    /// What made this file: program version, recordings and their hashes.
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

/// How one joint's measured effort follows from the model's:
/// `measured = gain * model + offset` (Tajiri and Iwamoto, equation 4).
///
/// The model's effort is in N m, or in A where the cell gives torque constants. Where there are terms, the
/// gain applies to the effort of the bodies; the terms of joints come on top, then those of recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointCorrection {
    /// Gain \[effort unit per model unit\].
    pub gain: f64,
    /// Standard deviation of the gain, where it stands for a torque constant that nobody gave; as large as the gain where the motion
    /// does not tell.
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
    /// Low-pass on this joint's measured and expected effort \[Hz\]; that of the `filters` where none is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub effort_cutoff_hz: Option<f64>,
}

/// A line's slope is a drive's gain where the line explains more than this share of the effort's variance,
/// Statistical: from there on the model explains more of the effort than all else together.
const EXPLAINED: f64 = 0.5;
/// and a fitted gain is one where it is this many times its standard deviation.
/// Statistical: five standard deviations exclude 0 with odds of a million to one.
const KNOWN: f64 = 5.0;

impl JointCorrection {
    /// Whether the gain tells how much effort 1 N m is, where no torque constant does.
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
    /// How many samples.
    pub samples: u64,
}

/// What is wrong with a `twin.yaml` for the robot at hand.
#[derive(Debug, thiserror::Error)]
pub enum TwinFileError {
    /// It corrects a joint that the robot has not.
    #[error(
        "the twin corrects joint `{joint}`, which the robot does not have; its joints: {known}"
    )]
    UnknownJoint {
        /// The joint in the file.
        joint: String,
        /// The robot's joints.
        known: String,
    },
    /// It was made for another unit.
    #[error("the twin predicts effort in {found}, but the cell's effort is in {expected}")]
    Unit {
        /// The file's unit.
        found: String,
        /// The cell's unit.
        expected: String,
    },
}

/// A [`TwinFile`] put into a robot's joint order.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// By joint in URDF order.
    pub joints: Vec<JointCorrection>,
    /// The physics that the rigid-body model leaves out.
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
    /// Says so if it was made for another robot than `robot`, where both have a name.
    pub fn made_for_other(&self, robot: &str) -> Option<String> {
        let made_for = &self.robot.name;
        let other = !made_for.is_empty() && !robot.is_empty() && made_for != robot;
        other.then(|| format!("this twin was made for the robot `{made_for}`, not for `{robot}`"))
    }

    /// Puts the corrections into the order of `joint_names`.
    ///
    /// # Errors
    /// If the file names a joint that is not there or was made for another effort unit.
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
