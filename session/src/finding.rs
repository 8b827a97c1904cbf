//! Findings: what is odd or wrong about recordings, typed, with one text for all commands.

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

impl OddVelocity {
    fn words(&self) -> String {
        match self.constant {
            Some(value) => format!("is constant, {value}, while the joint moves"),
            None if self.slope.abs() < FOLLOWS => "does not follow the position".to_owned(),
            None => format!("is {:.2} times the derivative of the position", self.slope),
        }
    }
}

/// One thing that is odd or wrong about a recording. Times are seconds from the first message of the topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "finding", rename_all = "snake_case")]
pub enum Finding {
    /// Several publishers send joint states on the topic.
    Publishers {
        /// The publishers whose messages are used.
        used: Vec<Publisher>,
        /// The publishers whose messages are not used.
        ignored: Vec<Publisher>,
    },
    /// All stamps are equal.
    ConstantStamps {
        /// The stamp \[ns since the epoch\].
        stamp_ns: i64,
        /// Number of messages that were looked at.
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
        /// Number of messages.
        messages: u64,
        /// Time of the first such value \[s\].
        first_s: f64,
        /// Time of the last such value \[s\].
        last_s: f64,
        /// Magnitude that nine of ten values of this joint stay below.
        usual: f64,
    },
    /// An effort that drops to exactly zero.
    Dropouts {
        /// The joint.
        joint: String,
        /// Number of messages.
        messages: u64,
        /// Number of separate drops.
        drops: u64,
        /// Time of the first \[s\].
        first_s: f64,
        /// Time of the last \[s\].
        last_s: f64,
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
        /// Whether velocities computed from the positions are used instead.
        is_replaced: bool,
    },
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

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Publishers { used, ignored } => publishers(f, used, ignored),
            Self::ConstantStamps { .. }
            | Self::CoarseStamps { .. }
            | Self::ScaledStamps { .. }
            | Self::JumpsBack { .. }
            | Self::LateMessages { .. }
            | Self::StalledStamps { .. } => self.of_time(f),
            Self::NotFinite { joint, values } => {
                write!(f, "{}: not used", values.in_words(joint))
            }
            Self::Impossible { .. } | Self::Dropouts { .. } => self.of_values(f),
            Self::NamedTwice(twice) => write!(
                f,
                "{twice}: not used, because it is not known which value holds; let the driver send each joint once"
            ),
            Self::MissingParts { messages } => write!(
                f,
                "{} not used: no message named the other joints for more than 0.5 s",
                are(*messages)
            ),
            Self::NoPositions { messages } => write!(
                f,
                "{} not used: a joint state without positions; record the topic that has positions and efforts",
                are(*messages)
            ),
            Self::Copies { messages } => write!(
                f,
                "{messages} messages are copies of earlier ones: two relays or bridges deliver each; nothing is lost"
            ),
            Self::Undecodable { reasons } => {
                let reasons = reasons.iter();
                let reasons: Vec<String> = reasons
                    .map(|(reason, count)| format!("{} not used: {reason}", are(*count)))
                    .collect();
                f.write_str(&reasons.join("; "))
            }
            Self::ZeroEffort { all: true, .. } => {
                f.write_str("the effort is zero throughout: the driver does not publish it")
            }
            Self::ZeroEffort { joints, .. } => write!(
                f,
                "the effort of {} is zero throughout: the driver does not publish it",
                suggest::some(&names(joints))
            ),
            Self::Degrees { joints } => write!(
                f,
                "the positions of {} are in degrees: publish radians",
                suggest::some(&names(joints))
            ),
            Self::BeyondLimits {
                joint,
                position,
                limits: [lower, upper],
            } => write!(
                f,
                "the position of {joint} reaches {position:.2}, beyond the URDF's limits of {lower:.2} and {upper:.2}"
            ),
            Self::Velocity {
                joints,
                is_replaced,
            } => velocities(f, joints, *is_replaced),
            Self::Jump { remark, .. } | Self::Format { remark } => {
                f.write_str(remark.trim_end_matches('.'))
            }
            Self::Pause { duration_s, at_s } => {
                write!(f, "a gap of {duration_s:.3} s at {at_s:.3} s")
            }
        }
    }
}

impl Finding {
    fn of_time(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ConstantStamps {
                stamp_ns,
                messages,
                is_replaced,
            } => {
                let (messages, stamp) = (*messages, in_seconds(*stamp_ns));
                write!(f, "all {messages} stamps are the same, {stamp}: ")?;
                f.write_str(if *is_replaced {
                    "the driver does not set `header.stamp`; the time of recording is used instead"
                } else {
                    "no other column or field tells the time of a row; record the time of each"
                })
            }
            Self::CoarseStamps {
                resolution_s,
                messages_per_stamp,
                is_replaced,
            } => {
                write!(
                    f,
                    "stamps are whole multiples of {resolution_s} s, and {messages_per_stamp:.0} messages share each: "
                )?;
                f.write_str(if *is_replaced {
                    "the time of recording is used instead"
                } else {
                    "too coarse to tell how fast a joint moves; let the driver fill `header.stamp.nanosec`, or record with \
                     stamps of at most 0.25 s resolution"
                })
            }
            Self::ScaledStamps { ratio } => write!(
                f,
                "stamps pass {} times as fast as the time of recording: they are {}; they were scaled to seconds",
                power(*ratio),
                if *ratio > 1.0 {
                    "milli-, micro- or nanoseconds written as seconds"
                } else {
                    "written in a larger unit than seconds"
                }
            ),
            Self::JumpsBack {
                jumps,
                count,
                refused,
            } => {
                let jumps = jumps.iter();
                let jumps: Vec<String> = jumps
                    .map(|(at_s, by_s)| format!("by {by_s:.3} s at {at_s:.3} s"))
                    .collect();
                let more = (*count as usize).saturating_sub(jumps.len());
                write!(f, "stamps jump back {}", jumps.join(" and "))?;
                if more > 0 {
                    write!(f, ", and {more} more times")?;
                }
                f.write_str(": a looped playback, or a clock that was set back")?;
                match refused {
                    0 => f.write_str("; what follows is read as a new beginning"),
                    count => write!(f, "; {count} messages that follow are not used"),
                }
            }
            Self::LateMessages { messages } => write!(
                f,
                "{} not used: stamped before the message that they follow",
                are(*messages)
            ),
            Self::StalledStamps { messages } => write!(
                f,
                "{} not used: other values under the stamp of the message before",
                are(*messages)
            ),
            _ => Ok(()),
        }
    }

    fn of_values(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Impossible {
                joint,
                field,
                example,
                messages,
                first_s,
                last_s,
                usual,
            } => {
                write!(
                    f,
                    "the {field} of {joint} is {example:.3e} and the like in {}, where nine of ten values stay below {usual:.3}: \
                     no measurement, for example memory that the driver never wrote; not used",
                    span(*messages, *first_s, *last_s)
                )
            }
            Self::Dropouts {
                joint,
                messages,
                drops,
                first_s,
                last_s,
            } => write!(
                f,
                "the effort of {joint} drops to exactly zero {} in {}: a loose plug or a sensor that restarts; not used",
                if *drops == 1 {
                    "once".to_owned()
                } else {
                    format!("{drops} times")
                },
                span(*messages, *first_s, *last_s)
            ),
            _ => Ok(()),
        }
    }
}

/// Velocity over derivative of the position below which the velocity does not follow the position.
/// Resolution: a factor of a unit, such as 1/60, is far from it or is written with its digits.
const FOLLOWS: f64 = 0.01;

fn velocities(
    f: &mut fmt::Formatter<'_>,
    joints: &[OddVelocity],
    is_replaced: bool,
) -> fmt::Result {
    // Joints with the same words share a clause.
    let mut clauses: Vec<(String, Vec<&str>)> = Vec::new();
    for odd in joints {
        let words = odd.words();
        match clauses.iter_mut().find(|(known, _)| *known == words) {
            Some((_, names)) => names.push(&odd.joint),
            None => clauses.push((words, vec![&odd.joint])),
        }
    }
    let clauses = clauses.iter();
    let clauses: Vec<String> = clauses
        .map(|(words, names)| format!("of {} {words}", suggest::some(names)))
        .collect();
    write!(f, "the recorded velocity {}", clauses.join(", and "))?;
    if joints.iter().any(|odd| odd.slope < -FOLLOWS) {
        f.write_str("; below zero, position or velocity has the wrong sign")?;
    }
    f.write_str(if is_replaced {
        "; it is not used, velocities are computed from the positions"
    } else {
        "; correct it in the driver"
    })
}

fn publishers(
    f: &mut fmt::Formatter<'_>,
    used: &[Publisher],
    ignored: &[Publisher],
) -> fmt::Result {
    let list = |all: &[Publisher]| {
        let all: Vec<String> = all.iter().map(ToString::to_string).collect();
        all.join("; ")
    };
    write!(
        f,
        "several publishers send joint states here: used {} ({})",
        if used.len() == 1 { "is" } else { "are" },
        list(used)
    )?;
    if ignored.is_empty() {
        return Ok(());
    }
    write!(f, ", not used ({})", list(ignored))
}

/// A sentence for each finding of several recordings; recordings with the same finding share one.
pub fn by_recording(all: &[(String, Vec<Finding>)]) -> Vec<String> {
    let mut sentences: Vec<(String, Vec<&str>)> = Vec::new();
    for (name, findings) in all {
        for finding in findings {
            let text = finding.to_string();
            match sentences.iter_mut().find(|(known, _)| *known == text) {
                Some((_, names)) => names.push(name),
                None => sentences.push((text, vec![name])),
            }
        }
    }
    let sentences = sentences.iter().map(|(text, names)| {
        let of = if names.len() > 1 && names.len() == all.len() {
            format!("all {} recordings", names.len())
        } else {
            suggest::some(names)
        };
        format!("{of}: {text}.")
    });
    sentences.collect()
}

/// `1 message at 3.200 s`, or `12 messages from 3.200 s to 3.310 s`.
fn span(messages: u64, first_s: f64, last_s: f64) -> String {
    if messages == 1 {
        format!("1 message at {first_s:.3} s")
    } else {
        format!("{messages} messages from {first_s:.3} s to {last_s:.3} s")
    }
}

/// `1 message is`, `12 messages are`.
fn are(messages: u64) -> String {
    if messages == 1 {
        "1 message is".to_owned()
    } else {
        format!("{messages} messages are")
    }
}

/// A time as seconds, without a fraction where there is none.
fn in_seconds(ns: i64) -> String {
    if ns == 0 {
        "zero".to_owned()
    } else {
        format!("{:.9} s", ns as f64 * 1e-9)
    }
}

/// The nearest power of ten.
fn power(ratio: f64) -> String {
    let exponent = ratio.log10().round();
    if exponent < 0.0 {
        format!("1/{:.0}", 10_f64.powf(-exponent))
    } else {
        format!("{:.0}", 10_f64.powf(exponent))
    }
}

fn names(joints: &[String]) -> Vec<&str> {
    joints.iter().map(String::as_str).collect()
}
