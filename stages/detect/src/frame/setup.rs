//! Facts about the cell and its twin that a detector needs.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_dynamics::Model;

use super::shared::Shared;
use super::trained::{ScoreStatistics, Trained};

/// Facts about the cell and its twin that a detector needs.
#[derive(Debug, Clone, Default)]
pub struct Setup {
    /// The cell's name, for warnings; empty where there is none.
    pub cell: String,
    /// Facts about the joints, in URDF order.
    pub joints: Vec<JointSetup>,
    /// Names of the joints, to which data learnt by joint belongs.
    pub joint_names: Vec<String>,
    /// The robot model, if there is one: for the touched link and the force.
    pub model: Option<Model>,
    /// Statistics of the scores on contact-free data, by detector.
    pub scores: BTreeMap<String, ScoreStatistics>,
    /// The link that holds the tool (an index into the model's links). Default: the model's tool link.
    pub tool_link: Option<usize>,
    /// The contact point on the tool, in that link's frame \[m\]. Default: the frame's origin.
    pub contact_point_on_tool_m: Option<[f64; 3]>,
    /// Impedance of the Cartesian controller that holds the tool, where known.
    pub impedance: Option<Impedance>,
    /// Trained detectors, by name.
    pub trained: BTreeMap<String, Arc<Trained>>,
    /// Values shared with other detectors of the same samples; `None` shares nothing.
    pub shared: Option<Shared>,
}

impl Setup {
    /// Returns the statistics of `detector`'s score on contact-free data: from the twin, else from its training.
    pub fn statistics(&self, detector: &str) -> Option<ScoreStatistics> {
        let trained = || self.trained.get(detector).map(|trained| trained.score());
        self.scores.get(detector).copied().or_else(trained)
    }
}

/// Stiffness of a Cartesian impedance controller that holds the tool (Salt Ducaju et al., equation 1).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Impedance {
    /// Translational stiffness \[N/m\].
    pub translational_n_per_m: f64,
    /// Rotational stiffness \[N m/rad\].
    pub rotational_nm_per_rad: f64,
}

/// Facts about a joint that a detector needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSetup {
    /// Gain that the twin applied \[effort unit per model unit\].
    pub gain: f64,
    /// Offset that the twin applied \[effort unit\].
    pub offset: f64,
    /// Standard deviation of the contact-free residual \[effort unit\], where known.
    pub noise: Option<f64>,
    /// Measured effort per torque at the joint \[effort unit per N m\]; NaN where unknown: the joint then gives no
    /// information about forces.
    pub effort_per_nm: f64,
}

impl JointSetup {
    /// Returns whether its effort can be converted to a torque.
    pub fn tells_torque(&self) -> bool {
        self.effort_per_nm.is_finite() && self.effort_per_nm != 0.0
    }
}
