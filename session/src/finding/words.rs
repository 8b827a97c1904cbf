//! The sentence of each finding: what was seen, where, what it means and what is done about it.

use std::fmt;

use super::{Finding, OddVelocity};
use crate::publisher::Publisher;
use crate::suggest;

impl OddVelocity {
    fn words(&self) -> String {
        match self.constant {
            Some(value) => format!("is constant, {value}, while the joint moves"),
            None if self.slope.abs() < FOLLOWS => "does not follow the position".to_owned(),
            None => format!("is {:.2} times the derivative of the position", self.slope),
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
