//! The table of detectors. Adding one is its file and one line here: the pipeline file's keys, their
//! schema, `tauscope evaluate` and the tests of what all detectors promise go through this table.

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

/// What the table says of a detector; see [`DetectorSettings`].
#[derive(Debug)]
pub struct Entry {
    /// Canonical name.
    pub name: &'static str,
    /// What it is, in a sentence.
    pub about: &'static str,
    /// Standard deviations from the mean score to its alarm where the file names no threshold.
    pub sigmas: f64,
    /// What its score is measured in.
    pub score_unit: ScoreUnit,
    /// What its training is.
    pub training: Training,
    /// Whether chance has a part in its training.
    pub random: bool,
    /// Which recordings it is made for.
    pub suits: Suits,
    /// Whether a calibration in this cell measures what its score does.
    pub is_calibrated: fn(&Setup) -> bool,
    /// What its score stays below whatever is seen, where there is such a bound.
    pub largest_score: fn(&Trained) -> Option<f64>,
    /// Its settings where a file says nothing.
    pub settings: fn() -> Box<dyn AnySettings>,
    /// Its settings as a file has them.
    pub(crate) read: Read,
    /// Their schema.
    pub(crate) schema: fn(&mut SchemaGenerator) -> Schema,
    /// The schema of what it learns while running, if it does.
    pub(crate) state_schema: fn(&mut SchemaGenerator) -> Option<Schema>,
}

/// Reads settings from a file of any format.
type Read = fn(
    &mut dyn erased_serde::Deserializer<'_>,
) -> Result<Box<dyn AnySettings>, erased_serde::Error>;

impl Entry {
    /// The entry of the detector with these settings.
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
            read: |file| Ok(Box::new(erased_serde::deserialize::<S>(file)?)),
            schema: |generator| generator.subschema_for::<Option<S>>(),
            state_schema: S::state_schema,
        }
    }

    /// The detector called `name`.
    pub fn find(name: &str) -> Option<&'static Self> {
        DETECTORS.iter().find(|entry| entry.name == name)
    }
}
