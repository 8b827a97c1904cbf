//! The states of a cell, in words and by how much they matter.

use serde::Serialize;

/// How a cell stands. There is one that is good, and it must be earned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum State {
    /// Somebody has to look: the alarm is latched.
    Stopped {
        /// Whether somebody has acknowledged it; then it ends with the contact.
        acknowledged: bool,
    },
    /// What is known is too old to hold.
    Stale {
        /// Since when \[ns since the epoch\].
        since_ns: i64,
        /// What is missing.
        why: StaleWhy,
    },
    /// Nothing certain is known.
    Unknown {
        /// Why.
        why: UnknownWhy,
    },
    /// Something touches the robot, or its detector calls it so.
    Contact,
    /// A detector cannot judge yet.
    NotReady,
    /// It is expected, but was not there since the fleet host started.
    NeverSeen,
    /// Alarms cause no stop.
    Muted {
        /// Until when, by the clock of the fleet host \[ns since the epoch\].
        until_ns: i64,
    },
    /// The run has ended in order.
    Ended {
        /// Since when \[ns since the epoch\].
        since_ns: i64,
    },
    /// Samples come, all detectors judge, nothing touches the robot.
    Running,
}

/// What is missing of a stale cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StaleWhy {
    /// Its token: the process has ended, or its host is cut off.
    Token,
    /// Its status: the process hangs, or its host is cut off.
    Status,
    /// Samples: the publisher lives, but its detectors say nothing.
    Samples,
    /// The fleet host itself reaches nobody.
    Connection,
}

/// Why nothing certain is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UnknownWhy {
    /// It lives, but has told no status yet.
    NoStatus,
    /// It tells a status, but its publisher's token is not there.
    NoToken,
    /// Two publishers call themselves by this name.
    TwoPublishers,
}

/// How much a state matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Somebody has to go there.
    Critical,
    /// Nobody watches the robot.
    Serious,
    /// It will pass, or is meant.
    Notice,
    /// All is well.
    Good,
}

impl State {
    /// How much it matters.
    pub fn severity(self) -> Severity {
        match self {
            Self::Stopped { .. } => Severity::Critical,
            Self::Stale { .. } | Self::Unknown { .. } | Self::NeverSeen => Severity::Serious,
            Self::Contact | Self::NotReady | Self::Muted { .. } | Self::Ended { .. } => {
                Severity::Notice
            }
            Self::Running => Severity::Good,
        }
    }

    /// Its name, one word: the same in JSON, metrics and the page.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stopped { .. } => "stopped",
            Self::Stale { .. } => "stale",
            Self::Unknown { .. } => "unknown",
            Self::Contact => "contact",
            Self::NotReady => "not_ready",
            Self::NeverSeen => "never_seen",
            Self::Muted { .. } => "muted",
            Self::Ended { .. } => "ended",
            Self::Running => "running",
        }
    }

    /// All names.
    pub const NAMES: [&'static str; 9] = [
        "stopped",
        "stale",
        "unknown",
        "contact",
        "not_ready",
        "never_seen",
        "muted",
        "ended",
        "running",
    ];

    /// For people, without times.
    pub fn words(self) -> &'static str {
        match self {
            Self::Stopped {
                acknowledged: false,
            } => "stopped by latch",
            Self::Stopped { acknowledged: true } => "stopped, acknowledged",
            Self::Stale { .. } => "stale",
            Self::Unknown { .. } => "unknown",
            Self::Contact => "contact",
            Self::NotReady => "not ready",
            Self::NeverSeen => "never seen",
            Self::Muted { .. } => "muted",
            Self::Ended { .. } => "ended",
            Self::Running => "running",
        }
    }

    /// Why, and what to look at; empty where the state says it all.
    pub fn reason(self) -> &'static str {
        match self {
            Self::Stopped {
                acknowledged: false,
            } => "a latched alarm waits for its acknowledgement",
            Self::Stopped { acknowledged: true } => "the contact is not over yet",
            Self::Stale { why, .. } => match why {
                StaleWhy::Token => "its process is gone, or its host is cut off",
                StaleWhy::Status => "no status: its process hangs, or its host is cut off",
                StaleWhy::Samples => "no samples: its detectors are silent",
                StaleWhy::Connection => "this fleet host reaches no router",
            },
            Self::Unknown { why } => match why {
                UnknownWhy::NoStatus => "it lives, but has told no status yet",
                UnknownWhy::NoToken => "a status came, but the token of its publisher is not there",
                UnknownWhy::TwoPublishers => "two publishers have this name",
            },
            Self::Contact => "something touches the robot",
            Self::NotReady => "a detector cannot judge yet",
            Self::NeverSeen => "expected, but not there since the fleet host started",
            Self::Muted { .. } => "alarms cause no stop",
            Self::Ended { .. } => "the run has ended in order",
            Self::Running => "",
        }
    }
}

impl State {
    /// Whether it is the same state, whatever its times.
    pub fn same_as(self, other: Self) -> bool {
        let why = |state: Self| match state {
            Self::Stale { why, .. } => Some(why),
            _ => None,
        };
        self.words() == other.words() && why(self) == why(other)
    }
}
