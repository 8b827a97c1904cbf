//! The detector's part of the pipeline file. Its keys are the names in the [table](DETECTORS) of detectors.

mod file;

use std::any::Any;
use std::path::{Path, PathBuf};

pub use file::StateFile;

use crate::detectors::{DETECTORS, Entry};
use crate::frame::{
    AnySettings, ConfigError, DEFAULT_HOLD_S, Detect, Detector, DetectorSettings, Setup, State,
    Threshold,
};

/// The key of the learnt state in a detector's settings.
const LEARNT: &str = "learnt";

/// Configuration of the detect stage: a detector, and the settings that all detectors share.
///
/// ```yaml
/// twin_regression: {}
/// threshold: {sigmas: 5}
/// hold_s: 0.2
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// The configured detectors: one in a pipeline file, any number in a labelled set.
    pub detectors: Given,
    /// Alarm threshold.
    pub threshold: Threshold,
    /// Time for which the score must stay below the threshold before an alarm ends \[s\].
    pub hold_s: f64,
}

/// Settings of some detectors, each at most once, in the order of the table.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given(Vec<Box<dyn AnySettings>>);

impl Default for Config {
    fn default() -> Self {
        Self {
            detectors: Given::default(),
            threshold: Threshold::default(),
            hold_s: DEFAULT_HOLD_S,
        }
    }
}

impl Config {
    /// Returns the configuration of the detector with these settings.
    pub fn of(settings: impl DetectorSettings) -> Self {
        Self::default().with(settings)
    }

    /// Returns this configuration with the given settings of one detector.
    #[must_use]
    pub fn with(self, settings: impl DetectorSettings) -> Self {
        self.with_any(Box::new(settings))
    }

    /// [`with`](Self::with) for any detector.
    #[must_use]
    pub fn with_any(mut self, settings: Box<dyn AnySettings>) -> Self {
        let given = &mut self.detectors.0;
        given.retain(|other| other.name() != settings.name());
        given.push(settings);
        let place = |name| DETECTORS.iter().position(|entry| entry.name == name);
        given.sort_by_key(|settings| place(settings.name()));
        self
    }

    /// Returns the settings of type `S`, if they are given.
    pub fn settings<S: DetectorSettings>(&self) -> Option<&S> {
        let mut all = self.detectors.0.iter();
        all.find_map(|settings| (&**settings as &dyn Any).downcast_ref())
    }

    /// Returns the settings of `entry`'s detector, if they are given.
    pub fn given(&self, entry: &Entry) -> Option<&dyn AnySettings> {
        let mut all = self.detectors.0.iter();
        let settings = all.find(|settings| settings.name() == entry.name)?;
        Some(&**settings)
    }

    /// Returns the settings of all configured detectors, in the order of the table.
    pub fn all(&self) -> impl Iterator<Item = &dyn AnySettings> {
        self.detectors.0.iter().map(|settings| &**settings)
    }

    /// Builds the detect stage of a cell.
    ///
    /// # Errors
    /// If none or several detectors are given, the cell lacks what the detector needs, or no threshold can
    /// be determined.
    pub fn stage(&self, setup: Setup) -> Result<Detect, ConfigError> {
        let settings = self.one()?;
        let detector = settings.build(&setup, self.hold_s)?;
        let entry = Entry::find(settings.name());
        let sigmas = entry.map_or(Threshold::SIGMAS, |entry| entry.sigmas);
        Detect::new(detector, (&self.threshold, sigmas), self.hold_s, setup)
    }

    /// Builds the only configured detector, without its stage.
    ///
    /// # Errors
    /// If none or several are given, or the cell lacks what it needs.
    pub fn detector(&self, setup: &Setup) -> Result<Box<dyn Detector>, ConfigError> {
        self.one()?.build(setup, self.hold_s)
    }

    fn one(&self) -> Result<&dyn AnySettings, ConfigError> {
        match &*self.detectors.0 {
            [settings] => Ok(&**settings),
            others => Err(ConfigError::OneDetector {
                found: others.len(),
            }),
        }
    }

    /// Returns the canonical name of the configured detector, if there is exactly one.
    pub fn name(&self) -> Option<&'static str> {
        Some(self.one().ok()?.name())
    }

    /// Builds every detector whose score a calibration in this cell measures, with its default settings.
    ///
    /// # Errors
    /// If the cell lacks what one of them needs.
    pub fn calibrated(setup: &Setup) -> Result<Vec<Box<dyn Detector>>, ConfigError> {
        let wanted = DETECTORS
            .iter()
            .filter(|entry| (entry.is_calibrated)(setup));
        let hold_s = Self::default().hold_s;
        wanted
            .map(|entry| (entry.settings)().build(setup, hold_s))
            .collect()
    }

    /// Returns a warning about running this detector in this cell, if there is one.
    pub fn warning(&self, setup: &Setup) -> Option<String> {
        self.all().find_map(|settings| settings.warning(setup))
    }

    /// Returns whether the detector can learn anew on request.
    pub fn learns_when_told(&self) -> bool {
        self.all().any(AnySettings::learns_when_told)
    }

    /// Returns the path of the file for the state that the detector learns while running, if one is set. The program
    /// reads and writes this file.
    pub fn state_mut(&mut self) -> Option<&mut PathBuf> {
        let mut all = self.detectors.0.iter_mut();
        all.find_map(|settings| settings.state_file()?.as_mut())
    }

    /// Restores the state that the detector learnt in an earlier run.
    ///
    /// # Errors
    /// If the state belongs to another detector.
    pub fn resume(&mut self, state: &State) -> Result<(), serde_json::Error> {
        let mut all = self.detectors.0.iter_mut();
        all.try_for_each(|settings| settings.resume(state.clone()))
    }

    /// Returns the files of learnt states that are named but not yet read, by detector.
    pub fn learnt_files(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        self.all()
            .filter_map(|settings| Some((settings.name(), settings.learnt_file()?)))
    }

    /// Returns the learnt state of the detector `name`, for [`resume`](Self::resume).
    pub fn learnt(&self, name: &str) -> Option<State> {
        let settings = self.all().find(|settings| settings.name() == name)?;
        let mut settings = serde_json::to_value(settings).ok()?;
        let learnt = settings.get_mut(LEARNT)?.take();
        learnt.is_object().then_some(learnt)
    }

    /// Returns the files of trained detectors to be read into [`Setup::trained`], by detector.
    pub fn trained_files_mut(&mut self) -> impl Iterator<Item = (&'static str, &mut PathBuf)> {
        self.detectors.0.iter_mut().filter_map(|settings| {
            let name = settings.name();
            Some((name, settings.trained_file()?.as_mut()?))
        })
    }
}
