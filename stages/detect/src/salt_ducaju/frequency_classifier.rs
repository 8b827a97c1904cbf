//! `frequency_classifier`: frequency content alone (Salt Ducaju et al., section II-B, after Kouris, Dimeas
//! and Aspragathos, "Contact Distinction in Human-Robot Cooperation with Admittance Control", 2016, and
//! "A Frequency Domain Approach for Contact Type Distinction in Human-Robot Collaboration", 2018).
//!
//! The contact is detected as in [`contact_classifier`](crate::salt_ducaju::contact_classifier), by `F_th` in any
//! direction. It is a collision if the largest norm exceeds a second, higher threshold, and a cooperation if it has
//! not done so `decide_s` after the detection. The cited papers have no separate detection and hence no such delay.
//! Without it every collision would start as a cooperation, because the norm passes the lower threshold first.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::TwinState;

use crate::frame::{
    ConfigError, ContactKind, Details, Detector, DetectorSettings, Judgement, LearnError, Lessons,
    ScoreUnit, Setup, Suits, Tap, Task, Trained, Training,
};
use crate::salt_ducaju::contact_machine::{
    Machine, MachineSettings, NewContact, Ongoing, Rule, judgement,
};
use crate::salt_ducaju::contact_signals::{Instant, SignalSettings, Signals};
use crate::salt_ducaju::contact_tuning;
use crate::salt_ducaju::sliding_dft::BandError;

/// Canonical name.
pub(crate) const NAME: &str = "frequency_classifier";

/// Settings of `frequency_classifier`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Estimation and filtering of the external force.
    pub signals: SignalSettings,
    /// Start and end of a contact.
    pub detection: MachineSettings,
    /// Norm above which a contact is a collision \[N\].
    #[schemars(range(min = 0.0))]
    pub collision_threshold_n: f64,
    /// Time from the detection after which a contact that did not exceed this norm is a cooperation \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub decide_s: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            signals: SignalSettings::default(),
            detection: MachineSettings::default(),
            // Twice `F_th`.
            collision_threshold_n: 1.7,
            decide_s: 0.05,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "`contact_classifier` with the frequency content alone as the criterion.";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::Newton;
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::Kinds;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let mut signals = Signals::tap(&self.signals, setup, NAME)?;
        Ok(Box::new(FrequencyClassifier {
            tool_link: signals.with(|signals| signals.tool_link()),
            signals,
            fault: None,
            by_content: ByContent::new(self),
        }))
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((learn(self, task.setup, &task.lessons)?, None))
    }

    fn warning(&self, setup: &Setup) -> Option<String> {
        self.signals.warning(NAME, setup)
    }
}

struct FrequencyClassifier {
    signals: Tap<Signals>,
    tool_link: usize,
    fault: Option<BandError>,
    by_content: ByContent,
}

impl Detector for FrequencyClassifier {
    fn name(&self) -> &'static str {
        NAME
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let (instant, fault) =
            (self.signals).with(|signals| (signals.update(sample), signals.fault()));
        self.fault = fault;
        let ongoing = if let Some(instant) = &instant {
            self.by_content.step(instant)
        } else {
            self.by_content.reset();
            None
        };
        judgement(instant.as_ref(), ongoing, self.tool_link)
    }

    fn threshold(&self) -> Option<f64> {
        Some(self.by_content.force_threshold_n)
    }

    fn details(&self) -> Option<Details> {
        self.by_content.machine.details()
    }

    fn fault(&self) -> Option<String> {
        self.fault.map(|fault| fault.to_string())
    }
}

/// Classifies every contact as a cooperation, so that the machine holds it until it ends and does not classify it
/// again.
struct Undecided;

impl Rule for Undecided {
    fn classify(&mut self, _: &NewContact) -> ContactKind {
        ContactKind::Cooperation
    }
}

/// Classification by frequency content.
struct ByContent {
    machine: Machine,
    force_threshold_n: f64,
    collision_threshold_n: f64,
    decide_ns: i64,
    /// The current contact: start, detection, and kind once it is decided.
    contact: Option<(i64, i64, Option<ContactKind>)>,
}

impl ByContent {
    fn new(settings: &Settings) -> Self {
        Self {
            machine: Machine::new(&settings.detection, settings.signals.window),
            force_threshold_n: settings.detection.force_threshold_n,
            collision_threshold_n: settings.collision_threshold_n,
            decide_ns: (settings.decide_s * 1e9) as i64,
            contact: None,
        }
    }

    fn reset(&mut self) {
        self.machine.reset();
        self.contact = None;
    }

    fn step(&mut self, instant: &Instant) -> Ongoing {
        let Some((_, contact_ns)) = self.machine.step(instant, &mut Undecided) else {
            self.contact = None;
            return None;
        };
        let before = self
            .contact
            .filter(|(began_ns, ..)| *began_ns == contact_ns);
        let (_, detected_ns, kind) = before.unwrap_or((contact_ns, instant.stamp_ns, None));
        let kind = if instant.largest_norm_n() > self.collision_threshold_n {
            Some(ContactKind::Collision)
        } else if instant.stamp_ns - detected_ns >= self.decide_ns {
            kind.or(Some(ContactKind::Cooperation))
        } else {
            kind
        };
        self.contact = Some((contact_ns, detected_ns, kind));
        kind.map(|kind| (kind, contact_ns))
    }
}

/// Tunes `F_th` as [`contact_classifier::learn`](crate::salt_ducaju::contact_classifier::learn) does. Tunes the
/// higher threshold by the criterion used there for γ, on the largest norm of the training contacts up to the
/// decision.
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
    let window = settings.signals.window;
    let found = contact_tuning::found(&tracks, &learnt.detection, window, &mut Undecided, NAME)?;
    let decide_ns = (settings.decide_s * 1e9) as i64;
    // A collision has a larger norm, whereas `sweep_class` expects smaller values: use the negative norm.
    let norms: Vec<_> = found
        .iter()
        .map(|found| (found.kind, -found.largest_norm_n(decide_ns)))
        .collect();
    let [low, high] = contact_tuning::best(&contact_tuning::sweep_class(&norms, f64::NEG_INFINITY));
    // Geometric mean of the norms of the contacts on either side.
    learnt.collision_threshold_n = (low * high).sqrt().max(learnt.detection.force_threshold_n);
    Ok(learnt)
}
