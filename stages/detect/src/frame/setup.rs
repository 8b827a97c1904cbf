//! What a detector must know of its cell and its twin.

use std::collections::BTreeMap;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_dynamics::Model;

use super::shared::Shared;
use super::trained::{ScoreStatistics, Trained};

/// What a detector must know of its cell and its twin.
#[derive(Debug, Clone, Default)]
pub struct Setup {
    /// The cell's name, for warnings; empty where there is none.
    pub cell: String,
    /// By joint in URDF order.
    pub joints: Vec<JointSetup>,
    /// Their names: what was learnt by joint belongs to them.
    pub joint_names: Vec<String>,
    /// The robot, where there is one: for the touched link and the force.
    pub model: Option<Model>,
    /// By detector, what its score did on contact-free data.
    pub scores: BTreeMap<String, ScoreStatistics>,
    /// The link that holds the tool, an index into the model's links; else the model says which.
    pub tool_link: Option<usize>,
    /// The point of the tool that touches things, in that link's frame \[m\]; else its origin.
    pub contact_point_on_tool_m: Option<[f64; 3]>,
    /// The impedance that a Cartesian controller holds the tool with, where it is known.
    pub impedance: Option<Impedance>,
    /// By detector, those that were trained.
    pub trained: BTreeMap<String, Arc<Trained>>,
    /// What it shares with other detectors that are given the same samples; `None` shares nothing.
    pub shared: Option<Shared>,
}

impl Setup {
    /// What the score of `detector` does on contact-free data, as the twin says or else its training.
    pub fn statistics(&self, detector: &str) -> Option<ScoreStatistics> {
        let trained = || self.trained.get(detector).map(|trained| trained.score());
        self.scores.get(detector).copied().or_else(trained)
    }
}

/// What a Cartesian impedance controller holds the tool with (Salt Ducaju et al., equation 1).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Impedance {
    /// Translational stiffness \[N/m\].
    pub translational_n_per_m: f64,
    /// Rotational stiffness \[N m/rad\].
    pub rotational_nm_per_rad: f64,
}

/// What a detector must know of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSetup {
    /// Gain that the twin applied \[effort unit per model unit\].
    pub gain: f64,
    /// Offset that the twin applied \[effort unit\].
    pub offset: f64,
    /// Standard deviation of the contact-free residual \[effort unit\], where known.
    pub noise: Option<f64>,
    /// How much the measured effort changes by 1 N m at the joint \[effort unit per N m\]; NaN where
    /// that is not known, and the joint tells nothing of a force.
    pub effort_per_nm: f64,
}

impl JointSetup {
    /// Whether its effort tells a torque.
    pub fn tells_torque(&self) -> bool {
        self.effort_per_nm.is_finite() && self.effort_per_nm != 0.0
    }
}
