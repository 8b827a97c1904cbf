//! Static properties of a detector: name, settings, construction and training.

use std::any::Any;
use std::fmt::Debug;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tauscope_bus::EffortUnit;

use super::detector::{Detector, State};
use super::error::ConfigError;
use super::lesson::{LearnError, Task};
use super::setup::Setup;
use super::sweep::Sweeps;
use super::trained::Trained;

/// The settings of one detector under its key of a pipeline file, and the detector's properties that are known
/// before it runs. A detector's file implements this; the table of detectors names the type.
pub trait DetectorSettings:
    Clone
    + Debug
    + Default
    + PartialEq
    + Serialize
    + DeserializeOwned
    + JsonSchema
    + Send
    + Sync
    + 'static
{
    /// Canonical name: its key in a pipeline file, and its name in the archive.
    const NAME: &'static str;
    /// Description in one sentence, for the pipeline file's schema.
    const ABOUT: &'static str;
    /// Default threshold, in standard deviations above the mean score on contact-free data: equation 7 of Tajiri and
    /// Iwamoto.
    const SIGMAS: f64 = 4.0;
    /// Unit of its score.
    const SCORE_UNIT: ScoreUnit = ScoreUnit::None;
    /// Kind of its training.
    const TRAINING: Training = Training::None;
    /// Whether its training is random.
    const RANDOM: bool = false;
    /// Recordings for which it is intended.
    const SUITS: Suits = Suits::All;

    /// Builds the detector for a cell. A detector that ends alarms by its own rules does so `hold_s` \[s\] after the
    /// last sample in which it sees a contact.
    ///
    /// # Errors
    /// If the cell or the settings lack what it needs.
    fn build(&self, setup: &Setup, hold_s: f64) -> Result<Box<dyn Detector>, ConfigError>;

    /// Learns from recordings. Returns the settings with their learnt values, and the trained weights for a separate
    /// file, if there are any.
    ///
    /// # Errors
    /// If the recordings contain too little data or lack labels.
    fn learn(&self, _task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((self.clone(), None))
    }

    /// Returns the trade-off curves behind the tuning in [`learn`](Self::learn), if there are any.
    ///
    /// # Errors
    /// As [`learn`](Self::learn).
    fn sweeps(&self, _task: &Task<'_>) -> Result<Option<Sweeps>, LearnError> {
        Ok(None)
    }

    /// Returns whether a calibration measures its score on contact-free data; the detector must then need nothing
    /// beyond `setup`.
    fn is_calibrated(_setup: &Setup) -> bool {
        false
    }

    /// Returns a warning about running it with these settings in this cell, if there is one.
    fn warning(&self, _setup: &Setup) -> Option<String> {
        None
    }

    /// Returns a note about the learnt state for the user who ran the training, if there is one.
    fn note(&self) -> Option<String> {
        None
    }

    /// Returns the window length \[samples\], if it judges windows.
    fn window(&self) -> Option<usize> {
        None
    }

    /// Returns an upper bound of its score on any input, if there is one.
    fn largest_score(_trained: &Trained) -> Option<f64> {
        None
    }

    /// Returns the settings that an evaluation determines itself; they may not be given to it.
    fn found_by_evaluation(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// Returns the setting with the path of the trained weights, if the detector is trained.
    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>> {
        None
    }

    /// Returns whether it can learn anew on request.
    fn learns_when_told(&self) -> bool {
        false
    }

    /// Returns the setting with the path of the state file, if the detector learns while running.
    fn state_file(&mut self) -> Option<&mut Option<PathBuf>> {
        None
    }

    /// Returns the file of the learnt state, if the settings name a file instead of the state itself.
    fn learnt_file(&self) -> Option<&Path> {
        None
    }

    /// Returns the schema of the state file.
    fn state_schema(_generator: &mut SchemaGenerator) -> Option<Schema> {
        None
    }

    /// Restores the state learnt in an earlier run.
    ///
    /// # Errors
    /// If the state belongs to another detector.
    fn resume(&mut self, _state: State) -> Result<(), serde_json::Error> {
        Ok(())
    }
}

/// Unit of a detector's score.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScoreUnit {
    /// Dimensionless: a ratio, or the output of a network for scaled inputs.
    None,
    /// The square of the effort's unit.
    SquaredEffort,
    /// The square of a torque, for any effort unit.
    SquaredTorque,
    /// Newton.
    Newton,
}

impl ScoreUnit {
    /// Returns the unit's symbol for a cell with this effort unit; empty if dimensionless.
    pub fn in_words(self, effort: EffortUnit) -> &'static str {
        match (self, effort) {
            (Self::None, _) => "",
            (Self::SquaredEffort, EffortUnit::Nm) | (Self::SquaredTorque, _) => "(N m)²",
            (Self::SquaredEffort, EffortUnit::A) => "A²",
            (Self::Newton, _) => "N",
        }
    }
}

/// Kind of a detector's training.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Training {
    /// No training.
    None,
    /// The fit of the twin's gains and offsets.
    Twin,
    /// A training of its own.
    Own,
}

/// Recordings for which a detector is intended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Suits {
    /// All recordings.
    All,
    /// A cycle that repeats.
    Cycles,
    /// Contacts with labels that distinguish collisions from cooperations.
    Kinds,
    /// Paths that do not repeat, without labelled kinds.
    NewPaths,
}

/// [`DetectorSettings`] of any detector.
pub trait AnySettings: Any + Debug + Send + Sync + erased_serde::Serialize {
    /// [`DetectorSettings::NAME`].
    fn name(&self) -> &'static str;
    /// [`DetectorSettings::build`].
    ///
    /// # Errors
    /// As there.
    fn build(&self, setup: &Setup, hold_s: f64) -> Result<Box<dyn Detector>, ConfigError>;
    /// [`DetectorSettings::learn`].
    ///
    /// # Errors
    /// As there.
    fn learn(&self, task: &Task<'_>)
    -> Result<(Box<dyn AnySettings>, Option<Trained>), LearnError>;
    /// [`DetectorSettings::sweeps`].
    ///
    /// # Errors
    /// As there.
    fn sweeps(&self, task: &Task<'_>) -> Result<Option<Sweeps>, LearnError>;
    /// [`DetectorSettings::warning`].
    fn warning(&self, setup: &Setup) -> Option<String>;
    /// [`DetectorSettings::note`].
    fn note(&self) -> Option<String>;
    /// [`DetectorSettings::window`].
    fn window(&self) -> Option<usize>;
    /// [`DetectorSettings::found_by_evaluation`].
    fn found_by_evaluation(&self) -> Vec<&'static str>;
    /// [`DetectorSettings::trained_file`].
    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>>;
    /// [`DetectorSettings::learns_when_told`].
    fn learns_when_told(&self) -> bool;
    /// [`DetectorSettings::state_file`].
    fn state_file(&mut self) -> Option<&mut Option<PathBuf>>;
    /// [`DetectorSettings::learnt_file`].
    fn learnt_file(&self) -> Option<&Path>;
    /// [`DetectorSettings::resume`].
    ///
    /// # Errors
    /// As there.
    fn resume(&mut self, state: State) -> Result<(), serde_json::Error>;
    /// Returns a copy.
    fn boxed(&self) -> Box<dyn AnySettings>;
    /// Returns whether `other` belongs to the same detector and has equal settings.
    fn equals(&self, other: &dyn AnySettings) -> bool;
}

impl<S: DetectorSettings> AnySettings for S {
    fn name(&self) -> &'static str {
        S::NAME
    }

    fn build(&self, setup: &Setup, hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        DetectorSettings::build(self, setup, hold_s)
    }

    fn learn(
        &self,
        task: &Task<'_>,
    ) -> Result<(Box<dyn AnySettings>, Option<Trained>), LearnError> {
        let (settings, trained) = DetectorSettings::learn(self, task)?;
        Ok((Box::new(settings), trained))
    }

    fn sweeps(&self, task: &Task<'_>) -> Result<Option<Sweeps>, LearnError> {
        DetectorSettings::sweeps(self, task)
    }

    fn warning(&self, setup: &Setup) -> Option<String> {
        DetectorSettings::warning(self, setup)
    }

    fn note(&self) -> Option<String> {
        DetectorSettings::note(self)
    }

    fn window(&self) -> Option<usize> {
        DetectorSettings::window(self)
    }

    fn found_by_evaluation(&self) -> Vec<&'static str> {
        DetectorSettings::found_by_evaluation(self)
    }

    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>> {
        DetectorSettings::trained_file(self)
    }

    fn state_file(&mut self) -> Option<&mut Option<PathBuf>> {
        DetectorSettings::state_file(self)
    }

    fn learns_when_told(&self) -> bool {
        DetectorSettings::learns_when_told(self)
    }

    fn learnt_file(&self) -> Option<&Path> {
        DetectorSettings::learnt_file(self)
    }

    fn resume(&mut self, state: State) -> Result<(), serde_json::Error> {
        DetectorSettings::resume(self, state)
    }

    fn boxed(&self) -> Box<dyn AnySettings> {
        Box::new(self.clone())
    }

    fn equals(&self, other: &dyn AnySettings) -> bool {
        (other as &dyn Any).downcast_ref::<S>() == Some(self)
    }
}

erased_serde::serialize_trait_object!(AnySettings);

impl Clone for Box<dyn AnySettings> {
    fn clone(&self) -> Self {
        (**self).boxed()
    }
}

impl PartialEq for Box<dyn AnySettings> {
    fn eq(&self, other: &Self) -> bool {
        self.equals(&**other)
    }
}
