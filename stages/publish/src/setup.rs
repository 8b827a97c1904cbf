//! Facts of a cell that its publisher needs.

use tauscope_bus::{SampleKind, ZenohEndpoints};
use tauscope_dynamics::Model;

use crate::fleet::Facts;

/// Facts of a cell that its publisher needs.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Name of the cell.
    pub cell: String,
    /// Joints of the cell, in URDF order.
    pub joint_names: Vec<String>,
    /// Model of the robot, if there is one: for forces at links.
    pub model: Option<Model>,
    /// Input streams of the publisher.
    pub streams: Vec<StreamInfo>,
    /// Endpoints at which the cell's source accepts commands, if it does.
    pub commands: Option<ZenohEndpoints>,
    /// Facts that are reported to the fleet.
    pub facts: Facts,
    /// Whether this stage was restarted, so that the earlier latch is unknown.
    pub restarted: bool,
}

/// An input stream of a publisher.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamInfo {
    /// The stage it comes from.
    pub stage: String,
    /// Kind of its samples.
    pub kind: SampleKind,
    /// The detector that sends it, if known.
    pub detector: Option<String>,
    /// Whether it reports contacts; a watch over the twin does not.
    pub judges_contact: bool,
}

impl StreamInfo {
    /// Returns its unique label among `all`: the detector's name, or the stage's name if several stages run the same
    /// detector.
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
