//! The detector's part of the pipeline file, and the list of detectors.

mod error;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use error::ConfigError;

use crate::frame::detector::Detector;
use crate::frame::stage::{JointSetup, Setup};
use crate::indri::virtual_collision_sensor::Learnt;
use crate::indri::{virtual_collision_sensor, virtual_collision_sensor_basic};
use crate::salt_ducaju::{contact_classifier, fisher_discriminant, frequency_classifier};
use crate::tajiri::{
    lstm_momentum_observer, momentum_observer, naive_difference, point_autoencoder, point_ocsvm,
    twin_regression, window_autoencoder, window_ocsvm,
};
use crate::tauscope;

/// Standard deviations from the mean score of contact-free data to the alarm of `detector`, where the
/// file names no threshold: equation 7 of Tajiri and Iwamoto.
fn default_sigmas(detector: &str) -> f64 {
    match detector {
        momentum_observer::NAME => momentum_observer::SIGMAS,
        _ => 4.0,
    }
}

/// A detector: exactly one of the detectors' keys, and what all of them share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Squared length of the residual after the twin's regression (Tajiri and Iwamoto).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub twin_regression: Option<twin_regression::Settings>,
    /// The same without the regression: gain 1, offset 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub naive_difference: Option<naive_difference::Settings>,
    /// Collisions from both efforts alone, with a constant bias (Indri, Trapani and Lazzero).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub virtual_collision_sensor_basic: Option<virtual_collision_sensor_basic::Settings>,
    /// The same with a bias that is learnt and adapts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub virtual_collision_sensor: Option<virtual_collision_sensor::Settings>,
    /// Collision or cooperation, by the force's frequency content and direction (Salt Ducaju et al.).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact_classifier: Option<contact_classifier::Settings>,
    /// The same detection, told apart by Fisher's linear discriminant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fisher_discriminant: Option<fisher_discriminant::Settings>,
    /// The same detection, told apart by the frequency content alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_classifier: Option<frequency_classifier::Settings>,
    /// Squared length of the external torque that a momentum observer of the rigid body sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub momentum_observer: Option<momentum_observer::Settings>,
    /// One-class support vector machine over the external torques of one sample (Tajiri and Iwamoto).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_ocsvm: Option<point_ocsvm::Settings>,
    /// Autoencoder over the external torques of one sample (Tajiri and Iwamoto).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_autoencoder: Option<point_autoencoder::Settings>,
    /// Momentum observer less what an LSTM expects of it (Tajiri and Iwamoto, after Lim et al.).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lstm_momentum_observer: Option<lstm_momentum_observer::Settings>,
    /// `point_ocsvm` over windows (after Park et al.).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_ocsvm: Option<window_ocsvm::Settings>,
    /// `point_autoencoder` over windows (after Park et al.).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub window_autoencoder: Option<window_autoencoder::Settings>,
    /// The residual held against what it usually is: our own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tauscope: Option<tauscope::Settings>,
    /// When the alarm is raised.
    pub threshold: Threshold,
    /// An alarm ends once the score has stayed below the threshold for this long \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub hold_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            twin_regression: None,
            naive_difference: None,
            virtual_collision_sensor_basic: None,
            virtual_collision_sensor: None,
            contact_classifier: None,
            fisher_discriminant: None,
            frequency_classifier: None,
            momentum_observer: None,
            point_ocsvm: None,
            point_autoencoder: None,
            lstm_momentum_observer: None,
            window_ocsvm: None,
            window_autoencoder: None,
            tauscope: None,
            threshold: Threshold::default(),
            // Bridges the dip between two swings of one contact.
            hold_s: 0.1,
        }
    }
}

impl Config {
    /// The one detector that is configured.
    ///
    /// # Errors
    /// If there is none, or more than one.
    pub fn detector(&self, setup: &Setup) -> Result<Box<dyn Detector>, ConfigError> {
        let mut configured = self.detectors(setup)?;
        match (configured.pop(), configured.len()) {
            (Some(detector), 0) => Ok(detector),
            (None, _) => Err(ConfigError::OneDetector { found: 0 }),
            (Some(_), others) => Err(ConfigError::OneDetector { found: others + 1 }),
        }
    }

    /// The canonical name of the detector that is configured, if it is one.
    pub fn name(&self) -> Option<&'static str> {
        let given = [
            (self.twin_regression.is_some(), twin_regression::NAME),
            (self.naive_difference.is_some(), naive_difference::NAME),
            (
                self.virtual_collision_sensor_basic.is_some(),
                virtual_collision_sensor_basic::NAME,
            ),
            (
                self.virtual_collision_sensor.is_some(),
                virtual_collision_sensor::NAME,
            ),
            (self.tauscope.is_some(), tauscope::NAME),
            (self.contact_classifier.is_some(), contact_classifier::NAME),
            (
                self.fisher_discriminant.is_some(),
                fisher_discriminant::NAME,
            ),
            (
                self.frequency_classifier.is_some(),
                frequency_classifier::NAME,
            ),
            (self.momentum_observer.is_some(), momentum_observer::NAME),
            (self.point_ocsvm.is_some(), point_ocsvm::NAME),
            (self.point_autoencoder.is_some(), point_autoencoder::NAME),
            (
                self.lstm_momentum_observer.is_some(),
                lstm_momentum_observer::NAME,
            ),
            (self.window_ocsvm.is_some(), window_ocsvm::NAME),
            (self.window_autoencoder.is_some(), window_autoencoder::NAME),
        ];
        let mut names = given
            .iter()
            .filter(|(given, _)| *given)
            .map(|(_, name)| *name);
        names.next().filter(|_| names.next().is_none())
    }

    /// The file that keeps what the detector learns, where the configuration names one. The program reads
    /// and writes it.
    pub fn state_mut(&mut self) -> Option<&mut PathBuf> {
        self.virtual_collision_sensor.as_mut()?.state.as_mut()
    }

    /// Lets the detector go on from what an earlier life has learnt.
    pub fn resume(&mut self, learnt: Learnt) {
        if let Some(settings) = &mut self.virtual_collision_sensor {
            settings.learnt = Some(learnt);
        }
    }

    /// Every detector that only a threshold is wanting to, with its usual settings; none that needs torques where no joint tells any.
    ///
    /// # Errors
    /// If `setup` lacks what one of them needs.
    pub fn every(setup: &Setup) -> Result<Vec<Box<dyn Detector>>, ConfigError> {
        let tells_torque = setup.joints.iter().any(JointSetup::tells_torque);
        let all = Self {
            twin_regression: Some(twin_regression::Settings::default()),
            naive_difference: Some(naive_difference::Settings::default()),
            momentum_observer: (setup.model.is_some() && tells_torque)
                .then(momentum_observer::Settings::default),
            ..Self::default()
        };
        all.detectors(setup)
    }

    /// What speaks against running this detector in this cell, though it can.
    pub fn warning(&self, setup: &Setup) -> Option<String> {
        let signals = [
            (
                contact_classifier::NAME,
                self.contact_classifier.as_ref().map(|s| &s.signals),
            ),
            (
                fisher_discriminant::NAME,
                self.fisher_discriminant.as_ref().map(|s| &s.signals),
            ),
            (
                frequency_classifier::NAME,
                self.frequency_classifier.as_ref().map(|s| &s.signals),
            ),
        ];
        let mut tuned = signals
            .iter()
            .filter_map(|(name, signals)| signals.and_then(|s| s.warning(name, setup)));
        let own = self.tauscope.as_ref();
        tuned.next().or_else(|| own.and_then(tauscope::warning))
    }

    /// A line a detector.
    fn detectors(&self, setup: &Setup) -> Result<Vec<Box<dyn Detector>>, ConfigError> {
        let mut all: Vec<Box<dyn Detector>> = Vec::new();
        if let Some(settings) = &self.twin_regression {
            all.push(twin_regression::build(settings));
        }
        if let Some(settings) = &self.naive_difference {
            all.push(naive_difference::build(settings, setup));
        }
        if let Some(settings) = &self.virtual_collision_sensor_basic {
            let sensor = virtual_collision_sensor_basic::build(settings, setup, self.hold_s)?;
            all.push(Box::new(sensor));
        }
        if let Some(settings) = &self.virtual_collision_sensor {
            let sensor = virtual_collision_sensor::build(settings, setup, self.hold_s)?;
            all.push(Box::new(sensor));
        }
        if let Some(settings) = &self.momentum_observer {
            all.push(momentum_observer::build(settings, setup)?);
        }
        if let Some(settings) = &self.contact_classifier {
            all.push(contact_classifier::build(settings, setup)?);
        }
        if let Some(settings) = &self.fisher_discriminant {
            all.push(fisher_discriminant::build(settings, setup)?);
        }
        if let Some(settings) = &self.frequency_classifier {
            all.push(frequency_classifier::build(settings, setup)?);
        }
        if self.point_ocsvm.is_some() {
            all.push(point_ocsvm::build(setup)?);
        }
        if self.point_autoencoder.is_some() {
            all.push(point_autoencoder::build(setup)?);
        }
        if self.lstm_momentum_observer.is_some() {
            all.push(lstm_momentum_observer::build(setup)?);
        }
        if self.window_ocsvm.is_some() {
            all.push(window_ocsvm::build(setup)?);
        }
        if self.window_autoencoder.is_some() {
            all.push(window_autoencoder::build(setup)?);
        }
        if let Some(settings) = &self.tauscope {
            all.push(tauscope::build(settings, setup)?);
        }
        Ok(all)
    }

    /// The files of trained detectors that are to be read into [`Setup::trained`], by detector.
    pub fn trained_files_mut(&mut self) -> impl Iterator<Item = (&'static str, &mut PathBuf)> {
        let files = [
            (
                point_ocsvm::NAME,
                self.point_ocsvm.as_mut().and_then(|s| s.model.as_mut()),
            ),
            (
                point_autoencoder::NAME,
                self.point_autoencoder
                    .as_mut()
                    .and_then(|s| s.model.as_mut()),
            ),
            (
                lstm_momentum_observer::NAME,
                self.lstm_momentum_observer
                    .as_mut()
                    .and_then(|s| s.model.as_mut()),
            ),
            (
                window_ocsvm::NAME,
                self.window_ocsvm.as_mut().and_then(|s| s.model.as_mut()),
            ),
            (
                window_autoencoder::NAME,
                self.window_autoencoder
                    .as_mut()
                    .and_then(|s| s.model.as_mut()),
            ),
        ];
        (files.into_iter()).filter_map(|(name, file)| file.map(|file| (name, file)))
    }
}

/// From which score on the alarm is raised: at most one of the two.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Threshold {
    /// This many standard deviations above the mean of the score on contact-free data, which
    /// `twin.yaml` holds. By default 4, of `momentum_observer` 3.
    #[schemars(range(min = 0.0, max = 1000.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigmas: Option<f64>,
    /// This score.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
}

impl Threshold {
    /// The score from which on `detector` raises the alarm (equation 7 of Tajiri and Iwamoto: mean +
    /// k standard deviations).
    ///
    /// # Errors
    /// If both kinds are given, or standard deviations are wanted and nobody has measured them.
    pub fn resolve(&self, detector: &'static str, setup: &Setup) -> Result<f64, ConfigError> {
        match (self.sigmas, self.score) {
            (Some(_), Some(_)) => Err(ConfigError::TwoThresholds),
            (None, Some(score)) => Ok(score),
            (sigmas, None) => {
                let sigmas = sigmas.unwrap_or_else(|| default_sigmas(detector));
                match setup.statistics(detector) {
                    Some(score) => Ok(score.mean + sigmas * score.standard_deviation),
                    None => Err(ConfigError::NoStatistics { detector, sigmas }),
                }
            }
        }
    }
}
