//! The states of a cell, with their descriptions and severities.

use serde::Serialize;

/// State of a cell. Only [`State::Running`] is good, and all of its conditions must hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum State {
    /// A latched alarm, which a person has to check.
    Stopped {
        /// Whether it is acknowledged; it then ends with the contact.
        acknowledged: bool,
    },
    /// Data that are too old.
    Stale {
        /// Start time \[ns since the epoch\].
        since_ns: i64,
        /// The missing data.
        why: StaleWhy,
    },
    /// An unknown state.
    Unknown {
        /// Reason.
        why: UnknownWhy,
    },
    /// A contact with the robot, according to a detector.
    Contact,
    /// A detector that is not ready.
    NotReady,
    /// An expected cell that has not connected since the fleet host started.
    NeverSeen,
    /// Alarms that cause no stop.
    Muted {
        /// End time by the clock of the fleet host \[ns since the epoch\].
        until_ns: i64,
    },
    /// A run that ended normally.
    Ended {
        /// End time \[ns since the epoch\].
        since_ns: i64,
    },
    /// Samples arrive, all detectors are ready, and there is no contact.
    Running,
}

/// Missing data of a stale cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StaleWhy {
    /// Its token: the process has ended, or its host is disconnected.
    Token,
    /// Its status: the process is hung, or its host is disconnected.
    Status,
    /// Samples: the publisher is connected, but its detectors are silent.
    Samples,
    /// All data: the fleet host itself is disconnected.
    Connection,
}

/// Reason for an unknown state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UnknownWhy {
    /// The cell is connected, but has not sent a status yet.
    NoStatus,
    /// The cell sends a status, but its publisher has no token.
    NoToken,
    /// Two publishers use this name.
    TwoPublishers,
}

/// Severity of a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// A person has to go to the robot.
    Critical,
    /// The robot is not monitored.
    Serious,
    /// A temporary or intended state.
    Notice,
    /// Normal operation.
    Good,
}

impl State {
    /// Returns its severity.
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

    /// Returns its name, the same word in JSON, metrics and the page.
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

    /// Returns its description for people, without times.
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

    /// Returns the reason and what to check; empty if the state needs no explanation.
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
            Self::Ended { .. } => "the run has ended normally",
            Self::Running => "",
        }
    }
}

impl State {
    /// Returns whether it is the same state, whatever its times.
    pub fn same_as(self, other: Self) -> bool {
        let why = |state: Self| match state {
            Self::Stale { why, .. } => Some(why),
            _ => None,
        };
        self.words() == other.words() && why(self) == why(other)
    }
}
