//! The table of detectors. A new detector needs its file and one line here: the pipeline file's keys, their
//! schema, `tauscope evaluate` and the conformance tests of all detectors use this table.

use schemars::{Schema, SchemaGenerator};

use crate::frame::{AnySettings, DetectorSettings, ScoreUnit, Setup, Suits, Trained, Training};
use crate::{indri, salt_ducaju, tajiri, tauscope};

/// All detectors, in the order of an evaluation's tables.
pub static DETECTORS: &[Entry] = &[
    Entry::of::<tajiri::naive_difference::Settings>(),
    Entry::of::<tajiri::momentum_observer::Settings>(),
    Entry::of::<tajiri::twin_regression::Settings>(),
    Entry::of::<tajiri::point_ocsvm::Settings>(),
    Entry::of::<tajiri::point_autoencoder::Settings>(),
    Entry::of::<tajiri::lstm_momentum_observer::Settings>(),
    Entry::of::<tajiri::window_ocsvm::Settings>(),
    Entry::of::<tajiri::window_autoencoder::Settings>(),
    Entry::of::<indri::virtual_collision_sensor_basic::Settings>(),
    Entry::of::<salt_ducaju::contact_classifier::Settings>(),
    Entry::of::<indri::virtual_collision_sensor::Settings>(),
    Entry::of::<salt_ducaju::fisher_discriminant::Settings>(),
    Entry::of::<salt_ducaju::frequency_classifier::Settings>(),
    Entry::of::<tauscope::Settings>(),
];

/// Entry of the table of detectors; see [`DetectorSettings`].
#[derive(Debug)]
pub struct Entry {
    /// Canonical name.
    pub name: &'static str,
    /// Description in one sentence.
    pub about: &'static str,
    /// Default threshold, in standard deviations above the mean score.
    pub sigmas: f64,
    /// Unit of its score.
    pub score_unit: ScoreUnit,
    /// Kind of its training.
    pub training: Training,
    /// Whether its training is random.
    pub random: bool,
    /// Recordings for which it is intended.
    pub suits: Suits,
    /// Whether a calibration in this cell measures the statistics of its score.
    pub is_calibrated: fn(&Setup) -> bool,
    /// Upper bound of its score on any input, if there is one.
    pub largest_score: fn(&Trained) -> Option<f64>,
    /// Its default settings.
    pub settings: fn() -> Box<dyn AnySettings>,
    /// Reads its settings from a file.
    pub(crate) read: Read,
    /// Schema of its settings.
    pub(crate) schema: fn(&mut SchemaGenerator) -> Schema,
    /// Schema of the state that it learns while running, if it learns.
    pub(crate) state_schema: fn(&mut SchemaGenerator) -> Option<Schema>,
}

/// Reads settings from a file of any format; `None` for a null.
type Read = fn(
    &mut dyn erased_serde::Deserializer<'_>,
) -> Result<Option<Box<dyn AnySettings>>, erased_serde::Error>;

impl Entry {
    /// Returns the entry of the detector with settings of type `S`.
    const fn of<S: DetectorSettings>() -> Self {
        Self {
            name: S::NAME,
            about: S::ABOUT,
            sigmas: S::SIGMAS,
            score_unit: S::SCORE_UNIT,
            training: S::TRAINING,
            random: S::RANDOM,
            suits: S::SUITS,
            is_calibrated: S::is_calibrated,
            largest_score: S::largest_score,
            settings: || Box::new(S::default()),
            read: |file| {
                let settings = erased_serde::deserialize::<Option<S>>(file)?;
                Ok(settings.map(|settings| Box::new(settings) as Box<dyn AnySettings>))
            },
            schema: |generator| generator.subschema_for::<Option<S>>(),
            state_schema: S::state_schema,
        }
    }

    /// Finds the detector called `name`.
    pub fn find(name: &str) -> Option<&'static Self> {
        DETECTORS.iter().find(|entry| entry.name == name)
    }
}
