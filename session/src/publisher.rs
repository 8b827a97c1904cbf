//! Publishers on one topic: messages that name the same joints and give the same fields.

use std::fmt;

use serde::Serialize;
use tauscope_archive::ros::JointState;

use crate::suggest;

/// Largest number of publishers that are distinguished on a topic.
/// Resolution: bounded memory, and what a person reads.
const MOST: usize = 16;

/// A publisher, identified by the joints that its messages name and the fields that they give.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "one for each field of a joint state"
)]
pub struct Publisher {
    /// Names in its messages.
    pub names: Vec<String>,
    /// Whether its messages give positions.
    pub position: bool,
    /// Whether its messages give velocities.
    pub velocity: bool,
    /// Whether its messages give efforts.
    pub effort: bool,
    /// Whether all of its efforts are zero.
    pub zero_effort: bool,
    /// Runs of consecutive messages: of a publisher that alternates with another, as many as messages.
    #[serde(skip)]
    pub runs: u64,
    /// Number of messages.
    pub messages: u64,
    /// Log time of its first message \[ns since the epoch\].
    pub first_ns: i64,
    /// Log time of its last message \[ns since the epoch\].
    pub last_ns: i64,
}

impl Publisher {
    fn of(message: &JointState, log_time_ns: i64) -> Self {
        Self {
            names: message.name.clone(),
            position: !message.position.is_empty(),
            velocity: !message.velocity.is_empty(),
            effort: !message.effort.is_empty(),
            zero_effort: is_zero(message),
            runs: 0,
            messages: 0,
            first_ns: log_time_ns,
            last_ns: log_time_ns,
        }
    }

    /// Whether a message gives the same fields, and names the same joints in any order; where `splits_zeros`, also whether
    /// its efforts are zero like the others.
    fn sent(&self, message: &JointState, splits_zeros: bool) -> bool {
        self.position != message.position.is_empty()
            && self.velocity != message.velocity.is_empty()
            && self.effort != message.effort.is_empty()
            && (!splits_zeros || self.zero_effort == is_zero(message))
            && self.names.len() == message.name.len()
            && (self.names == message.name
                || message.name.iter().all(|name| self.names.contains(name)))
    }

    /// Messages per second, from the first to the last message.
    pub fn rate_hz(&self) -> Option<f64> {
        let span_s = (self.last_ns - self.first_ns) as f64 * 1e-9;
        (span_s > 0.0 && self.messages > 1).then(|| (self.messages - 1) as f64 / span_s)
    }

    /// Whether it alternates with another publisher. A driver whose drives are off sends its zeros in a row, and an arm
    /// that starts at rest may begin with one.
    fn alternates(&self) -> bool {
        self.runs > 1 && 2 * self.runs >= self.messages
    }

    /// Whether its messages measure efforts.
    pub fn measures_effort(&self) -> bool {
        self.effort && !self.zero_effort
    }
}

/// Joints, fields, count and rate: `a, b with position, effort: 1200 messages, 100.0 Hz`.
impl fmt::Display for Publisher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let fields = [
            (self.position, "position"),
            (self.velocity, "velocity"),
            (self.effort && !self.zero_effort, "effort"),
            (self.effort && self.zero_effort, "zero effort"),
        ];
        let fields = fields.iter().filter(|(given, _)| *given);
        let fields: Vec<&str> = fields.map(|(_, name)| *name).collect();
        let fields = if fields.is_empty() {
            "no values".to_owned()
        } else {
            fields.join(", ")
        };
        let names = if names.is_empty() {
            "no joints".to_owned()
        } else {
            suggest::some(&names)
        };
        let plural = if self.messages == 1 { "" } else { "s" };
        write!(
            f,
            "{names} with {fields}: {} message{plural}",
            self.messages
        )?;
        if let Some(rate_hz) = self.rate_hz() {
            write!(f, ", {rate_hz:.1} Hz")?;
        }
        Ok(())
    }
}

/// Whether a message has efforts and all are zero.
fn is_zero(message: &JointState) -> bool {
    !message.effort.is_empty() && message.effort.iter().all(|effort| *effort == 0.0)
}

/// The publishers on a topic, in the order of their first messages.
#[derive(Debug, Clone, Default)]
pub(crate) struct Publishers {
    pub all: Vec<Publisher>,
    newest: usize,
    /// Whether zeros in the place of efforts are of another publisher. Of a live source that cannot be known in time.
    splits_zeros: bool,
}

impl Publishers {
    /// None yet, of a recording.
    pub fn of_recording() -> Self {
        Self {
            splits_zeros: true,
            ..Self::default()
        }
    }

    /// Counts a message; returns the place of its publisher in `all`, unless there are too many.
    pub fn add(&mut self, message: &JointState, log_time_ns: i64) -> Option<usize> {
        let place = self.place(message);
        let place = place.or_else(|| {
            (self.all.len() < MOST).then(|| {
                self.all.push(Publisher::of(message, log_time_ns));
                self.all.len() - 1
            })
        })?;
        let publisher = &mut self.all[place];
        publisher.runs += u64::from(place != self.newest || publisher.messages == 0);
        self.newest = place;
        publisher.messages += 1;
        publisher.zero_effort &= is_zero(message);
        publisher.last_ns = log_time_ns;
        Some(place)
    }

    /// The publishers, zeros of a driver whose drives were off counted with its measured efforts.
    pub fn listed(&self) -> Vec<(usize, Publisher)> {
        let mut listed: Vec<(usize, Publisher)> = Vec::new();
        for (place, publisher) in self.all.iter().enumerate() {
            let same = listed.iter_mut().find(|(_, other)| {
                let one_is_off = publisher.zero_effort != other.zero_effort;
                let off = if publisher.zero_effort {
                    publisher
                } else {
                    other
                };
                one_is_off
                    && !off.alternates()
                    && publisher.effort == other.effort
                    && publisher.velocity == other.velocity
                    && publisher.names == other.names
            });
            match same {
                Some((at, other)) => {
                    if other.zero_effort {
                        *at = place;
                    }
                    other.zero_effort = false;
                    other.messages += publisher.messages;
                    other.first_ns = other.first_ns.min(publisher.first_ns);
                    other.last_ns = other.last_ns.max(publisher.last_ns);
                }
                None => listed.push((place, publisher.clone())),
            }
        }
        listed.retain(|(_, publisher)| publisher.messages > 0);
        listed
    }

    /// The place of a message's publisher.
    pub fn place(&self, message: &JointState) -> Option<usize> {
        // In nearly all recordings the publisher is that of the message before.
        let newest = self.all.get(self.newest);
        if newest.is_some_and(|publisher| publisher.sent(message, self.splits_zeros)) {
            return Some(self.newest);
        }
        self.all
            .iter()
            .position(|publisher| publisher.sent(message, self.splits_zeros))
    }
}

/// Whether each publisher is used for `joints`: it names one of them and gives its position. Where some give efforts,
/// those that give none are not used; nor are those whose efforts are all zero, if others measure the same joints.
pub(crate) fn choose(all: &[Publisher], joints: &[String]) -> Vec<bool> {
    let names_one =
        |publisher: &Publisher| joints.iter().any(|joint| publisher.names.contains(joint));
    let mut used: Vec<bool> = all
        .iter()
        .map(|publisher| publisher.position && names_one(publisher))
        .collect();
    let some_give_effort = all.iter().zip(&used).any(|(it, used)| *used && it.effort);
    let measured = |joint: &String| {
        let others = all.iter().filter(|it| it.position && it.measures_effort());
        others.clone().any(|it| it.names.contains(joint))
    };
    for (publisher, used) in all.iter().zip(&mut used) {
        let mut own = joints
            .iter()
            .filter(|joint| publisher.names.contains(joint));
        let repeats = publisher.zero_effort && publisher.alternates() && own.all(measured);
        *used &= !(some_give_effort && (!publisher.effort || repeats));
    }
    // Without any position, each message is refused for that reason.
    if !used.contains(&true) {
        used.fill(true);
    }
    used
}

#[cfg(test)]
mod tests {
    use super::*;

    fn publisher(
        names: &str,
        [velocity, effort, zero_effort]: [bool; 3],
        messages: u64,
    ) -> Publisher {
        Publisher {
            names: names.split(' ').map(str::to_owned).collect(),
            position: true,
            velocity,
            effort,
            zero_effort,
            runs: messages,
            messages,
            first_ns: 0,
            last_ns: 1_000_000_000,
        }
    }

    fn chosen(all: &[Publisher]) -> Vec<usize> {
        let used = choose(all, &["a", "b", "c"].map(str::to_owned));
        (0..all.len()).filter(|&place| used[place]).collect()
    }

    #[test]
    fn the_publisher_that_measures_efforts_is_used_and_the_one_that_repeats_positions_is_not() {
        let repeats = publisher("a b c", [false, false, false], 5000);
        let zeros = publisher("c b a", [true, true, true], 5000);
        let driver = publisher("a b c", [true, true, false], 1200);
        let gripper = publisher("finger", [true, true, true], 240);
        assert_eq!(chosen(&[gripper, repeats.clone(), zeros, driver]), [3]);
        // Positions without efforts are used if no publisher measures efforts.
        assert_eq!(chosen(&[repeats]), [0]);
    }

    #[test]
    fn two_publishers_of_a_part_each_are_used_together() {
        let left = publisher("a b", [true, true, false], 1200);
        let right = publisher("c x", [true, true, true], 1200);
        assert_eq!(chosen(&[left, right]), [0, 1]);
    }

    #[test]
    fn a_publisher_is_described_by_its_joints_fields_count_and_rate() {
        let text = publisher("a b", [false, true, true], 101).to_string();
        assert_eq!(
            text,
            "a, b with position, zero effort: 101 messages, 100.0 Hz"
        );
    }
}
