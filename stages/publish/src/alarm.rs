//! States of an alarm: a pure state machine over detections and commands. Time is that of the samples.
//!
//! ```text
//!              contact begins                     collision begins
//!     free ───────────────────▶ contact    (any) ─────────────────▶ collision, which stays
//!       ▲                          │                                     │
//!       └──────────────────────────┘                  acknowledge, while │ acknowledge,
//!       ▲        contact ends                       the contact lasts    │ when it is over
//!       │                                                  ▼             │
//!       └───────────────────────────────────────────  acknowledged       │
//!       │                 contact ends                                   │
//!       └────────────────────────────────────────────────────────────────┘
//! ```
//!
//! - A collision is latched: it never ends by itself.
//! - A collision that begins after the acknowledgement is a new one.
//! - While muted, contacts and collisions raise no stop, and none is latched. An earlier latch stays. A collision
//!   that still lasts when the lease ends is latched then.
//! - The alarm is not free before every detector has judged a sample, nor while one cannot judge.

use tauscope_bus::command::MuteLease;
use tauscope_bus::{Command, Detection, Verb, flags};

use crate::config::Latch;

/// Maximum number of commands that wait for the detections of their instant.
const MAX_WAITING: usize = 64;

/// States of an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// A detector cannot judge, or has not sent a detection yet.
    NotReady,
    /// Nothing touches the robot.
    Free,
    /// Something touches it.
    Contact,
    /// It has collided, and the collision is not acknowledged.
    Collision,
    /// The collision is acknowledged, but not over yet.
    Acknowledged,
}

/// States of the latch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Latched {
    No,
    Unseen,
    Acknowledged,
}

/// Newest verdict of a detector.
#[derive(Debug, Clone, Copy, Default)]
struct View {
    ready: bool,
    alarm: bool,
    latches: bool,
}

/// The alarm of one cell.
#[derive(Debug)]
pub struct Alarm {
    latch: Latch,
    views: Vec<View>,
    latched: Latched,
    lease: Option<MuteLease>,
    /// Commands that wait, ordered by stamp.
    waiting: Vec<(i64, Command)>,
    now_ns: i64,
}

impl Alarm {
    /// Creates the alarm of a cell with this number of detectors. After a restart the earlier latch is unknown, so
    /// the alarm begins with a collision that must be acknowledged.
    pub fn new(latch: Latch, detectors: usize, restarted: bool) -> Self {
        Self {
            latch,
            views: vec![View::default(); detectors],
            latched: if restarted {
                Latched::Unseen
            } else {
                Latched::No
            },
            lease: None,
            waiting: Vec::new(),
            now_ns: 0,
        }
    }

    /// Takes a command. It takes effect at the first detection with the stamp `stamp_ns` or a later one, whichever of
    /// the two streams arrives first.
    pub fn command(&mut self, stamp_ns: i64, command: Command) {
        if self.waiting.len() == MAX_WAITING {
            self.waiting.remove(0);
        }
        let at = self.waiting.partition_point(|(at, _)| *at <= stamp_ns);
        self.waiting.insert(at, (stamp_ns, command));
    }

    /// Takes a detection of detector number `detector`.
    pub fn detection(&mut self, detector: usize, detection: &Detection) {
        let header = &detection.header;
        self.now_ns = header.stamp_ns;
        if header.has(flags::RESET) {
            // The lease refers to the clock before the reset.
            self.lease = None;
        }
        while self
            .waiting
            .first()
            .is_some_and(|(at, _)| *at <= header.stamp_ns)
        {
            let (stamp_ns, command) = self.waiting.remove(0);
            self.carry_out(stamp_ns, &command);
        }
        let alarm = detection.alarm() && !header.has(flags::CHANGE);
        let now = View {
            ready: header.has(flags::READY),
            alarm,
            latches: alarm
                && (self.latch == Latch::Contact || detection.state.as_str() == "collision"),
        };
        let Some(view) = self.views.get_mut(detector) else {
            return;
        };
        let begins = now.latches && !view.latches;
        *view = now;
        if now.latches && !self.is_muted() && (begins || self.latched == Latched::No) {
            self.latched = Latched::Unseen;
        }
        if self.latched == Latched::Acknowledged && !self.in_contact() {
            self.latched = Latched::No;
        }
    }

    fn carry_out(&mut self, stamp_ns: i64, command: &Command) {
        match command.verb() {
            Some(Verb::Acknowledge) if self.latched == Latched::Unseen => {
                self.latched = if self.in_contact() {
                    Latched::Acknowledged
                } else {
                    Latched::No
                };
            }
            _ => self.lease = MuteLease::of(stamp_ns, command).or(self.lease),
        }
    }

    /// Whether a detector sees a contact now, muted or not.
    pub fn in_contact(&self) -> bool {
        self.views.iter().any(|view| view.alarm)
    }

    /// Returns the state of the alarm.
    pub fn state(&self) -> State {
        match self.latched {
            Latched::Unseen => State::Collision,
            Latched::Acknowledged => State::Acknowledged,
            Latched::No if self.in_contact() => State::Contact,
            Latched::No if self.views.iter().all(|view| view.ready) => State::Free,
            Latched::No => State::NotReady,
        }
    }

    /// Whether the robot may move according to the detections.
    pub fn is_free(&self) -> bool {
        match self.state() {
            State::Free => true,
            State::Contact => self.is_muted(),
            State::NotReady | State::Collision | State::Acknowledged => false,
        }
    }

    /// Returns the remaining time of a mute \[s\]; 0 without one.
    pub fn muted_s(&self) -> f64 {
        let left_ns = self.lease.map_or(0, |lease| lease.left_ns(self.now_ns));
        left_ns as f64 * 1e-9
    }

    fn is_muted(&self) -> bool {
        self.muted_s() > 0.0
    }

    /// Returns the stamp of the newest detection \[ns since the epoch\].
    pub fn now_ns(&self) -> i64 {
        self.now_ns
    }
}

#[cfg(test)]
mod tests;
