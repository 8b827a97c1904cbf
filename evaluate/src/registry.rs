//! Choice of the detectors that suit a set, and training of their settings.
//! [`DETECTORS`](tauscope_detect::DETECTORS) lists all detectors.

use std::path::PathBuf;

use tauscope_archive::whole_file;
use tauscope_detect::{Config, Entry, LearnError, Lessons, Setup, Suits, Sweeps};
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::trained;

use crate::recording::{Named, Role};

/// Number of seeds with which a detector with random training is trained.
/// Statistical: the mean over five seeds has a standard error of 0.45 standard deviations.
pub const SEEDS: u64 = 5;

/// Input of a detector's training.
#[derive(Debug)]
pub struct Task<'a> {
    /// The cell and its twin.
    pub setup: &'a Setup,
    /// Train and validation recordings behind the twin.
    pub lessons: Lessons<'a>,
    /// Contact-free time at the beginning of each recording \[s\].
    pub free_first_s: f64,
    /// Seed of the random number generator.
    pub seed: u64,
    /// Wall time of the twin's fit, if it was fitted \[s\].
    pub twin_fit_s: Option<f64>,
    /// Detector settings given by the set.
    pub given: &'a Config,
    /// Path of the trained weights, without the extension.
    pub weights: PathBuf,
}

impl Task<'_> {
    /// Trains or tunes a detector and returns its part of a pipeline file.
    ///
    /// # Errors
    /// If it cannot learn from these recordings, or its weights cannot be written.
    pub fn learn(&self, entry: &Entry) -> Result<Config, LearnError> {
        let usual = (entry.settings)();
        let given = self.given.given(entry).unwrap_or(&*usual);
        let (mut settings, trained) = given.learn(&self.of_detector())?;
        if let (Some(trained), Some(file)) = (trained, settings.trained_file()) {
            let path = trained::write(&self.weights, &self.lessons, trained)?;
            // An interrupted evaluation must leave no files.
            whole_file::is_part_of_unfinished(&path);
            *file = Some(path);
        }
        let shared = Config {
            threshold: self.given.threshold,
            hold_s: self.given.hold_s,
            ..Config::default()
        };
        Ok(shared.with_any(settings))
    }

    /// Returns the trade-off curves by which a detector was tuned, if any.
    ///
    /// # Errors
    /// If the detector cannot learn from these recordings.
    pub fn sweeps(&self, learnt: &Config) -> Result<Option<Sweeps>, LearnError> {
        let mut all = learnt.all();
        let sweeps = all
            .next()
            .map(|settings| settings.sweeps(&self.of_detector()));
        Ok(sweeps.transpose()?.flatten())
    }

    fn of_detector(&self) -> tauscope_detect::Task<'_> {
        tauscope_detect::Task {
            setup: self.setup,
            lessons: self.lessons,
            free_first_s: self.free_first_s,
            seed: self.seed,
        }
    }
}

/// Properties of a set that determine the suitable detectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facts {
    /// The labels of the train recordings distinguish collisions from cooperations.
    pub kinds: bool,
    /// The arm repeats a cycle.
    pub cyclic: bool,
}

impl Facts {
    /// Determines the properties of a set and its labels.
    pub fn of(set: &SetFile, recordings: &[Named]) -> Self {
        let train = (recordings.iter()).filter(|recording| recording.role == Role::Train);
        let events = train.filter_map(|recording| recording.truth.as_ref());
        let kinds: Vec<&str> = events
            .flat_map(|truth| &truth.events)
            .map(|event| event.kind.as_str())
            .collect();
        Self {
            kinds: kinds.contains(&"collision") && kinds.contains(&"cooperation"),
            cyclic: set.cycle_s.is_some(),
        }
    }

    /// Whether `entry` runs on such a set by default.
    pub fn suit(self, entry: &Entry) -> bool {
        match entry.suits {
            Suits::All => true,
            Suits::Cycles => self.cyclic,
            Suits::Kinds => self.kinds,
            Suits::NewPaths => !self.kinds && !self.cyclic,
        }
    }
}
