//! Findings: what is odd or wrong about recordings, typed, with one text for all commands.

mod velocity_words;
mod words;

use std::fmt;

use serde::Serialize;
use tauscope_archive::{NotFinite, Twice};

use crate::publisher::Publisher;
use crate::suggest;

/// Consequence of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effect {
    /// Everything is used.
    Note,
    /// Messages are refused; a command that reads them ends with exit code 3.
    Loss,
    /// Nothing that is learnt from the recording can be right.
    Fault,
}

/// The recorded velocity of a joint that moves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OddVelocity {
    /// The joint.
    pub joint: String,
    /// Recorded velocity over the derivative of the position.
    pub slope: f64,
    /// The velocity, where all messages give the same \[rad/s or m/s\].
    pub constant: Option<f64>,
}

/// Number and times of messages with a fault. Times are seconds from the first message of the topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Times {
    /// Number of messages.
    pub messages: u64,
    /// Number of runs of consecutive messages.
    pub runs: u64,
    /// Times at which the runs begin \[s\]; the first few.
    pub starts_s: Vec<f64>,
    /// Time of the last message \[s\].
    pub last_s: f64,
}

/// `1 message at 3.200 s`, `12 messages from 3.200 s to 3.310 s`, or `12 single messages between 0.190 s and 10.950 s (the
/// first at 0.190, 1.230 and 2.040 s)`.
impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            messages,
            runs,
            starts_s,
            last_s,
        } = self;
        let first_s = starts_s.first().copied().unwrap_or_default();
        match (messages, runs) {
            (1, _) => return write!(f, "1 message at {first_s:.3} s"),
            (_, 1) => {
                return write!(
                    f,
                    "{messages} messages from {first_s:.3} s to {last_s:.3} s"
                );
            }
            _ if messages == runs => write!(f, "{messages} single messages")?,
            _ => write!(f, "{messages} messages")?,
        }
        let starts: Vec<String> = starts_s.iter().map(|at_s| format!("{at_s:.3}")).collect();
        let starts = starts.join(", ");
        write!(
            f,
            " between {first_s:.3} s and {last_s:.3} s (first at {starts} s)"
        )
    }
}

/// One thing that is odd or wrong about a recording. Times are seconds from the first message of the topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "finding", rename_all = "snake_case")]
pub enum Finding {
    /// Several publishers send joint states on the topic.
    Publishers {
        /// The topic; none of a live source.
        topic: Option<String>,
        /// The publishers whose messages are used.
        used: Vec<Publisher>,
        /// The publishers whose messages are not used.
        ignored: Vec<Publisher>,
    },
    /// All stamps are equal.
    ConstantStamps {
        /// The stamp \[ns since the epoch\].
        stamp_ns: i64,
        /// Number of messages in the head of the recording.
        messages: u64,
        /// Whether the time of recording replaces the stamps.
        is_replaced: bool,
    },
    /// Several messages share one stamp.
    CoarseStamps {
        /// Resolution of the stamps \[s\].
        resolution_s: f64,
        /// Mean number of messages with one stamp.
        messages_per_stamp: f64,
        /// Whether the recording has a time of recording.
        has_log_times: bool,
        /// Whether the time of recording replaces the stamps.
        is_replaced: bool,
    },
    /// The stamps count another unit than seconds and nanoseconds.
    ScaledStamps {
        /// Duration by the stamps over duration by the time of recording.
        ratio: f64,
    },
    /// Stamps that jump back.
    JumpsBack {
        /// When, and by how much \[s\]; the first few.
        jumps: Vec<(f64, f64)>,
        /// Number of jumps.
        count: u64,
        /// Messages behind a jump that are not used.
        refused: u64,
    },
    /// Messages that arrived after a newer one.
    LateMessages {
        /// Number of messages.
        messages: u64,
    },
    /// Messages with other values under the stamp of the message before.
    StalledStamps {
        /// Number of messages.
        messages: u64,
    },
    /// Values that are NaN or infinite.
    NotFinite {
        /// The joint.
        joint: String,
        /// Field, count and times.
        #[serde(flatten)]
        values: NotFinite,
    },
    /// Finite values that no measurement gives.
    Impossible {
        /// The joint.
        joint: String,
        /// `position`, `velocity` or `effort`.
        field: &'static str,
        /// The value furthest from the others.
        example: f64,
        /// A subnormal value, where there is one.
        subnormal: Option<f64>,
        /// The messages with such values.
        #[serde(flatten)]
        times: Times,
        /// Number of all messages of the topic.
        of_messages: u64,
        /// Magnitude that nine of ten values of this joint stay below.
        usual: f64,
    },
    /// An effort that drops to exactly zero.
    Dropouts {
        /// The joint.
        joint: String,
        /// The messages with such efforts.
        #[serde(flatten)]
        times: Times,
    },
    /// A joint that a message names more than once.
    NamedTwice(Twice),
    /// Messages that lack a joint for long: one of several publishers has ceased.
    MissingParts {
        /// Number of messages.
        messages: u64,
    },
    /// Messages without positions.
    NoPositions {
        /// Number of messages.
        messages: u64,
    },
    /// Messages that repeat an earlier message.
    Copies {
        /// Number of messages.
        messages: u64,
    },
    /// Messages that cannot be decoded.
    Undecodable {
        /// Number of messages for each reason; the first few reasons.
        reasons: Vec<(String, u64)>,
    },
    /// Efforts that are zero in all messages.
    ZeroEffort {
        /// The joints.
        joints: Vec<String>,
        /// Whether these are all joints.
        all: bool,
    },
    /// Positions in degrees.
    Degrees {
        /// The joints.
        joints: Vec<String>,
    },
    /// A position beyond the limits of the robot file.
    BeyondLimits {
        /// The joint.
        joint: String,
        /// The position furthest beyond \[rad or m\].
        position: f64,
        /// The limits \[rad or m\].
        limits: [f64; 2],
    },
    /// Velocities that are not the derivative of the positions.
    Velocity {
        /// The joints.
        joints: Vec<OddVelocity>,
        /// Whether these are all joints.
        all: bool,
        /// Whether velocities computed from the positions are used instead.
        is_replaced: bool,
    },
    /// No message has a velocity.
    NoVelocity,
    /// A position that changes by more than its velocity explains.
    Jump {
        /// The joint.
        joint: String,
        /// Sentence of [`JointFacts::jump_remark`](tauscope_archive::JointFacts::jump_remark).
        remark: String,
    },
    /// The longest pause.
    Pause {
        /// Duration \[s\].
        duration_s: f64,
        /// Time of its beginning \[s\].
        at_s: f64,
    },
    /// A remark of the format, such as how the columns of a table were recognised.
    Format {
        /// The sentence.
        remark: String,
    },
}

impl Finding {
    /// Consequence of the finding.
    pub fn effect(&self) -> Effect {
        match self {
            Self::ZeroEffort { all: true, .. }
            | Self::Degrees { .. }
            | Self::ConstantStamps {
                is_replaced: false, ..
            }
            | Self::CoarseStamps {
                is_replaced: false, ..
            } => Effect::Fault,
            Self::JumpsBack { refused: 0, .. } => Effect::Note,
            Self::JumpsBack { .. }
            | Self::LateMessages { .. }
            | Self::StalledStamps { .. }
            | Self::NotFinite { .. }
            | Self::Impossible { .. }
            | Self::Dropouts { .. }
            | Self::NamedTwice(_)
            | Self::MissingParts { .. }
            | Self::NoPositions { .. }
            | Self::Undecodable { .. } => Effect::Loss,
            _ => Effect::Note,
        }
    }

    /// Subject of the finding: of two findings with one subject, a live source reports the first only.
    pub fn subject(&self) -> String {
        let kind = match self {
            Self::ZeroEffort { .. } => "effort",
            Self::Degrees { .. } => "degrees",
            Self::Pause { .. } => "pause",
            Self::BeyondLimits { .. } => "limits",
            Self::Velocity { .. } => "velocity",
            Self::Jump { .. } => "jump",
            other => return other.to_string(),
        };
        match self {
            Self::BeyondLimits { joint, .. } | Self::Jump { joint, .. } => {
                format!("{kind} of {joint}")
            }
            _ => kind.to_owned(),
        }
    }
}

/// A sentence for each finding of several recordings; recordings with the same finding share one.
pub fn by_recording(all: &[(String, Vec<Finding>)]) -> Vec<String> {
    let texts = all.iter().flat_map(|(name, findings)| {
        let texts = findings.iter().map(ToString::to_string);
        texts.map(move |text| (name.clone(), text))
    });
    let shared = shared(texts, all.len()).into_iter();
    shared.map(|(of, text)| format!("{of}: {text}.")).collect()
}

/// Texts about `count` recordings, by name, in the order in which they first occur: the recordings with the same text, and
/// the text.
pub(crate) fn shared(
    texts: impl Iterator<Item = (String, String)>,
    count: usize,
) -> Vec<(String, String)> {
    let mut by_text: Vec<(String, Vec<String>)> = Vec::new();
    for (name, text) in texts {
        match by_text.iter_mut().find(|(known, _)| *known == text) {
            Some((_, names)) => names.push(name),
            None => by_text.push((text, vec![name])),
        }
    }
    let named = by_text.into_iter().map(|(text, names)| {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let of = if names.len() > 1 && names.len() == count {
            format!("all {count} recordings")
        } else {
            suggest::some(&names)
        };
        (of, text)
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_messages_are_distinguished_from_a_run() {
        let times = |messages, runs, starts_s: &[f64]| Times {
            messages,
            runs,
            starts_s: starts_s.to_vec(),
            last_s: 9.0,
        };
        for (times, words) in [
            (times(1, 1, &[3.0]), "1 message at 3.000 s"),
            (times(12, 1, &[3.0]), "12 messages from 3.000 s to 9.000 s"),
            (
                times(12, 12, &[3.0, 4.0, 5.0]),
                "12 single messages between 3.000 s and 9.000 s (first at 3.000, 4.000, 5.000 s)",
            ),
            (
                times(12, 2, &[3.0, 8.0]),
                "12 messages between 3.000 s and 9.000 s (first at 3.000, 8.000 s)",
            ),
        ] {
            assert_eq!(times.to_string(), words);
        }
    }

    #[test]
    fn jumps_by_the_same_step_share_its_number_and_recordings_share_a_sentence() {
        let jumps = |jumps: &[(f64, f64)]| Finding::JumpsBack {
            jumps: jumps.to_vec(),
            count: jumps.len() as u64,
            refused: 7,
        };
        let same = jumps(&[(12.0, 11.99), (24.0, 11.99)]);
        let text = "the stamps jump back by 11.990 s at 12.000 s and at 24.000 s after the start. ";
        assert!(same.to_string().starts_with(text), "{same}");
        let other = jumps(&[(12.0, 11.99), (24.0, 3.0)]);
        let text = "the stamps jump back by 11.990 s at 12.000 s and by 3.000 s at 24.000 s after";
        assert!(other.to_string().starts_with(text), "{other}");
        let all = ["a", "b"].map(|name| (name.to_owned(), vec![same.clone()]));
        let [sentence] = &by_recording(&all)[..] else {
            panic!("one for both")
        };
        assert!(
            sentence.starts_with("all 2 recordings: the stamps"),
            "{sentence}"
        );
    }

    #[test]
    fn joints_with_the_same_velocity_share_a_clause() {
        let odd = |joint: &str, constant| OddVelocity {
            joint: joint.to_owned(),
            slope: 0.0,
            constant: Some(constant),
        };
        let finding = |joints: [OddVelocity; 2]| Finding::Velocity {
            joints: joints.to_vec(),
            all: true,
            is_replaced: false,
        };
        let text = finding([odd("a", 0.0), odd("b", 0.0)]).to_string();
        let all = "the recorded velocity of all 2 joints is 0 in every message although they move";
        assert!(text.starts_with(all), "{text}");
        let text = finding([odd("a", 0.0), odd("b", 1.5)]).to_string();
        let each = "of a is 0 in every message although it moves, and of b is 1.5 in every";
        assert!(text.contains(each), "{text}");
    }
}
