//! Samples of the bus, which may come from anybody who reaches it: through twin, detectors and whoever sums up
//! contacts.

use std::fs;
use std::path::Path;

use tauscope_bus::{
    ContactFollower, Detection, Emit, JointState, LinkError, Sample, Stage, TwinState,
};
use tauscope_detect::{Config, Detect, ScoreStatistics, Setup};
use tauscope_dynamics::Model;
use tauscope_twin::{Correction, Twin};

use crate::files::DATA;

/// More samples make an input slow, not wild.
const MOST_SAMPLES: usize = 64;
/// Detectors that need no training.
const DETECTORS: [&str; 3] = ["naive_difference", "momentum_observer", "twin_regression"];

struct Kept<T>(Vec<T>);

impl<T: Sample> Emit<T> for Kept<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut sample = T::default();
        write(&mut sample);
        self.0.push(sample);
        Ok(())
    }
}

/// The bytes as samples of one type, the last one filled up with zeros.
fn read<T: Sample>(bytes: &[u8]) -> impl Iterator<Item = T> {
    bytes.chunks(size_of::<T>()).take(MOST_SAMPLES).map(|part| {
        let mut sample = T::default();
        bytemuck::bytes_of_mut(&mut sample)[..part.len()].copy_from_slice(part);
        sample
    })
}

/// Gives the samples to the stage as the receiving end of a link does: unsound ones are refused. What the stage refuses
/// ends it, as in a run.
fn through<I: Sample, O: Sample>(
    stage: &mut dyn Stage<I, O>,
    samples: impl Iterator<Item = I>,
) -> Vec<O> {
    let mut out = Kept(Vec::new());
    for sample in samples.filter(|sample| sample.check().is_ok()) {
        if stage.accept(&sample, &mut out).is_err() {
            break;
        }
    }
    out.0
}

thread_local! {
    static ROBOT: Model = {
        let urdf = fs::read_to_string(Path::new(DATA).join("demo_arm.urdf")).expect("bundled data");
        Model::from_urdf(&urdf).expect("the bundled robot")
    };
}

fn joint_names(model: &Model) -> Vec<String> {
    model.joint_names().map(str::to_owned).collect()
}

fn twin(model: &Model) -> Twin {
    let joint_names = joint_names(model);
    let correction = Correction::none(joint_names.len());
    let setup = tauscope_twin::Setup {
        model: Some(model.clone()),
        joint_names,
        torque_constants_nm_per_a: None,
        tool_link: None,
    };
    Twin::new(&tauscope_twin::Config::default(), setup, correction).expect("a twin")
}

fn detector(name: &str, model: &Model) -> Detect {
    let joint_names = joint_names(model);
    let joint = tauscope_detect::JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    };
    let score = ScoreStatistics {
        mean: 1.0,
        standard_deviation: 0.5,
    };
    let setup = Setup {
        joints: vec![joint; joint_names.len()],
        joint_names,
        model: Some(model.clone()),
        scores: DETECTORS.map(|name| (name.to_owned(), score)).into(),
        ..Setup::default()
    };
    let config = serde_json::from_value::<Config>(serde_json::json!({ name: {} }));
    let stage = config.expect("a configuration").stage(setup);
    stage.expect("a detector that needs no training")
}

/// The first byte says what the others are samples of.
pub fn samples(bytes: &[u8]) {
    let Some((&kind, bytes)) = bytes.split_first() else {
        return;
    };
    let detections: Vec<Detection> = if kind % 3 == 2 {
        let detections = read::<Detection>(bytes);
        detections.filter(|it| it.check().is_ok()).collect()
    } else {
        ROBOT.with(|model| {
            let twin_states: Vec<TwinState> = if kind % 3 == 1 {
                read(bytes).collect()
            } else {
                through(&mut twin(model), read::<JointState>(bytes))
            };
            let through = |name| through(&mut detector(name, model), twin_states.iter().copied());
            DETECTORS.into_iter().flat_map(through).collect()
        })
    };
    let mut follower = ContactFollower::default();
    for detection in &detections {
        let _ = follower.push(detection).map(|contact| contact.duration_s());
        let texts = [detection.detector, detection.state, detection.link];
        let _ = texts.map(|text| text.as_str().len());
    }
}
