//! Selection of what is used of a topic: publishers, clock, ranges.

use crate::clock::Clock;
use crate::finding::Finding;
use crate::publisher::{Publisher, Publishers};
use crate::values::Ranges;

/// Selection of what is used of a topic.
#[derive(Debug, Clone)]
pub(crate) struct Selection {
    /// Name of the topic; none of a table and of a live source.
    pub topic: Option<String>,
    /// The robot's joints, in its order.
    pub joint_names: Vec<String>,
    /// Time of the messages.
    pub clock: Clock,
    /// The publishers that are known.
    pub publishers: Publishers,
    /// Whether each publisher is used.
    pub used: Vec<bool>,
    /// Ranges of the values that were seen.
    pub ranges: Ranges,
    /// The finding about the clock.
    pub of_clock: Option<Finding>,
    /// The finding about velocities that are not used.
    pub of_velocity: Option<Finding>,
}

impl Selection {
    /// Of a live source, of which nothing is known before its messages come.
    pub fn live(joint_names: &[String]) -> Self {
        Self {
            topic: None,
            joint_names: joint_names.to_vec(),
            clock: Clock::default(),
            publishers: Publishers::default(),
            used: Vec::new(),
            ranges: Ranges::new(joint_names.iter().map(|_| None)),
            of_clock: None,
            of_velocity: None,
        }
    }

    /// The publishers that are used.
    pub fn used_publishers(&self) -> impl Iterator<Item = &Publisher> {
        let all = self.publishers.all.iter().zip(&self.used);
        all.filter(|(_, used)| **used)
            .map(|(publisher, _)| publisher)
    }

    /// Selection before any message, with counts of zero.
    pub fn rewound(&self) -> Self {
        let mut this = self.clone();
        for publisher in &mut this.publishers.all {
            (publisher.messages, publisher.runs) = (0, 0);
        }
        this.ranges.rewind();
        this
    }
}
