//! The input of an explanation: robot, recordings and the twin to start from.

use std::collections::BTreeSet;

use tauscope_dynamics::Model;

use crate::read::recording::Recording;
use crate::read::start::Start;

/// Search for effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// By evidence, one addition or exchange at a time.
    #[default]
    Stepwise,
    /// By the marginal likelihood of whole explanations, with the usual errors of bodies, laws and stamps in the model. It is to
    /// replace the other one.
    Inference,
}

/// The input of an explanation.
#[derive(Debug)]
pub struct Input {
    /// Name of the case.
    pub case: String,
    /// The robot; massless joints where the twin is a topic.
    pub model: Model,
    /// Whether the robot's bodies are known. They are not if the twin is a topic.
    pub bodies: bool,
    /// Unit of the recordings' effort: `Nm` or `A`.
    pub effort_unit: String,
    /// Torque constants by joint, if the unit is `A` and they are known \[N m/A\].
    pub torque_constants_nm_per_a: Option<Vec<f64>>,
    /// Recordings that may be fitted.
    pub fit: Vec<Recording>,
    /// Held-out recordings: nothing is fitted on them.
    pub holdout: Vec<Recording>,
    /// A corrected twin to start from, if there is one.
    pub start: Option<Start>,
    /// Effects that are left out of the library.
    pub without: BTreeSet<String>,
    /// Search for effects.
    pub method: Method,
}
