//! The sentence of each finding: what was seen, where, what it means and what is done about it.

use std::fmt;

use super::{Finding, OddVelocity};
use crate::publisher::Publisher;
use crate::suggest;

impl OddVelocity {
    fn words(&self) -> String {
        match self.constant {
            Some(value) => format!("is constant, {value}, while the joint moves"),
            None if self.slope.abs() < FOLLOWS => {
                "does not follow the change of the position".to_owned()
            }
            None => format!("is {:.2} times the derivative of the position", self.slope),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Publishers { used, ignored } => publishers(f, used, ignored),
            Self::ConstantStamps { .. } | Self::CoarseStamps { .. } | Self::ScaledStamps { .. } => {
                self.of_time(f)
            }
            Self::JumpsBack { .. } | Self::LateMessages { .. } | Self::StalledStamps { .. } => {
                self.of_order(f)
            }
            Self::NotFinite { joint, values } => {
                let what = values.in_words(joint);
                write!(
                    f,
                    "{what}. These messages are not used. Check the driver and the sensor"
                )
            }
            Self::Impossible { .. } | Self::Dropouts { .. } => self.of_values(f),
            Self::NamedTwice(twice) => write!(
                f,
                "{twice}. These messages are not used, because it is unknown which value holds. Let the driver send each joint once"
            ),
            Self::MissingParts { messages } => write!(
                f,
                "{} only some of the robot's joints, and the other joints were missing for more than 0.5 s. Such messages are \
                 not used. Check the publisher of the other joints",
                counted(*messages, "holds", "hold")
            ),
            Self::NoPositions { messages } => write!(
                f,
                "{} no position. Such messages are not used. Record the topic that has positions and efforts",
                counted(*messages, "has", "have")
            ),
            Self::Copies { messages } => write!(
                f,
                "{} an earlier message: two relays or bridges deliver each. Each state is used once",
                counted(*messages, "repeats", "repeat")
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
                write!(f, "all {messages} stamps are the same, {stamp}. ")?;
                f.write_str(if *is_replaced {
                    "The time of recording is used instead. Let the driver set `header.stamp`"
                } else {
                    "No other column or field holds a time. Record the time of each row"
                })
            }
            Self::CoarseStamps {
                resolution_s,
                messages_per_stamp,
                is_replaced,
            } => {
                write!(
                    f,
                    "stamps have a resolution of {resolution_s} s: about {messages_per_stamp:.0} messages share the same stamp. "
                )?;
                f.write_str(if *is_replaced {
                    "The time of recording is used instead. Let the driver fill `header.stamp.nanosec`"
                } else {
                    "Joint speeds cannot be determined from them. Let the driver fill `header.stamp.nanosec`, and record again"
                })
            }
            Self::ScaledStamps { ratio } => {
                let unit = match ratio.log10().round() as i32 {
                    3 => "milliseconds",
                    6 => "microseconds",
                    9 => "nanoseconds",
                    _ => "another unit than seconds",
                };
                write!(
                    f,
                    "stamps run {} times as fast as the time of recording: they are in {unit}. They are converted to seconds. \
                     Correct `header.stamp` in the driver",
                    power(*ratio)
                )
            }
            _ => Ok(()),
        }
    }

    fn of_order(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
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
                    write!(f, ", and {more} times more")?;
                }
                f.write_str(
                    " of recording time: a looped playback, or a clock that was set back. ",
                )?;
                match refused {
                    0 => f.write_str("Each part is read as a new recording"),
                    count => write!(f, "The {count} messages that follow are not used"),
                }?;
                f.write_str(". Record without looping")
            }
            Self::LateMessages { messages } => write!(
                f,
                "{} a stamp before that of an earlier message: out-of-order delivery. Such messages are not used. Record on the \
                 robot's host, or over a reliable connection",
                counted(*messages, "has", "have")
            ),
            Self::StalledStamps { messages } => write!(
                f,
                "{} other values under the stamp of an earlier message. Such messages are not used. Let the driver stamp each \
                 measurement",
                counted(*messages, "has", "have")
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
                    "the {field} of {joint} is implausible in {}, for example {}. Nine of ten values are below {usual}. \
                     These messages are not used. Check the driver for values that it never sets",
                    span(*messages, *first_s, *last_s),
                    magnitude(*example),
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
                "the effort of {joint} drops to exactly zero {} in {}. Efforts there are not used. Check the plug and the \
                 sensor of the joint, and whether the drives were off",
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
        ". Velocities are computed from the positions instead. Check the velocity that the driver publishes"
    } else {
        ". Check the velocity that the driver publishes"
    })
}

fn publishers(
    f: &mut fmt::Formatter<'_>,
    used: &[Publisher],
    ignored: &[Publisher],
) -> fmt::Result {
    let list = |all: &[Publisher]| {
        let all: Vec<String> = all.iter().map(|it| format!("({it})")).collect();
        all.join(", ")
    };
    write!(
        f,
        "several publishers share this topic. Used: {}",
        list(used)
    )?;
    if ignored.is_empty() {
        return Ok(());
    }
    write!(f, ". Not used: {}", list(ignored))?;
    if ignored.iter().any(|publisher| !publisher.measures_effort()) {
        f.write_str(". A publisher without measured efforts belongs on a topic of its own")?;
    }
    Ok(())
}

/// A number as people read it: with an exponent where it is very large or small.
fn magnitude(value: f64) -> String {
    if (1e-3..1e7).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:.2e}")
    }
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
    counted(messages, "is", "are")
}

/// A number of messages with the verb that goes with it.
fn counted(messages: u64, of_one: &str, of_more: &str) -> String {
    if messages == 1 {
        format!("1 message {of_one}")
    } else {
        format!("{messages} messages {of_more}")
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
