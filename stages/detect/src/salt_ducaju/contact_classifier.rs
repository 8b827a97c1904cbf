//! `contact_classifier`: Salt Ducaju, Olofsson, Robertsson and Johansson, "Fast Contact Detection and
//! Classification for Kinesthetic Teaching in Robots using only Embedded Sensors", RO-MAN 2022.
//!
//! There is a contact if the external force's content in the band exceeds `F_th` in any direction (equation 4,
//! Algorithm 1: [`contact_machine`](crate::salt_ducaju::contact_machine)). It is a cooperation if the force increases
//! in the direction of motion along a direction that detects it (5), or if the force is not aligned with the motion
//! (6); otherwise it is a collision (Algorithm 2).
//!
//! A tool at standstill does not collide: below `standstill_m_per_s` a contact is a cooperation. A velocity
//! component below this limit has no sign for (5), and is raised to it in (6) to avoid a division by noise.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{
    ClassSweep, ConfigError, ContactKind, Detector, DetectorSettings, LearnError, Lessons,
    ScoreUnit, Setup, Suits, Sweeps, Task, Trained, Training,
};
use crate::salt_ducaju::contact_machine::{ContactDetector, MachineSettings, NewContact, Rule};
use crate::salt_ducaju::contact_signals::{SignalSettings, Signals};
use crate::salt_ducaju::contact_tuning;

/// Canonical name.
pub(crate) const NAME: &str = "contact_classifier";

/// The paper's γ.
/// Tuned: by Salt Ducaju et al. (section V), on their robot.
const PAPERS_GAMMA: f64 = 6.2;

/// Settings of `contact_classifier`; the defaults are the paper's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Estimation and filtering of the external force.
    pub signals: SignalSettings,
    /// Start and end of a contact.
    pub detection: MachineSettings,
    /// Left side of condition (6) from which a contact is a cooperation (γ).
    #[schemars(range(min = 0.0))]
    pub gamma: f64,
    /// Speed below which the tool is at standstill \[m/s\].
    #[schemars(range(min = 0.0))]
    pub standstill_m_per_s: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            signals: SignalSettings::default(),
            detection: MachineSettings::default(),
            gamma: PAPERS_GAMMA,
            standstill_m_per_s: 0.005,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str = "Collision or cooperation, by the force's frequency content and direction (Salt Ducaju et al.).";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::Newton;
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::Kinds;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let signals = Signals::tap(&self.signals, setup, NAME)?;
        let rule = Conditions::of(self);
        let shared = (&self.signals, &self.detection);
        Ok(Box::new(ContactDetector::new(NAME, signals, shared, rule)))
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((learn(self, task.setup, &task.lessons)?, None))
    }

    fn warning(&self, setup: &Setup) -> Option<String> {
        self.signals.warning(NAME, setup)
    }

    fn sweeps(&self, task: &Task<'_>) -> Result<Option<Sweeps>, LearnError> {
        sweeps(self, task.setup, &task.lessons).map(Some)
    }
}

/// Algorithm 2.
#[derive(Debug, Clone, Copy)]
struct Conditions {
    gamma: f64,
    standstill_m_per_s: f64,
}

impl Conditions {
    fn of(settings: &Settings) -> Self {
        Self {
            gamma: settings.gamma,
            standstill_m_per_s: settings.standstill_m_per_s,
        }
    }
}

impl Rule for Conditions {
    fn classify(&mut self, contact: &NewContact) -> ContactKind {
        match misalignment(contact, self.standstill_m_per_s) {
            Some(ratio) if ratio < self.gamma => ContactKind::Collision,
            _ => ContactKind::Cooperation,
        }
    }
}

/// Returns the left side of (6), `‖u_Ḟ ⊘ u_ξ̇‖₂`; `None` if the contact is a cooperation for any γ: the tool is at
/// standstill, or the force increases in the direction of motion (5).
pub fn misalignment(contact: &NewContact, standstill_m_per_s: f64) -> Option<f64> {
    let speed = length(&contact.velocity_m_per_s);
    let with_motion = |&(rise, velocity): &(f64, f64)| {
        velocity.abs() >= standstill_m_per_s && rise * velocity > 0.0
    };
    if speed < standstill_m_per_s || contact.along.iter().flatten().any(with_motion) {
        return None;
    }
    let floored = contact
        .velocity_m_per_s
        .map(|velocity| velocity.abs().max(standstill_m_per_s));
    let ratios = std::array::from_fn(|i| contact.rise_n[i] / floored[i]);
    let ratio = length(&ratios) * length(&floored) / length(&contact.rise_n);
    // A contact without any rise has no direction, and no evidence of an obstacle.
    ratio.is_finite().then_some(ratio)
}

fn length(vector: &[f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Tunes `F_th` and γ on labelled recordings, and stores the impedance. `F_th` is 10 % above the largest norm of
/// contact-free motion: no false alarms first, then as many detections as possible. γ maximises 2 specificity +
/// sensitivity. Among equal values it is the largest ("conservatively high"), but not above the paper's γ if that is
/// one of them.
///
/// # Errors
/// If the training recordings have no labels, no collisions, no cooperations, or no contact-free time.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Result<Settings, LearnError> {
    let (mut learnt, _, class) = tune(settings, setup, lessons)?;
    let [low, high] = contact_tuning::best(&class);
    learnt.gamma = high.min(low.max(PAPERS_GAMMA));
    Ok(learnt)
}

/// Returns the trade-off curves behind [`learn`]: delay and false alarms over `F_th`, sensitivity and specificity
/// over γ at the learnt `F_th`.
///
/// # Errors
/// As [`learn`].
pub fn sweeps(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Result<Sweeps, LearnError> {
    let (_, tracks, class) = tune(settings, setup, lessons)?;
    let rule = &mut Conditions::of(settings);
    let window = settings.signals.window;
    Ok(Sweeps {
        detection: contact_tuning::sweep_threshold(&tracks, &settings.detection, window, rule),
        class,
        force_threshold_n: settings.detection.force_threshold_n,
        bound: settings.gamma,
    })
}

type Tuned = (Settings, contact_tuning::Tracks, Vec<ClassSweep>);

fn tune(settings: &Settings, setup: &Setup, lessons: &Lessons<'_>) -> Result<Tuned, LearnError> {
    let tracks = contact_tuning::tracks(&settings.signals, setup, lessons, NAME)?;
    let mut learnt = settings.clone();
    learnt.signals = tracks.tuned(&settings.signals);
    learnt.detection.force_threshold_n = contact_tuning::force_threshold(&tracks, NAME)?;
    let window = settings.signals.window;
    let rule = &mut Conditions::of(settings);
    let found = contact_tuning::found(&tracks, &learnt.detection, window, rule, NAME)?;
    // A cooperation by (5) remains one at any γ.
    let ratio = |contact: &NewContact| misalignment(contact, settings.standstill_m_per_s);
    let ratios: Vec<_> = (found.iter())
        .map(|found| (found.kind, ratio(&found.contact).unwrap_or(f64::INFINITY)))
        .collect();
    let class = contact_tuning::sweep_class(&ratios, PAPERS_GAMMA);
    Ok((learnt, tracks, class))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(rise_n: [f64; 3], velocity_m_per_s: [f64; 3], detects: usize) -> NewContact {
        let mut along = [None; 3];
        along[detects] = Some((rise_n[detects], velocity_m_per_s[detects]));
        NewContact {
            contact_ns: 0,
            rise_n,
            velocity_m_per_s,
            along,
        }
    }

    fn kind(contact: &NewContact) -> ContactKind {
        Conditions::of(&Settings::default()).classify(contact)
    }

    #[test]
    fn a_force_that_grows_with_the_motion_is_a_cooperation() {
        // The paper's second example, along Y: condition (5) decides.
        let pushed = contact([0.5, 4.0, 0.1], [0.02, 0.1, -0.02], 1);
        assert_eq!(misalignment(&pushed, 0.005), None);
        assert_eq!(kind(&pushed), ContactKind::Cooperation);
    }

    #[test]
    fn the_papers_examples_fall_on_either_side_of_its_gamma() {
        // 2.97 < 6.2, against the motion along Z.
        let hit = contact([5.698, 0.0, 8.218], [-0.1, 0.0, -0.4899], 2);
        let ratio = misalignment(&hit, 0.005).unwrap();
        assert!((ratio - 2.97).abs() < 0.01, "{ratio}");
        assert_eq!(kind(&hit), ContactKind::Collision);
        // 41.84 > 6.2: across the motion by (6).
        let across = contact([8.367, 0.0, 5.477], [-0.01, 0.0, -0.4999], 2);
        let ratio = misalignment(&across, 0.005).unwrap();
        assert!((ratio - 41.84).abs() < 0.1, "{ratio}");
        assert_eq!(kind(&across), ContactKind::Cooperation);
    }

    #[test]
    fn a_force_along_the_motion_has_the_ratio_of_parallel_vectors() {
        let parallel = contact([-1.0, -2.0, -3.0], [0.1, 0.2, 0.3], 2);
        let ratio = misalignment(&parallel, 0.005).unwrap();
        assert!((ratio - 3.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_standing_tool_is_hit_by_nobody() {
        let still = contact([0.0, 0.0, 5.0], [0.001, 0.0, -0.004], 2);
        assert_eq!(kind(&still), ContactKind::Cooperation);
    }

    #[test]
    fn a_direction_without_motion_neither_divides_by_zero_nor_has_a_sense() {
        let hit = contact([0.0, 0.2, 9.0], [0.0, 0.0, -0.2], 2);
        assert!(misalignment(&hit, 0.005).unwrap().is_finite());
        assert_eq!(kind(&hit), ContactKind::Collision);
        // Detected along Y, where the velocity is noise: (5) must not use its sign.
        let across = contact([0.0, 9.0, 0.0], [0.0, 0.002, -0.2], 1);
        assert!(misalignment(&across, 0.005).is_some());
        assert_eq!(kind(&across), ContactKind::Cooperation);
    }
}
