//! `virtual_collision_sensor`: Indri, Trapani and Lazzero, "Development of a Virtual Collision Sensor
//! for Industrial Robots" (Sensors 17(5):1148, 2017), the adaptive version; the basic one is
//! [`virtual_collision_sensor_basic`](crate::indri::virtual_collision_sensor_basic).
//!
//! It needs only the measured effort and the expected effort of any model, and no URDF. Per joint, the residue |R|
//! (equation 1) is compared with the threshold `S_coll = α (m + Coll_bias) + ν` (equations 4 and 17). Here m is the
//! estimated model error (equations 7 to 11) and ν a margin for measurement noise (not in the paper). The bias is
//! learnt and adapts on request (equations 12 to 16). A machine of five states decides when a collision is possible;
//! in its safe state, Moving, nothing is tested. The score is the largest `|R_i| / S_coll_i` among the tested joints.
//!
//! An alarm is a `collision`, or a `model_error` if the expected effort was wrong by more than the smallest
//! collision effort for most of the last ten seconds, for example because of a wrongly declared payload (remark 1).
//!
//! Efforts are in the cell's unit (N m or A) throughout; the learnt values are by joint name.

mod bias;
mod blocks;
mod first_bias;
mod joint;
mod learnt;
mod lessons;
mod model_error;
mod noise;
mod phase;
mod sensor;
mod trend;
mod validity;

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};

use crate::frame::{
    ConfigError, Detector, DetectorSettings, HereOrFile, LearnError, Lessons, Setup, State, Suits,
    Task, Trained, Training,
};
pub use bias::LearningState;
pub use first_bias::FirstBias;
pub(crate) use joint::{BlockSettings, Tuning};
pub use learnt::{Learnt, LearntJoint};
pub use phase::Phase;
use sensor::Learning;

pub(crate) use sensor::Sensor;

/// Canonical name.
pub(crate) const NAME: &str = "virtual_collision_sensor";

/// Settings of `virtual_collision_sensor`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The initial bias (`Coll_bias0`), by joint name or as a list in URDF order: the smallest effort treated
    /// as a collision before learning \[effort unit\]. `tauscope evaluate` learns it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias: Option<FirstBias>,
    /// When learning starts. A message on the source's `learn` topic starts it at any time.
    pub learn: Learn,
    /// Duration of learning: at least one cycle of the robot's motion, better three \[s\].
    #[schemars(range(min = 0.1, max = 86_400.0))]
    pub learning_s: f64,
    /// Time constant with which the bias adapts to its newest estimate while running \[s\].
    #[schemars(range(min = 0.1, max = 86_400.0))]
    pub adaptation_s: f64,
    /// Factor on the threshold (equation 17).
    #[schemars(range(min = 1.0, max = 2.0))]
    pub alpha: f64,
    /// Weight of the average relative to the maximum in the unsteady model error (equation 9).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub delta: f64,
    /// Time between two updates of the steady model error, `T_s` \[s\].
    #[schemars(range(min = 0.001, max = 10.0))]
    pub model_error_period_s: f64,
    /// Low-pass on both efforts \[Hz\].
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub cutoff_hz: f64,
    /// The learnt state by joint, or the path of its file: `learnt.yaml` as `tauscope evaluate` writes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learnt: Option<HereOrFile<Learnt>>,
    /// State file that keeps the learnt state between runs. It need not exist yet, and takes precedence over
    /// `learnt`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<PathBuf>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            bias: None,
            learn: Learn::default(),
            learning_s: 30.0,
            adaptation_s: 60.0,
            alpha: 1.1,
            delta: 0.5,
            model_error_period_s: 0.2,
            cutoff_hz: 15.0,
            learnt: None,
            state: None,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Collisions from both efforts alone, with an adaptive bias (Indri, Trapani and Lazzero).";
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::Cycles;

    fn build(&self, setup: &Setup, hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let bias = first_bias(NAME, self.bias.as_ref(), setup)?;
        let learnt = self.learnt.as_ref().and_then(HereOrFile::here);
        if let Some(reason) = learnt.and_then(|learnt| learnt.fault(&setup.joint_names)) {
            return Err(ConfigError::LearntState {
                detector: NAME,
                reason,
            });
        }
        let learning = Learning {
            duration_s: self.learning_s,
            at_start: self.learn == Learn::AtStart,
        };
        let mut sensor = Sensor::new(NAME, self.tuning(), &bias, hold_s, setup.shared.as_ref());
        sensor.let_learn(learning, &setup.joint_names, learnt);
        Ok(Box::new(sensor))
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((learn(self, task.setup, &task.lessons)?, None))
    }

    fn found_by_evaluation(&self) -> Vec<&'static str> {
        let state = self.state.iter().map(|_| "state");
        state.chain(self.learnt.iter().map(|_| "learnt")).collect()
    }

    fn learns_when_told(&self) -> bool {
        true
    }

    fn state_file(&mut self) -> Option<&mut Option<PathBuf>> {
        Some(&mut self.state)
    }

    fn learnt_file(&self) -> Option<&Path> {
        self.learnt.as_ref()?.file()
    }

    fn state_schema(generator: &mut SchemaGenerator) -> Option<Schema> {
        Some(generator.subschema_for::<Learnt>())
    }

    fn resume(&mut self, state: State) -> Result<(), serde_json::Error> {
        self.learnt = Some(HereOrFile::Here(serde_json::from_value(state)?));
        Ok(())
    }
}

/// When the sensor starts to learn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Learn {
    /// At the first sample, unless there is a learnt state.
    AtStart,
    /// On a message.
    #[default]
    OnRequest,
}

impl Settings {
    fn tuning(&self) -> Tuning {
        Tuning {
            block: BlockSettings {
                cutoff_hz: self.cutoff_hz,
                period_s: self.model_error_period_s,
                delta: self.delta,
            },
            alpha: self.alpha,
            time_constant_s: self.adaptation_s,
        }
    }
}

/// Returns the initial bias by joint in URDF order, validated.
pub(crate) fn first_bias(
    detector: &'static str,
    bias: Option<&FirstBias>,
    setup: &Setup,
) -> Result<Vec<f64>, ConfigError> {
    let bias = bias.ok_or(ConfigError::NoBias { detector })?;
    bias.resolve(detector, &setup.joint_names)
}

/// Learns the initial bias by joint from the training recordings of `lessons`: twice the bias that would have
/// avoided every virtual collision, and at least the mean residue.
pub(crate) fn learn_first_bias(
    detector: &'static str,
    tuning: Tuning,
    setup: &Setup,
    lessons: &Lessons,
) -> Result<FirstBias, LearnError> {
    let needed = lessons::needed(detector, tuning, setup.joints.len(), lessons.train)?;
    let values = needed.iter().map(lessons::Needed::first_bias);
    Ok(FirstBias::named(&setup.joint_names, values))
}

/// Learns the initial bias, unless `settings` has one, and runs the paper's learning phase (equations 12,
/// 13 and 15) over the training recordings. The bias adapts from the result.
///
/// # Errors
/// If the recordings contain less than five seconds of contact-free motion, or `settings.bias` does not fit
/// the joints.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons,
) -> Result<Settings, LearnError> {
    let joint_count = setup.joints.len();
    let needed = lessons::needed(NAME, settings.tuning(), joint_count, lessons.train)?;
    let mut learnt = settings.clone();
    if settings.bias.is_some() {
        first_bias(NAME, settings.bias.as_ref(), setup)?;
    } else {
        let values = needed.iter().map(lessons::Needed::first_bias);
        learnt.bias = Some(FirstBias::named(&setup.joint_names, values));
    }
    let joints = needed.iter().map(|needed| LearntJoint {
        ident: needed.ident,
        start: needed.ident,
        adapt_s: Some(0.0),
    });
    let joints = setup.joint_names.iter().cloned().zip(joints);
    learnt.learnt = Some(HereOrFile::Here(Learnt {
        joints: joints.collect(),
    }));
    Ok(learnt)
}
