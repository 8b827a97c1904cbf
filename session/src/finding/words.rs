//! The sentence of each finding: what was seen, where, what it means and what is done about it.

use std::fmt;

use super::{Finding, OddVelocity, Times};
use crate::error::on;
use crate::publisher::Publisher;
use crate::suggest;

impl OddVelocity {
    /// Words about this joint and others with the same fault, `are_several` in total.
    fn words(&self, are_several: bool) -> String {
        match self.constant {
            Some(value) => {
                let move_ = if are_several { "they move" } else { "it moves" };
                format!("is {value} in every message although {move_}")
            }
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
            Self::Publishers {
                topic,
                used,
                ignored,
            } => publishers(f, topic.as_deref(), used, ignored),
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
                f.write_str("the effort is zero throughout, so it is not measured. Let the driver publish the measured effort")
            }
            Self::ZeroEffort { joints, .. } => write!(
                f,
                "the effort of {} is zero throughout, so it is not measured",
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
                all,
                is_replaced,
            } => velocities(f, joints, *all, *is_replaced),
            Self::NoVelocity => write!(
                f,
                "no velocity is recorded. Velocities are computed from the positions. {NOISIER}"
            ),
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
                has_log_times,
                is_replaced,
            } => {
                write!(
                    f,
                    "stamps have a resolution of {resolution_s} s: about {messages_per_stamp:.0} messages share the same stamp. "
                )?;
                f.write_str(match (is_replaced, has_log_times) {
                    (true, _) => "The time of recording is used instead. Let the driver publish stamps of full resolution",
                    (_, true) => {
                        "Joint speeds cannot be computed from them. The time of recording is not used instead, because it includes \
                         delays that such coarse stamps cannot reveal. Let the driver publish stamps of full resolution, and record \
                         again"
                    }
                    _ => {
                        "Joint speeds cannot be computed from them, and there is no other time. Record stamps of full resolution"
                    }
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
                let each = jumps.iter();
                let each: Vec<String> = each
                    .map(|(at_s, by_s)| format!("at {at_s:.3} s by {by_s:.3} s"))
                    .collect();
                write!(
                    f,
                    "the stamps jump back {} after the start",
                    each.join(" and ")
                )?;
                match (*count as usize).saturating_sub(jumps.len()) {
                    0 => {}
                    1 => f.write_str(", and once more")?,
                    more => write!(f, ", and {more} times more")?,
                }
                f.write_str(
                    ". `replay` continues after a jump. Commands that learn, such as `init` and `explain`, leave out what follows \
                     until the stamps have caught up",
                )?;
                if *refused > 0 {
                    write!(f, ", here {refused} messages")?;
                }
                f.write_str(
                    ". If a playback was looped, record without looping; if the clock was set back, synchronise it before \
                     recording",
                )
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
                subnormal,
                times,
                of_messages,
                usual,
            } => {
                let examples = [Some(*example), subnormal.filter(|it| it != example)];
                let examples = examples.into_iter().flatten().map(magnitude);
                let count = times.messages;
                write!(
                    f,
                    "the {field} of {joint} is implausible in {times}, for example {}. 90 % of its values are below {usual} in \
                     magnitude. {} of {of_messages} messages left out for all joints. The driver probably publishes \
                     uninitialised memory or an error value: check that it fills `{field}` of {joint} in every message",
                    examples.collect::<Vec<_>>().join(" and "),
                    if count == 1 {
                        "This 1 is".to_owned()
                    } else {
                        format!("These {count} are")
                    },
                )
            }
            Self::Dropouts { joint, times } => write!(
                f,
                "the effort of {joint} drops to exactly zero {} in {}. Efforts there are not used. Check the plug and the \
                 sensor of the joint, and whether the drives were off",
                match times.runs {
                    1 => "once".to_owned(),
                    runs => format!("{runs} times"),
                },
                times
            ),
            _ => Ok(()),
        }
    }
}

/// Consequence of computed velocities.
const NOISIER: &str =
    "They are noisier, so the detector needs stronger contacts while the arm moves";

/// Velocity over derivative of the position below which the velocity does not follow the position.
/// Resolution: a factor of a unit, such as 1/60, is far from it or is written with its digits.
const FOLLOWS: f64 = 0.01;

fn velocities(
    f: &mut fmt::Formatter<'_>,
    joints: &[OddVelocity],
    all: bool,
    is_replaced: bool,
) -> fmt::Result {
    // Joints with the same words share a clause.
    let mut clauses: Vec<(&OddVelocity, Vec<&str>)> = Vec::new();
    for odd in joints {
        let is_same = |(known, _): &&mut (&OddVelocity, _)| known.words(true) == odd.words(true);
        match clauses.iter_mut().find(is_same) {
            Some((_, names)) => names.push(&odd.joint),
            None => clauses.push((odd, vec![&odd.joint])),
        }
    }
    let clauses = clauses.iter();
    let clauses: Vec<String> = clauses
        .map(|(odd, names)| {
            let of = if all && names.len() == joints.len() && names.len() > 1 {
                format!("all {} joints", names.len())
            } else {
                suggest::some(names)
            };
            format!("of {of} {}", odd.words(names.len() > 1))
        })
        .collect();
    write!(f, "the recorded velocity {}", clauses.join(", and "))?;
    if joints.iter().any(|odd| odd.slope < -FOLLOWS) {
        f.write_str("; below zero, position or velocity has the wrong sign")?;
    }
    if is_replaced {
        write!(
            f,
            ". Velocities are computed from the positions instead. {NOISIER}"
        )?;
    }
    f.write_str(". Check the velocity that the driver publishes")
}

fn publishers(
    f: &mut fmt::Formatter<'_>,
    topic: Option<&str>,
    used: &[Publisher],
    ignored: &[Publisher],
) -> fmt::Result {
    let list = |all: &[Publisher]| {
        let all: Vec<String> = all.iter().map(|it| format!("({it})")).collect();
        all.join(", ")
    };
    write!(
        f,
        "{} publishers send joint states{}",
        used.len() + ignored.len(),
        on(topic)
    )?;
    if ignored.is_empty() {
        return write!(
            f,
            ": {}. They are combined; nothing needs to be done",
            list(used)
        );
    }
    write!(f, ". Used: {}. Not used: {}", list(used), list(ignored))?;
    if ignored.iter().any(|publisher| !publisher.measures_effort()) {
        f.write_str(
            ". Remap or stop the publisher that sends no effort; this result is not affected",
        )?;
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
            " between {first_s:.3} s and {last_s:.3} s (the first at {starts} s)"
        )
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
