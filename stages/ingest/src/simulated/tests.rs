mod conceal;
mod files;
mod impedance;
mod layers;
mod obstacles;
mod papers;
mod physics;
mod points;
mod sensing;

use std::path::Path;

use tauscope_dynamics::Model;

use super::*;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data");
/// Joints of the demo arm.
const N: usize = 7;

pub(super) fn arm() -> Model {
    let urdf = std::fs::read_to_string(Path::new(DATA).join("demo_arm.urdf")).unwrap();
    Model::from_urdf(&urdf).unwrap()
}

fn scenario(yaml: &str) -> Scenario {
    serde_saphyr::from_str(yaml).unwrap()
}

/// An ideal arm measured at 1 kHz, and what the text adds.
fn ideal(recording: &str, more: &str) -> Scenario {
    scenario(&format!(
        "{{version: 1, robot: demo_arm.urdf, seed: 3, rate_hz: 1000, {more} \
          recordings: [{{name: a, {recording}}}]}}"
    ))
}

fn friction() -> String {
    let joints = (1..=N).map(|j| {
        format!(
            "{{effect: coulomb_friction, joint: joint{j}, parameters: {{coulomb_nm: {}}}}}, \
             {{effect: viscous_friction, joint: joint{j}, parameters: {{viscous_nms_per_rad: {}}}}}",
            COULOMB_NM[j - 1],
            VISCOUS[j - 1]
        )
    });
    format!("physics: [{}],", joints.collect::<Vec<_>>().join(", "))
}

const COULOMB_NM: [f64; N] = [4.0, 3.5, 2.0, 2.0, 1.0, 0.8, 0.5];
const VISCOUS: [f64; N] = [5.0, 5.0, 3.0, 2.0, 1.0, 1.0, 0.3];

fn readings(scenario: &Scenario) -> Vec<Reading> {
    let mut simulation = Simulation::new(scenario, &arm(), 0).unwrap();
    std::iter::from_fn(|| simulation.next_reading().unwrap()).collect()
}
