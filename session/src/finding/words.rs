//! The sentence of each finding: what was seen, where, what it means and what is done about it.

use std::fmt;

use super::Finding;
use super::velocity_words::{NOISIER, velocities};
use crate::publisher::Publisher;
use crate::suggest::{self, on};

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
            Self::Impossible { .. }
            | Self::Dropouts { .. }
            | Self::ZeroEffort { .. }
            | Self::Degrees { .. }
            | Self::BeyondLimits { .. } => self.of_values(f),
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
                        "Joint speeds cannot be computed from them. The time of recording is no substitute: it includes delays, and \
                         stamps as coarse as these cannot show how large they are. Let the driver publish stamps of full \
                         resolution, and record again"
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
                // Jumps by the same step share its number.
                let mut each: Vec<(String, String)> = Vec::new();
                for (at_s, by_s) in jumps {
                    let (at, by) = (format!("at {at_s:.3} s"), format!("{by_s:.3} s"));
                    match each.last_mut() {
                        Some((before, same)) if *same == by => *before += &format!(" and {at}"),
                        _ => each.push((at, by)),
                    }
                }
                let each: Vec<String> = each
                    .iter()
                    .map(|(at, by)| format!("by {by} {at}"))
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
                     a jump, until the stamps pass the last one before it",
                )?;
                if *refused > 0 {
                    write!(f, ": {refused} messages of this recording")?;
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
                let second = subnormal.filter(|_| !example.is_subnormal());
                let examples = [Some(*example), second].into_iter().flatten();
                write!(
                    f,
                    "the {field} of {joint} is implausible in {times}, for example {}. 90 % of its values are below {usual} in \
                     magnitude{}. {} left out for all joints; the others are used. The driver probably publishes \
                     uninitialised memory or an error value: check that it fills `{field}` of {joint} in every message",
                    examples.map(magnitude).collect::<Vec<_>>().join(" and "),
                    subnormal.map_or("", |_| ", and no sensor resolves such small ones"),
                    match times.messages {
                        1 => format!("This one of {of_messages} messages is"),
                        count => format!("These {count} of {of_messages} messages are"),
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
            _ => Ok(()),
        }
    }
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
            ". The results here do not depend on the publisher that sends no effort. Remap or stop it, because other listeners \
             may take its messages for the arm's",
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
