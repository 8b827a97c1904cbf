//! Common parts of the detectors' tests.

#![allow(dead_code, reason = "each test file uses its own part")]

pub mod counting;

use tauscope_bus::{Detection, Emit, LinkError};
use tauscope_detect::{JointSetup, Setup};

/// Keeps all detections of a stage.
#[derive(Default)]
pub struct Out(pub Vec<Detection>);

impl Emit<Detection> for Out {
    fn emit(&mut self, write: &mut dyn FnMut(&mut Detection)) -> Result<(), LinkError> {
        let mut detection = Detection::default();
        write(&mut detection);
        self.0.push(detection);
        Ok(())
    }
}

/// Returns a minimal cell with this number of joints and efforts in N m.
pub fn setup(joints: usize) -> Setup {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    };
    Setup {
        joints: vec![joint; joints],
        joint_names: (1..=joints).map(|j| format!("joint{j}")).collect(),
        ..Setup::default()
    }
}
