//! What a publisher must know of its cell.

use tauscope_bus::{SampleKind, ZenohEndpoints};
use tauscope_dynamics::Model;

use crate::fleet::Facts;

/// What a publisher must know of its cell.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The cell's name.
    pub cell: String,
    /// Its joints, in URDF order.
    pub joint_names: Vec<String>,
    /// Its robot, where there is one: for forces at links.
    pub model: Option<Model>,
    /// The streams that it listens to.
    pub streams: Vec<StreamInfo>,
    /// Where the cell's source takes commands, if it does.
    pub commands: Option<ZenohEndpoints>,
    /// What its fleet is told of it.
    pub facts: Facts,
    /// Whether this stage has been started again: what was latched is not known then.
    pub restarted: bool,
}

/// A stream that a publisher listens to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamInfo {
    /// The stage it comes from.
    pub stage: String,
    /// What it carries.
    pub kind: SampleKind,
    /// The detector that speaks in it, where that is known.
    pub detector: Option<String>,
    /// Whether it says whether something touches the robot; a watch over the twin does not.
    pub judges_contact: bool,
}

impl StreamInfo {
    /// What tells it from the others of `all`: the detector's name, or the stage's where two run the same.
    pub(crate) fn label(&self, all: &[Self]) -> String {
        let same = |detector: &String| {
            let all = all
                .iter()
                .filter(|other| other.detector.as_ref() == Some(detector));
            all.count() == 1
        };
        let name = self.detector.as_ref().filter(|detector| same(detector));
        name.unwrap_or(&self.stage).clone()
    }
}
