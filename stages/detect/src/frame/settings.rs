//! What a detector tells of itself: its name, its settings, how it is built and how it learns.

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

/// The settings of one detector, as its key of a pipeline file holds them, and everything that is known of
/// the detector before it runs. A detector's file implements this; the table of detectors names the type.
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
    /// What it is, in a sentence for the pipeline file's schema.
    const ABOUT: &'static str;
    /// Standard deviations from the mean score of contact-free data to its alarm where the file names no
    /// threshold: equation 7 of Tajiri and Iwamoto.
    const SIGMAS: f64 = 4.0;
    /// What its score is measured in.
    const SCORE_UNIT: ScoreUnit = ScoreUnit::None;
    /// What its training is.
    const TRAINING: Training = Training::None;
    /// Whether chance has a part in its training.
    const RANDOM: bool = false;
    /// Which recordings it is made for.
    const SUITS: Suits = Suits::All;

    /// The detector, for a cell. A detector that ends alarms by itself does so `hold_s` after the last
    /// sample that it sees a contact in \[s\].
    ///
    /// # Errors
    /// If the cell or the settings lack what it needs.
    fn build(&self, setup: &Setup, hold_s: f64) -> Result<Box<dyn Detector>, ConfigError>;

    /// These settings with what recordings teach, and the weights that go to a file of their own, if there
    /// are any.
    ///
    /// # Errors
    /// If the recordings hold too little or lack labels.
    fn learn(&self, _task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((self.clone(), None))
    }

    /// The curves behind what [`learn`](Self::learn) gave, where it was tuned by some.
    ///
    /// # Errors
    /// As [`learn`](Self::learn).
    fn sweeps(&self, _task: &Task<'_>) -> Result<Option<Sweeps>, LearnError> {
        Ok(None)
    }

    /// Whether a calibration measures what its score does on contact-free data, for which it must need no
    /// more than `setup` holds.
    fn is_calibrated(_setup: &Setup) -> bool {
        false
    }

    /// What speaks against running it with these settings in this cell, though it can.
    fn warning(&self, _setup: &Setup) -> Option<String> {
        None
    }

    /// What whoever let it learn should know of what it has learnt.
    fn note(&self) -> Option<String> {
        None
    }

    /// Samples that it judges at once, if it judges windows.
    fn window(&self) -> Option<usize> {
        None
    }

    /// What its score stays below whatever is seen, where there is such a bound.
    fn largest_score(_trained: &Trained) -> Option<f64> {
        None
    }

    /// Which of these settings an evaluation finds itself; they may not be given to it.
    fn found_by_evaluation(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// The setting that names the file of its trained weights, for one that is trained.
    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>> {
        None
    }

    /// Whether it begins to learn anew when it is told to.
    fn learns_when_told(&self) -> bool {
        false
    }

    /// The setting that names the file of what it learns while running, for one that does.
    fn state_file(&mut self) -> Option<&mut Option<PathBuf>> {
        None
    }

    /// The file that holds what it has learnt, if its settings name one in place of it.
    fn learnt_file(&self) -> Option<&Path> {
        None
    }

    /// What the file of its state holds.
    fn state_schema(_generator: &mut SchemaGenerator) -> Option<Schema> {
        None
    }

    /// Goes on from what an earlier life has learnt.
    ///
    /// # Errors
    /// If that is the state of another detector.
    fn resume(&mut self, _state: State) -> Result<(), serde_json::Error> {
        Ok(())
    }
}

/// What a detector's score is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScoreUnit {
    /// Nothing: it is a ratio, or what a net makes of scaled numbers.
    None,
    /// The square of the effort's unit.
    SquaredEffort,
    /// The square of a torque, whatever the effort is.
    SquaredTorque,
    /// Newton.
    Newton,
}

impl ScoreUnit {
    /// For a cell whose efforts are in this unit; empty where there is none.
    pub fn in_words(self, effort: EffortUnit) -> &'static str {
        match (self, effort) {
            (Self::None, _) => "",
            (Self::SquaredEffort, EffortUnit::Nm) | (Self::SquaredTorque, _) => "(N m)²",
            (Self::SquaredEffort, EffortUnit::A) => "A²",
            (Self::Newton, _) => "N",
        }
    }
}

/// What the training of a detector is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Training {
    /// It has none.
    None,
    /// The fit of the twin's gains and offsets.
    Twin,
    /// Its own.
    Own,
}

/// Which recordings a detector is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Suits {
    /// All.
    All,
    /// A cycle that repeats.
    Cycles,
    /// Contacts whose labels tell collisions from cooperations.
    Kinds,
    /// Neither of both: a robot on ever new paths.
    NewPaths,
}

/// [`DetectorSettings`] of some detector.
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
    /// A copy.
    fn boxed(&self) -> Box<dyn AnySettings>;
    /// Whether `other` is of the same detector and says the same.
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
