//! What came of packing.

use tauscope_archive::Twice;

/// What a [`Packer`](super::Packer) has counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PackCounts {
    /// Samples packed.
    pub packed: u64,
    /// States and side messages refused because a number in them is not finite.
    pub not_finite: u64,
    /// States refused because a newer one had come before.
    pub late: u64,
    /// States with the stamp of the one before that say the same; nothing is lost by leaving them out.
    pub repeated: u64,
    /// States with the stamp of the one before that say something else: the publisher's clock stands still.
    pub stalled: u64,
    /// States without a joint that never came, or came much later.
    pub parted: u64,
    /// Messages without what their topic is for: a state without positions, an effort that is absent.
    pub incomplete: u64,
    /// Messages that name a joint of the cell more than once.
    pub ambiguous: u64,
    /// Messages about other joints than the cell's.
    pub foreign: u64,
    /// Times that the clock was set back.
    pub resets: u64,
}

impl PackCounts {
    /// What is lost for good.
    pub fn dropped(&self) -> u64 {
        self.not_finite + self.late + self.stalled + self.parted + self.incomplete + self.ambiguous
    }
}

/// Why nothing could be packed out of a whole recording.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PackError {
    /// A number of a joint was never there.
    #[error("{field} of joint `{joint}` is NaN throughout ({messages} messages)")]
    NotFiniteThroughout {
        /// The joint.
        joint: String,
        /// `position`, `velocity` or `effort`.
        field: &'static str,
        /// How many messages were read.
        messages: u64,
    },
    /// A joint that messages name more than once.
    #[error("{0}: which of its values hold is not known; let the driver send each joint once")]
    NamedTwice(Twice),
    /// Joints of the cell that no message names.
    #[error(
        "no joint state names {}; the messages name {}. Make a joint that nobody records `fixed`, as `init` does",
        list(missing),
        list(found)
    )]
    JointsMissing {
        /// Joints of the cell that never came.
        missing: Vec<String>,
        /// Names that came instead (the first few).
        found: Vec<String>,
    },
    /// No message has positions.
    #[error("none of {messages} joint states has positions")]
    NoPositions {
        /// How many were read.
        messages: u64,
    },
    /// Messages that never complete a state, or none at all.
    #[error("{messages} joint states make no whole sample")]
    NoSample {
        /// How many were read.
        messages: u64,
    },
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        "no joint".to_owned()
    } else {
        names.join(", ")
    }
}
