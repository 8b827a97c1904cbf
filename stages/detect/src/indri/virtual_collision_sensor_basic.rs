//! `virtual_collision_sensor_basic`: the virtual collision sensor of Indri, Trapani and Lazzero with a
//! constant bias, as in their earlier work (reference 15 there): equations 1 to 11, without learning,
//! adaptation and the factor α. See
//! [`virtual_collision_sensor`](crate::indri::virtual_collision_sensor), which shares all its parts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{
    ConfigError, Detector, DetectorSettings, LearnError, Lessons, Setup, Suits, Task, Trained,
    Training,
};
use crate::indri::virtual_collision_sensor::{
    BlockSettings, FirstBias, Sensor, Tuning, first_bias, learn_first_bias,
};

/// Canonical name.
pub(crate) const NAME: &str = "virtual_collision_sensor_basic";

/// Settings of `virtual_collision_sensor_basic`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The bias, by joint name or as a list in URDF order: the smallest effort treated as a collision
    /// \[effort unit\]. `tauscope evaluate` learns it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias: Option<FirstBias>,
    /// Weight of the average relative to the maximum in the unsteady model error (equation 9).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub delta: f64,
    /// Time between two updates of the steady model error, `T_s` \[s\].
    #[schemars(range(min = 0.001, max = 10.0))]
    pub model_error_period_s: f64,
    /// Low-pass on both efforts \[Hz\].
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub cutoff_hz: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            bias: None,
            delta: 0.5,
            model_error_period_s: 0.2,
            cutoff_hz: 15.0,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Collisions from both efforts alone, with a constant bias (Indri, Trapani and Lazzero).";
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::Cycles;

    fn build(&self, setup: &Setup, hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let bias = first_bias(NAME, self.bias.as_ref(), setup)?;
        let shared = setup.shared.as_ref();
        let sensor = Sensor::new(NAME, self.tuning(), &bias, hold_s, shared);
        Ok(Box::new(sensor))
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((learn(self, task.setup, &task.lessons)?, None))
    }
}

impl Settings {
    fn tuning(&self) -> Tuning {
        Tuning {
            block: BlockSettings {
                cutoff_hz: self.cutoff_hz,
                period_s: self.model_error_period_s,
                delta: self.delta,
            },
            alpha: 1.0,
            // Unused: the bias does not adapt.
            time_constant_s: 1.0,
        }
    }
}

/// Learns the bias from the training recordings of `lessons`: per joint, twice the smallest bias that
/// avoids every collision alarm, and at least the mean residue. A bias in `settings` is kept.
///
/// # Errors
/// If the recordings contain less than five seconds of contact-free motion, or `settings.bias` does not fit
/// the joints.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons,
) -> Result<Settings, LearnError> {
    let mut learnt = settings.clone();
    match &settings.bias {
        Some(bias) => {
            first_bias(NAME, Some(bias), setup)?;
        }
        None => {
            learnt.bias = Some(learn_first_bias(NAME, settings.tuning(), setup, lessons)?);
        }
    }
    Ok(learnt)
}
