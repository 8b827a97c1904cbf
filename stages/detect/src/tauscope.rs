//! `tauscope`: the residual held against what it usually is.
//!
//! The noise of a residual is not the same in every joint, at every speed and over every length of time:
//! friction is least certain where a joint turns round, joints err together, and what is small beside
//! one sample is large beside the mean of thirty. All of that is learnt from contact-free recordings
//! ([`Learnt`]). The score is the largest, over three windows, of the Mahalanobis length of the mean residual, in
//! units of what that window's length reaches at most in one of a thousand contact-free samples. Slow drift (warming up)
//! is followed while nothing touches the robot.
//!
//! The threshold is set by a wish: so many false alarms an hour. How often the score exceeds what by chance is
//! extrapolated from its peaks in contact-free data ([`Tail`]).
//!
//! Where labels tell collisions from cooperations, what parts them is learnt, too ([`Kinds`]).
//!
//! The touched link is the one whose force explains the whitened residual best, the point of contact
//! sought along the link (Haddadin, De Luca and Albu-Schäffer, "Robot Collisions: A Survey on Detection,
//! Isolation, and Identification", 2017, sections V and VI).

mod kinds;
mod learnt;
mod place;
mod smallest;
mod tail;
mod windows;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};

use crate::config::ConfigError;
use crate::detector::{Detector, Judgement, Seen, Verdict};
use crate::lesson::{LearnError, Lessons};
use crate::rate::Rate;
use crate::stage::Setup;
pub use kinds::Kinds;
pub use learnt::{Learnt, LearntJoint, LearntWindow};
use nalgebra::Vector6;
use place::Place;
pub use smallest::Smallest;
pub use tail::Tail;
use windows::{Follow, Windows};

/// Canonical name.
pub(crate) const NAME: &str = "tauscope";

/// An alarm ends where the score has stayed below this share of the threshold.
const RELEASE: f64 = 0.35;
/// For so long \[s\].
const HOLD_S: f64 = 0.1;
/// Another contact on top of one: the residual changes by this many times the threshold against what it has been, which is
/// followed with this time constant, and grows (else it is a release); not sooner than this after the last alarm \[s\].
const CHANGE: f64 = 2.0;
/// Where no kinds are told apart, one contact may swell and still be one: the change must be this share of what it has been as well.
const SWELL: f64 = 0.5;
const FOLLOW_S: f64 = 0.15;
const AGAIN_S: f64 = 0.25;
/// Where kinds are told, the alarm waits so long for the force to show where it points \[s\].
const DECIDE_S: f64 = 0.012;
/// A score above this is not taken for drift: the unit, what one of a thousand contact-free samples exceeds.
const DRIFT: f64 = 1.0;
/// A score from this share of the threshold on may already belong to a contact.
const LOW: f64 = 0.3;

/// Settings of `tauscope`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// How many false alarms an hour are put up with; at most one a week is 0.006. Sets the threshold.
    #[schemars(range(min = 1e-6, max = 3600.0))]
    pub false_alarms_per_hour: f64,
    /// Time constant with which slow drift of the residual is followed \[s\].
    #[schemars(range(min = 1.0, max = 86_400.0))]
    pub drift_s: f64,
    /// The mean residual of so many seconds after each start is taken for an offset, in which nothing may touch
    /// the robot \[s\]; 0 for none.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub offset_from_first_s: f64,
    /// What contact-free recordings have taught; `tauscope evaluate` writes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learnt: Option<Learnt>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            false_alarms_per_hour: 5.0,
            drift_s: 20.0,
            offset_from_first_s: 0.0,
            learnt: None,
        }
    }
}

/// The detector.
///
/// # Errors
/// If nothing has been learnt, or for a robot with other joints.
pub(crate) fn build(settings: &Settings, setup: &Setup) -> Result<Box<dyn Detector>, ConfigError> {
    let Some(learnt) = &settings.learnt else {
        return Err(ConfigError::NotLearnt { detector: NAME });
    };
    if let Some(reason) = learnt.fault(&setup.joint_names) {
        return Err(ConfigError::LearntState {
            detector: NAME,
            reason,
        });
    }
    Ok(Box::new(Tauscope::new(learnt, settings, setup)))
}

/// Learns from contact-free stretches of all recordings, and what parts the kinds from the training recordings' contacts.
///
/// # Errors
/// If they hold too little.
pub fn learn(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
) -> Result<Settings, LearnError> {
    let mut learnt = Learnt::new(lessons, &setup.joint_names, settings.follow())?;
    learnt.smallest = smallest::smallest(&learnt, lessons, setup, settings.follow());
    learnt.kinds = kinds::learn(&learnt, settings, setup, lessons);
    Ok(Settings {
        learnt: Some(learnt),
        ..settings.clone()
    })
}

impl Settings {
    fn follow(&self) -> Follow {
        Follow {
            drift_s: self.drift_s,
            offset_from_first_s: self.offset_from_first_s,
        }
    }

    /// By link, the smallest force that is found at `false_alarms_per_hour`; empty before anything is learnt.
    pub fn smallest_forces(&self, false_alarms_per_hour: f64) -> Vec<Smallest> {
        let Some(learnt) = &self.learnt else {
            return Vec::new();
        };
        let factor = learnt.tail.threshold(false_alarms_per_hour).sqrt();
        let at = |of: &Smallest| Smallest {
            link: of.link.clone(),
            half_n: of.half_n.map(|force| force * factor),
            most_n: of.most_n.map(|force| force * factor),
        };
        learnt.smallest.iter().map(at).collect()
    }
}

struct Tauscope {
    rate: Rate,
    windows: Windows,
    place: Place,
    threshold: f64,
    alarm: Option<Alarm>,
    /// Newest sample whose score was usual.
    newest_low_ns: Option<i64>,
    /// The joints' velocity then \[rad/s\].
    velocity: JointArray,
    kinds: Option<Kinds>,
    tells_kinds: bool,
    /// When the score rose above the threshold, while the alarm waits.
    waits_since_ns: Option<i64>,
}

/// An alarm that lasts.
struct Alarm {
    /// What kinds are told by, and what was told, as it was raised.
    measurements: Option<Vector6<f64>>,
    state: &'static str,
    contact_ns: i64,
    raised_ns: i64,
    newest_high_ns: i64,
    newest_ns: i64,
}

impl Detector for Tauscope {
    fn name(&self) -> &'static str {
        NAME
    }

    fn threshold(&self) -> Option<f64> {
        Some(self.threshold)
    }

    fn fault(&self) -> Option<String> {
        self.rate.fault()
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        self.rate.update(sample);
        if sample.header.has(flags::RESET) {
            self.windows.reset();
            self.alarm = None;
            self.newest_low_ns = None;
            self.waits_since_ns = None;
        }
        let free = self.alarm.is_none();
        // Whatever raises no alarm and is not far from usual may be drift.
        let drifts = free.then_some(self.threshold.min(DRIFT));
        let score = self.windows.score(sample, drifts);
        let ready = self.windows.ready() && sample.header.has(flags::READY);
        if !ready {
            self.alarm = None;
            self.waits_since_ns = None;
            return Judgement {
                score,
                ready,
                verdict: None,
            };
        }
        let raised_ns = self.alarm.as_ref().map(|alarm| alarm.raised_ns);
        let contact_ns = self.step(sample.header.stamp_ns, score);
        if score < LOW * self.threshold || raised_ns.is_some() {
            self.velocity = sample.velocity;
        }
        let contact = contact_ns.map(|contact_ns| {
            let touch = self.place.locate(sample, &self.windows, &self.velocity);
            if let Some(alarm) = &mut self.alarm
                && raised_ns != Some(alarm.raised_ns)
            {
                alarm.measurements = touch.as_ref().map(kinds::measurements);
                if let (Some(kinds), Some(seen)) = (&self.kinds, &alarm.measurements) {
                    alarm.state = kinds::classify(kinds, seen);
                }
            }
            Seen {
                contact_ns,
                joints: Some(Place::loaded(&self.windows)),
                place: touch.map(|touch| touch.contact),
            }
        });
        Judgement {
            score,
            ready,
            verdict: Some(Verdict {
                state: self.alarm.as_ref().map_or("free", |alarm| alarm.state),
                contact,
            }),
        }
    }
}

impl Tauscope {
    fn new(learnt: &Learnt, settings: &Settings, setup: &Setup) -> Self {
        Self {
            rate: Rate::new(learnt.rate_hz),
            windows: Windows::new(learnt, settings.follow()),
            place: Place::new(setup),
            threshold: learnt.tail.threshold(settings.false_alarms_per_hour),
            alarm: None,
            newest_low_ns: None,
            velocity: [0.0; MAX_JOINTS],
            kinds: learnt.kinds,
            tells_kinds: learnt.kinds.is_some(),
            waits_since_ns: None,
        }
    }

    /// Takes the next score; gives the beginning of the contact, if there is one.
    fn step(&mut self, now_ns: i64, score: f64) -> Option<i64> {
        let high = score >= self.threshold;
        let ns = |seconds: f64| (seconds * 1e9) as i64;
        match &mut self.alarm {
            None if high || self.waits_since_ns.is_some() => {
                let since_ns = *self.waits_since_ns.get_or_insert(now_ns);
                if score < RELEASE * self.threshold {
                    self.waits_since_ns = None;
                } else if !self.tells_kinds || now_ns - since_ns >= ns(DECIDE_S) {
                    self.waits_since_ns = None;
                    self.windows.begin(false);
                    self.alarm = Some(Alarm {
                        measurements: None,
                        state: "contact",
                        contact_ns: self.newest_low_ns.unwrap_or(now_ns),
                        raised_ns: now_ns,
                        newest_high_ns: now_ns,
                        newest_ns: now_ns,
                    });
                }
            }
            None => {}
            Some(alarm) => {
                if score >= RELEASE * self.threshold {
                    alarm.newest_high_ns = now_ns;
                }
                let dt_s = (now_ns - alarm.newest_ns) as f64 * 1e-9;
                alarm.newest_ns = now_ns;
                let swell = if self.tells_kinds { 0.0 } else { SWELL };
                let again = now_ns - alarm.raised_ns > ns(AGAIN_S)
                    && high
                    && self.windows.grows()
                    && self.windows.change()
                        > (CHANGE * self.threshold).max(swell * self.windows.held());
                if again {
                    alarm.contact_ns = now_ns;
                    alarm.raised_ns = now_ns;
                    self.windows.begin(true);
                } else {
                    let share = 1.0 - (-dt_s / FOLLOW_S).exp();
                    self.windows.hold(share);
                }
                if now_ns - alarm.newest_high_ns >= ns(HOLD_S) {
                    self.alarm = None;
                }
            }
        }
        if score < LOW * self.threshold || self.newest_low_ns.is_none() {
            self.newest_low_ns = Some(now_ns);
        }
        self.alarm.as_ref().map(|alarm| alarm.contact_ns)
    }
}
