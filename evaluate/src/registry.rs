//! Which detectors run on a set, and how each comes to its settings. What there is, the detectors' own table
//! says ([`DETECTORS`](tauscope_detect::DETECTORS)).

use std::path::PathBuf;

use tauscope_archive::whole_file;
use tauscope_detect::{Config, Entry, LearnError, Lessons, Setup, Suits, Sweeps};
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::trained;

use crate::recording::{Named, Role};

/// How many seeds a detector is trained with in whose training chance has a part.
/// Statistical: the mean over five seeds has a standard error of 0.45 standard deviations.
pub const SEEDS: u64 = 5;

/// What there is to learn from.
#[derive(Debug)]
pub struct Task<'a> {
    /// The cell and its twin.
    pub setup: &'a Setup,
    /// Train and validation recordings behind the twin.
    pub lessons: Lessons<'a>,
    /// For so long nothing touches the robot at the beginning of each recording \[s\].
    pub free_first_s: f64,
    /// For what is drawn by chance.
    pub seed: u64,
    /// How long the fit of the twin took, if it was fitted \[s\].
    pub twin_fit_s: Option<f64>,
    /// What the set says of the detectors' settings.
    pub given: &'a Config,
    /// Where trained weights go; the ending is the detector's.
    pub weights: PathBuf,
}

impl Task<'_> {
    /// Trains or tunes a detector: what its part of a pipeline file would be.
    ///
    /// # Errors
    /// If it cannot learn from these recordings, or its weights cannot be written.
    pub fn learn(&self, entry: &Entry) -> Result<Config, LearnError> {
        let usual = (entry.settings)();
        let given = self.given.given(entry).unwrap_or(&*usual);
        let (mut settings, trained) = given.learn(&self.of_detector())?;
        if let (Some(trained), Some(file)) = (trained, settings.trained_file()) {
            let path = trained::write(&self.weights, &self.lessons, trained)?;
            // Of an evaluation that is interrupted nothing stays.
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

    /// The curves behind what was learnt, where a detector was tuned by some.
    ///
    /// # Errors
    /// As [`learn`](Self::learn).
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

/// What kind of set it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facts {
    /// The train recordings tell collisions from cooperations.
    pub kinds: bool,
    /// The same cycle is repeated.
    pub cyclic: bool,
}

impl Facts {
    /// Of a set and its labels.
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

    /// Whether `entry` runs on such a set where nobody names detectors.
    pub fn suit(self, entry: &Entry) -> bool {
        match entry.suits {
            Suits::All => true,
            Suits::Cycles => self.cyclic,
            Suits::Kinds => self.kinds,
            Suits::NewPaths => !self.kinds && !self.cyclic,
        }
    }
}
