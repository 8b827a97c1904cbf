//! Errors of recordings without usable joint states of a robot.

use std::path::PathBuf;

use tauscope_archive::{ArchiveError, Twice};
use tauscope_bus::MAX_JOINTS;

use crate::finding::{Finding, shared};
use crate::publisher::Publisher;
use crate::suggest::{self, on};

/// Reason why a recording has no usable joint states of a robot.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The recording cannot be read.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The recording has no topic of joint states.
    #[error("{}: no topic of joint states; {}", path.display(), topics(known))]
    NoJointStates {
        /// The recording.
        path: PathBuf,
        /// Name and type of its topics.
        known: Vec<String>,
    },
    /// Several topics have equally suitable joint states of the robot.
    #[error(
        "{}: {} give joint states of the robot equally well; choose one with --state-topic",
        path.display(),
        topics.join(" and ")
    )]
    SeveralTopics {
        /// The recording.
        path: PathBuf,
        /// The topics.
        topics: Vec<String>,
    },
    /// More joints than a sample can hold.
    #[error(
        "{}: {found} joints, and at most {MAX_JOINTS} can be compared at once: explain parts of the robot one after the other, each with a \
         robot file in which the joints of the others are fixed",
        path.display()
    )]
    TooManyJoints {
        /// The recording.
        path: PathBuf,
        /// Number of joints.
        found: usize,
    },
    /// None of the joint states can be used.
    #[error("{}: {why}", path.display())]
    Unusable {
        /// The recording.
        path: PathBuf,
        /// The reason.
        why: Unusable,
    },
}

/// Returns a sentence for each reason why recordings, of `count` in total, cannot be used; recordings with the same
/// reason share one.
pub fn by_reason(errors: &[SessionError], count: usize) -> Vec<String> {
    let texts = errors.iter().map(|error| match error {
        SessionError::Unusable { path, why } => (path.display().to_string(), why.to_string()),
        other => (String::new(), other.to_string()),
    });
    let sentences = shared(texts, count).into_iter();
    let sentence = |(of, text): (String, String)| {
        if of.is_empty() {
            text
        } else {
            format!("{of}: {text}")
        }
    };
    sentences.map(sentence).collect()
}

/// Reason why no state of a robot could be assembled from joint states.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// A field of a joint that is never a number.
    #[error("{field} of joint `{joint}` is NaN throughout ({messages} messages)")]
    NotFiniteThroughout {
        /// The joint.
        joint: String,
        /// `position`, `velocity` or `effort`.
        field: &'static str,
        /// Number of messages.
        messages: u64,
    },
    /// A joint that messages name more than once.
    #[error("{0}: which of its values hold is not known; let the driver send each joint once")]
    NamedTwice(Twice),
    /// Joints of the robot that no message names.
    #[error(
        "no joint state names {}. {}. Give the robot file of the arm that was recorded, or make the joints that are not recorded `fixed`",
        named(missing),
        publishers(all)
    )]
    JointsMissing {
        /// The joints.
        missing: Vec<String>,
        /// Publishers on the topic.
        all: Vec<Publisher>,
    },
    /// No message has positions.
    #[error(
        "no joint state of {messages} has a position: record the topic that has positions and efforts"
    )]
    NoPositions {
        /// Number of messages.
        messages: u64,
    },
    /// A finding that excludes all states.
    #[error("no joint state{} can be used: {finding}", on(topic.as_deref()))]
    Finding {
        /// The topic; none of a table.
        topic: Option<String>,
        /// The finding.
        finding: Box<Finding>,
    },
    /// Messages that never complete a state, or no messages.
    #[error("{messages} joint states make no whole sample")]
    NoSample {
        /// Number of messages.
        messages: u64,
    },
}

impl Unusable {
    /// Returns the finding, if it is one.
    pub fn into_finding(self) -> Option<Finding> {
        match self {
            Self::Finding { finding, .. } => Some(*finding),
            _ => None,
        }
    }
}

fn named(names: &[String]) -> String {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    if names.is_empty() {
        "a joint".to_owned()
    } else {
        suggest::some(&names)
    }
}

fn publishers(all: &[Publisher]) -> String {
    let each = all.iter().map(ToString::to_string);
    match all.len() {
        0 => "No message names a joint".to_owned(),
        1 => format!("The messages name {}", each.collect::<String>()),
        count => {
            let each: Vec<String> = each.collect();
            format!("{count} publishers send messages: ({})", each.join("), ("))
        }
    }
}

fn topics(known: &[String]) -> String {
    if known.is_empty() {
        "the recording has no topics".to_owned()
    } else {
        format!("it has {}", known.join(", "))
    }
}
