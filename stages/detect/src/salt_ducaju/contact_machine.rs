//! Contact detection after Salt Ducaju et al., Algorithm 1: the start of a contact and its directions. A [`Rule`]
//! classifies the contact.
//!
//! Points that the paper leaves open, and their solution here:
//!
//! - *Contact time*, "a backwards search in the external force signal": the force along the direction rises from its
//!   last trough before the detection; oscillations smaller than half a threshold ([`SWING`]) are not a trough. The
//!   contact starts where the force has completed the share [`BEGUN`] of this rise. Both signs are evaluated, and the
//!   larger rise is used.
//! - *Derivative of the force*: its change from the contact time to the detection. Only its direction
//!   matters, and a difference over the whole rise has the least noise.
//! - *Collision to free*: when no norm is above the threshold, as the paper defines it for cooperation. In both cases
//!   this must last for [`MachineSettings::release_s`]; otherwise a force that is leaving the window could start the
//!   contact again.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::TwinState;

use crate::frame::{Contact, ContactKind, Details, Detector, Judgement, Seen, Tap, Verdict};
use crate::salt_ducaju::contact_signals::{Instant, SignalSettings, Signals};
use crate::salt_ducaju::sliding_dft::BandError;

/// Fall of the force, as a share of the threshold, that separates one rise from another.
/// Tuned: on the training recordings of the practice set of assembly (docs/papers.md); not swept.
const SWING: f64 = 0.5;
/// Share of its rise at which a contact has started.
/// Tuned: on the training recordings of the practice set of assembly (docs/papers.md); not swept.
const BEGUN: f64 = 0.15;

/// Start and end of a contact, common to the detectors after Salt Ducaju et al.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MachineSettings {
    /// Norm above which there is a contact (`F_th`) \[N\].
    #[schemars(range(min = 0.0))]
    pub force_threshold_n: f64,
    /// Time without a norm above the threshold after which a contact has ended \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub release_s: f64,
}

impl Default for MachineSettings {
    fn default() -> Self {
        Self {
            force_threshold_n: 0.85,
            // One time constant of the observer.
            release_s: 0.01,
        }
    }
}

/// A newly detected contact, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewContact {
    /// Start \[ns since the epoch\], along the direction with the largest norm.
    pub contact_ns: i64,
    /// Change of the external force since the start \[N\].
    pub rise_n: [f64; 3],
    /// Velocity of the tool at the start \[m/s\].
    pub velocity_m_per_s: [f64; 3],
    /// By direction, if it detects the contact: the force's change since the start of its rise \[N\], and the
    /// tool's velocity at that time \[m/s\].
    pub along: [Option<(f64, f64)>; 3],
}

/// Distinguishes collisions from cooperations.
pub trait Rule: Send {
    /// Returns the kind of the contact.
    fn classify(&mut self, contact: &NewContact) -> ContactKind;
}

/// State of the machine: kind and start of the current contact \[ns since the epoch\]; `None` in free motion.
pub type Ongoing = Option<(ContactKind, i64)>;

/// Algorithm 1. No allocation per sample.
#[derive(Debug, Clone)]
pub struct Machine {
    settings: MachineSettings,
    release_ns: i64,
    /// The window's instants as a ring.
    past: Vec<Instant>,
    newest: usize,
    length: usize,
    ongoing: Ongoing,
    /// The newest detected contact.
    contact: Option<NewContact>,
    /// Directions of the current collision.
    active: [bool; 3],
    /// Newest stamp with a norm above the threshold.
    high_ns: i64,
}

impl Machine {
    /// Creates a machine in free motion that searches back through `window` instants.
    pub fn new(settings: &MachineSettings, window: usize) -> Self {
        let nothing = Instant {
            stamp_ns: 0,
            force_n: [0.0; 3],
            norms_n: [0.0; 3],
            velocity_m_per_s: [0.0; 3],
            point_m: [0.0; 3],
        };
        Self {
            settings: *settings,
            release_ns: (settings.release_s * 1e9) as i64,
            past: vec![nothing; window.max(2)],
            newest: 0,
            length: 0,
            ongoing: None,
            contact: None,
            active: [false; 3],
            high_ns: 0,
        }
    }

    /// Returns to free motion and discards the history.
    pub fn reset(&mut self) {
        self.length = 0;
        self.ongoing = None;
        self.active = [false; 3];
    }

    /// Processes the next instant; a repeated instant changes nothing.
    pub fn step(&mut self, instant: &Instant, rule: &mut dyn Rule) -> Ongoing {
        if self.length > 0 && self.past(0).stamp_ns == instant.stamp_ns {
            return self.ongoing;
        }
        self.newest = (self.newest + 1) % self.past.len();
        self.past[self.newest] = *instant;
        self.length = (self.length + 1).min(self.past.len());
        // Equation 4.
        let above = instant
            .norms_n
            .map(|norm| norm > self.settings.force_threshold_n);
        if above.contains(&true) {
            self.high_ns = instant.stamp_ns;
        }
        let new = match self.ongoing {
            Some((ContactKind::Cooperation, _)) => [false; 3],
            _ => std::array::from_fn(|i| above[i] && !self.active[i]),
        };
        if new.contains(&true) {
            let contact = self.contact(instant, new);
            let kind = rule.classify(&contact);
            self.ongoing = Some((kind, contact.contact_ns));
            self.contact = Some(contact);
        }
        let collides = matches!(self.ongoing, Some((ContactKind::Collision, _)));
        self.active = above.map(|above| above && collides);
        if instant.stamp_ns - self.high_ns > self.release_ns {
            self.ongoing = None;
        }
        self.ongoing
    }

    /// Returns the intermediate results of the newest instant.
    pub(crate) fn details(&self) -> Option<Details> {
        (self.length > 0).then(|| Details {
            content_n: self.past(0).norms_n,
            directions: (self.contact.filter(|_| self.ongoing.is_some()))
                .map(|contact| [contact.rise_n, contact.velocity_m_per_s].map(unit)),
        })
    }

    /// Returns the instant `back` steps before the newest one.
    fn past(&self, back: usize) -> &Instant {
        &self.past[(self.newest + self.past.len() - back) % self.past.len()]
    }

    /// Returns the contact that the directions `new` detect at the newest instant.
    fn contact(&self, now: &Instant, new: [bool; 3]) -> NewContact {
        let mut along = [None; 3];
        let (mut began, mut largest) = (0, 0.0);
        for i in (0..3).filter(|&i| new[i]) {
            let (back, rise_n) = self.began(i);
            along[i] = Some((rise_n, self.past(back).velocity_m_per_s[i]));
            if now.norms_n[i] > largest {
                (began, largest) = (back, now.norms_n[i]);
            }
        }
        let then = self.past(began);
        NewContact {
            contact_ns: then.stamp_ns,
            rise_n: std::array::from_fn(|i| now.force_n[i] - then.force_n[i]),
            velocity_m_per_s: then.velocity_m_per_s,
            along,
        }
    }

    /// Returns the number of instants since the force along a direction started to rise, and its signed change since
    /// then \[N\].
    fn began(&self, axis: usize) -> (usize, f64) {
        let swing = SWING * self.settings.force_threshold_n;
        let mut best = (0, 0.0_f64);
        for sense in [1.0, -1.0] {
            let force = |back: usize| sense * self.past(back).force_n[axis];
            let (mut trough, mut low) = (0, force(0));
            for back in 1..self.length {
                if force(back) < low {
                    (trough, low) = (back, force(back));
                } else if force(back) > low + swing {
                    break;
                }
            }
            let top = (0..=trough).max_by(|&a, &b| force(a).total_cmp(&force(b)));
            let top = top.unwrap_or(0);
            let rise = force(top) - low;
            if rise > best.1.abs() {
                let begun = low + BEGUN * rise;
                let back = (top..=trough).find(|&back| force(back) <= begun);
                best = (back.unwrap_or(trough), sense * rise);
            }
        }
        best
    }
}

/// Returns the unit vector; zeros for a vector without length.
pub(crate) fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    vector.map(|x| if length > 0.0 { x / length } else { 0.0 })
}

/// A detector composed of the signals, Algorithm 1 and a rule.
pub(crate) struct ContactDetector<R> {
    name: &'static str,
    signals: Tap<Signals>,
    tool_link: usize,
    fault: Option<BandError>,
    machine: Machine,
    rule: R,
}

impl<R: Rule> ContactDetector<R> {
    pub fn new(
        name: &'static str,
        mut signals: Tap<Signals>,
        settings: (&SignalSettings, &MachineSettings),
        rule: R,
    ) -> Self {
        Self {
            name,
            tool_link: signals.with(|signals| signals.tool_link()),
            signals,
            fault: None,
            machine: Machine::new(settings.1, settings.0.window),
            rule,
        }
    }
}

/// Returns the judgement of a detector with these signals.
pub(crate) fn judgement(instant: Option<&Instant>, ongoing: Ongoing, link: usize) -> Judgement {
    let Some(instant) = instant else {
        return Judgement {
            score: 0.0,
            ready: false,
            verdict: None,
        };
    };
    let place = Contact {
        link,
        other_link: None,
        force_n: instant.force_n,
        point_m: instant.point_m,
    };
    Judgement {
        score: instant.largest_norm_n(),
        ready: true,
        verdict: Some(Verdict {
            state: match ongoing {
                None => "free",
                Some((ContactKind::Contact, _)) => "contact",
                Some((ContactKind::Collision, _)) => "collision",
                Some((ContactKind::Cooperation, _)) => "cooperation",
            },
            contact: ongoing.map(|(_, contact_ns)| Seen {
                contact_ns,
                joints: None,
                place: Some(place),
            }),
        }),
    }
}

impl<R: Rule> Detector for ContactDetector<R> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let (instant, fault) =
            (self.signals).with(|signals| (signals.update(sample), signals.fault()));
        self.fault = fault;
        let ongoing = if let Some(instant) = &instant {
            self.machine.step(instant, &mut self.rule)
        } else {
            self.machine.reset();
            None
        };
        judgement(instant.as_ref(), ongoing, self.tool_link)
    }

    fn threshold(&self) -> Option<f64> {
        Some(self.machine.settings.force_threshold_n)
    }

    fn details(&self) -> Option<Details> {
        self.machine.details()
    }

    fn fault(&self) -> Option<String> {
        self.fault.map(|fault| fault.to_string())
    }
}
