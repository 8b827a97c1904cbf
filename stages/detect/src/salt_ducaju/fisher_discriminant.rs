//! `fisher_discriminant`: the alternative to [`contact_classifier`](crate::salt_ducaju::contact_classifier) in Salt
//! Ducaju et al., section V. It has the same detection, and Fisher's linear discriminant (R. A. Fisher, "The
//! statistical utilization of multiple measurements", 1938) on the same two unit vectors: of the force's derivative
//! and of the tool's velocity.
//!
//! The paper gives no further details. Here the six components are the measurements, the direction is
//! `w = S⁻¹ (m_coll - m_coop)` with the within-class scatter S, and the bound is half-way between the means.

use nalgebra::Vector6;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{
    ConfigError, ContactKind, Detector, DetectorSettings, Discriminant, LearnError, Lessons,
    Moments, ScoreUnit, Setup, Suits, Task, Trained, Training,
};
use crate::salt_ducaju::contact_machine::{
    ContactDetector, MachineSettings, NewContact, Rule, unit,
};
use crate::salt_ducaju::contact_signals::{SignalSettings, Signals};
use crate::salt_ducaju::contact_tuning;

/// Canonical name.
pub(crate) const NAME: &str = "fisher_discriminant";

/// Settings of `fisher_discriminant`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Estimation and filtering of the external force.
    pub signals: SignalSettings,
    /// Start and end of a contact.
    pub detection: MachineSettings,
    /// Discriminant learnt from labelled contacts; required to run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub discriminant: Option<Discriminant>,
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "`contact_classifier` with Fisher's linear discriminant as the classifier.";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::Newton;
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::Kinds;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let signals = Signals::tap(&self.signals, setup, NAME)?;
        let Some(discriminant) = self.discriminant else {
            return Err(ConfigError::NotLearnt { detector: NAME });
        };
        let shared = (&self.signals, &self.detection);
        Ok(Box::new(ContactDetector::new(
            NAME,
            signals,
            shared,
            discriminant,
        )))
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((learn(self, task.setup, &task.lessons)?, None))
    }

    fn warning(&self, setup: &Setup) -> Option<String> {
        self.signals.warning(NAME, setup)
    }
}

impl Rule for Discriminant {
    fn classify(&mut self, contact: &NewContact) -> ContactKind {
        let sum = Vector6::from(self.weights).dot(&measurements(contact));
        if sum > self.bound {
            ContactKind::Collision
        } else {
            ContactKind::Cooperation
        }
    }
}

/// Returns both unit vectors; zeros for a vector without length.
fn measurements(contact: &NewContact) -> Vector6<f64> {
    let mut all = Vector6::zeros();
    all.fixed_rows_mut::<3>(0)
        .copy_from_slice(&unit(contact.rise_n));
    all.fixed_rows_mut::<3>(3)
        .copy_from_slice(&unit(contact.velocity_m_per_s));
    all
}

/// Tunes `F_th` as [`contact_classifier::learn`](crate::salt_ducaju::contact_classifier::learn) does, and learns the
/// discriminant from the detected training contacts.
///
/// # Errors
/// If the training recordings have no labels, no collisions, no cooperations, or no contact-free time.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Result<Settings, LearnError> {
    let tracks = contact_tuning::tracks(&settings.signals, setup, lessons, NAME)?;
    let mut learnt = settings.clone();
    learnt.signals = tracks.tuned(&settings.signals);
    learnt.detection.force_threshold_n = contact_tuning::force_threshold(&tracks, NAME)?;
    // Algorithm 1 does not classify detections during a cooperation. This rule always answers collision, so that
    // every detection is classified.
    let mut rule = Discriminant {
        weights: [0.0; 6],
        bound: -1.0,
    };
    let window = settings.signals.window;
    let found = contact_tuning::found(&tracks, &learnt.detection, window, &mut rule, NAME)?;
    let found: Vec<_> = found
        .iter()
        .map(|found| (found.kind, measurements(&found.contact)))
        .collect();
    learnt.discriminant = Some(Moments::of(&found).discriminant());
    Ok(learnt)
}
