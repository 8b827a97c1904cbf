//! The detector as a stage: takes twin states and emits a detection for each.

use tauscope_bus::{Detection, Emit, MAX_JOINTS, Name, Stage, StageError, TwinState, flags};

use super::detector::{Detector, Judgement, Seen, State};
use super::error::ConfigError;
use super::events::{Alarm, OwnEvents, Step};
use super::isolation::{Contact, Isolation};
use super::setup::Setup;
use super::threshold::Threshold;

/// Share of the threshold from which a score may belong to a contact, where the score on contact-free data has not
/// been measured.
/// Derived: a measured score has (mean + σ) / (mean + 4 σ), which is 0.49 for the squared length of seven Gaussian
/// residuals.
const BEGIN: f64 = 0.5;

/// The rule by which an alarm is raised.
enum Rule {
    /// A threshold on the score.
    Threshold(Alarm),
    /// The detector's own rules; `threshold` is the score at which they detect a contact.
    Own { threshold: f64, events: OwnEvents },
}

impl Rule {
    fn threshold(&self) -> f64 {
        match self {
            Self::Threshold(alarm) => alarm.threshold(),
            Self::Own { threshold, .. } => *threshold,
        }
    }
}

/// The detect stage: one detector, its alarm rule and the isolation of contacts.
pub struct Detect {
    detector: Box<dyn Detector>,
    name: Name,
    rule: Rule,
    isolation: Isolation,
    /// [`flags::RESET`] of a sample that was withheld from the detector.
    begins: u32,
}

impl Detect {
    /// Creates the stage of `detector` in a cell. The alarm is raised at the threshold `wanted`, by default `sigmas`
    /// standard deviations above the mean score. It lasts until the score has stayed below the threshold for
    /// `hold_s` \[s\]. A detector with its own rules accepts no threshold.
    ///
    /// # Errors
    /// If no threshold can be determined, or one is given to a detector with its own rules.
    pub fn new(
        detector: Box<dyn Detector>,
        (wanted, sigmas): (&Threshold, f64),
        hold_s: f64,
        setup: Setup,
    ) -> Result<Self, ConfigError> {
        let rule = match detector.threshold() {
            Some(_) if *wanted != Threshold::default() => {
                let detector = detector.name();
                return Err(ConfigError::OwnThreshold { detector });
            }
            Some(threshold) => Rule::Own {
                threshold,
                events: OwnEvents::default(),
            },
            None => {
                let threshold = wanted.resolve(detector.name(), sigmas, &setup)?;
                // Upper end of the score's baseline range: one standard deviation above its mean.
                let low = setup.statistics(detector.name());
                let low = low.map_or(BEGIN * threshold, |score| {
                    score.mean + score.standard_deviation
                });
                Rule::Threshold(Alarm::new(threshold, low, hold_s))
            }
        };
        Ok(Self {
            name: Name::new(detector.name()),
            detector,
            rule,
            isolation: Isolation::new(setup),
            begins: 0,
        })
    }

    /// Returns the detector's judgement of a sample. A sample with a non-finite value is withheld from the detector,
    /// because the value would persist in filters and means: the detector is not ready for that sample, and its
    /// [`flags::RESET`] is passed on with the next one.
    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let begins = sample.header.flags & flags::RESET;
        if !is_sound(sample) {
            self.begins |= begins;
            return Judgement {
                score: 0.0,
                ready: false,
                verdict: None,
            };
        }
        match std::mem::take(&mut self.begins) & !begins {
            0 => self.detector.judge(sample),
            begins => {
                let mut sample = *sample;
                sample.header.flags |= begins;
                self.detector.judge(&sample)
            }
        }
    }

    /// Returns the state that the detector learnt while running, for the next run; `None` if it learns nothing.
    pub fn learnt(&self) -> Option<State> {
        self.detector.learnt()
    }

    /// Returns whether the detector is learning.
    pub fn is_learning(&self) -> bool {
        self.detector.is_learning()
    }
}

impl Detect {
    /// Returns joints and place of the contact in a sample: those that the detector has `seen`, or else those that
    /// follow from the residuals. While the alarm is held, a sample with a score below the threshold does not change
    /// them.
    fn isolate(
        &mut self,
        sample: &TwinState,
        score: f64,
        seen: Option<Seen>,
        begins: bool,
    ) -> (u32, Option<Contact>) {
        if begins {
            self.isolation.begin();
        }
        let counts = begins || score >= self.rule.threshold();
        let isolation = &mut self.isolation;
        let joints = (seen.and_then(|seen| seen.joints))
            .unwrap_or_else(|| isolation.loaded_joints(sample, score, counts));
        let place = (seen.and_then(|seen| seen.place)).or_else(|| isolation.locate(sample, counts));
        (joints, place)
    }

    fn tell_place(&self, contact: &Contact, slot: &mut Detection) {
        let name = |link| Name::new(self.isolation.link_name(link));
        slot.header.flags |= flags::FORCE;
        slot.link = name(contact.link);
        slot.other_link = contact.other_link.map(name).unwrap_or_default();
        slot.force_n = contact.force_n;
        slot.point_m = contact.point_m;
    }
}

/// Returns whether every value of every joint is finite.
fn is_sound(sample: &TwinState) -> bool {
    let joints = (sample.header.joint_count as usize).min(MAX_JOINTS);
    let values = [
        &sample.position,
        &sample.velocity,
        &sample.acceleration,
        &sample.effort,
        &sample.expected_effort,
        &sample.filtered_effort,
        &sample.filtered_expected_effort,
        &sample.residual,
    ];
    let mut values = values.into_iter().flat_map(|values| &values[..joints]);
    values.all(|value| value.is_finite())
}

impl Stage<TwinState, Detection> for Detect {
    fn accept(
        &mut self,
        sample: &TwinState,
        out: &mut dyn Emit<Detection>,
    ) -> Result<(), StageError> {
        let judgement = self.judge(sample);
        if let Some(fault) = self.detector.fault() {
            let detector = self.detector.name();
            return Err(StageError::Unfit(format!("{detector}: {fault}")));
        }
        let stamp_ns = sample.header.stamp_ns;
        let score = judgement.ready.then_some(judgement.score);
        let verdict = judgement.verdict.filter(|_| judgement.ready);
        let seen = verdict.and_then(|verdict| verdict.contact);
        let step = match &mut self.rule {
            Rule::Threshold(alarm) => alarm.step(stamp_ns, score),
            Rule::Own { events, .. } => events.step(
                verdict.map(|verdict| verdict.state),
                seen.map(|s| s.contact_ns),
            ),
        };
        let (usual, event, contact_ns) = match step {
            Step::Free => ("free", 0, None),
            Step::Onset { contact_ns } => ("contact", Detection::ONSET, Some(contact_ns)),
            Step::Contact { contact_ns } => ("contact", 0, Some(contact_ns)),
            Step::Offset => ("free", Detection::OFFSET, None),
        };
        let state = match verdict {
            Some(verdict) => verdict.state,
            None if judgement.ready || contact_ns.is_some() || event != 0 => usual,
            None => "not_ready",
        };
        let (joints, contact) = match contact_ns {
            Some(_) => self.isolate(sample, judgement.score, seen, event == Detection::ONSET),
            None => (0, None),
        };
        let details = self.detector.details().filter(|_| judgement.ready);
        out.emit(&mut |slot| {
            slot.header = sample.header;
            slot.header.flags = sample.header.flags & flags::RESET;
            if judgement.ready {
                slot.header.flags |= flags::READY;
            }
            slot.detector = self.name;
            slot.state = Name::new(state);
            slot.score = judgement.score;
            slot.threshold = self.rule.threshold();
            slot.joints = joints;
            slot.event = event;
            if let Some(contact_ns) = contact_ns {
                slot.header.flags |= flags::ALARM;
                slot.contact_ns = contact_ns;
            }
            if let Some(contact) = contact {
                self.tell_place(&contact, slot);
            }
            if let Some(details) = details {
                slot.header.flags |= flags::CONTENT;
                slot.content_n = details.content_n;
                if let Some([rise, motion]) = details.directions {
                    slot.header.flags |= flags::DIRECTIONS;
                    slot.rise_direction = rise;
                    slot.motion_direction = motion;
                }
            }
        })?;
        Ok(())
    }
}
