//! What is said of messages that were refused: which joint, which field, how many and from when on.

use tauscope_archive::{NotFinite, Twice};

use super::gather::Gather;
use super::{PackError, Packer};

/// Joints and fields that are listed.
/// Resolution: length of the message.
const LISTED: usize = 6;
/// A live source that goes on to refuse says so again after this time \[ns\].
/// Resolution: what a person reads.
const TOLD_EVERY_NS: i64 = 60_000_000_000;

/// When it was told, and how much there was then.
#[derive(Debug, Default)]
pub(super) struct Told {
    count: u64,
    stamp_ns: Option<i64>,
}

impl Told {
    /// Whether a live source has something to say: `count` values or messages were refused by now.
    pub fn is_due(&mut self, count: u64, now_ns: i64) -> bool {
        let lately = (self.stamp_ns).is_some_and(|told_ns| now_ns - told_ns < TOLD_EVERY_NS);
        if count == self.count || lately {
            return false;
        }
        self.count = count;
        self.stamp_ns = Some(now_ns);
        true
    }
}

/// The sentence, if there is anything to say; `not_finite` are the joint's name, what is wrong with it and behind it
/// which messages are meant.
fn sentence<'a>(
    twice: Option<&Twice>,
    not_finite: impl Iterator<Item = (&'a str, NotFinite, &'static str)>,
) -> Option<String> {
    let bad = not_finite.map(|(joint, bad, of)| format!("{}{of}", bad.in_words(joint)));
    let mut all: Vec<String> = twice
        .map(ToString::to_string)
        .into_iter()
        .chain(bad)
        .collect();
    let more = all.len().saturating_sub(LISTED);
    all.truncate(LISTED);
    if more > 0 {
        all.push(format!("the same of {more} more fields"));
    }
    let all = all.join("; ");
    (!all.is_empty()).then(|| format!("{all}: refused, and counted as dropped"))
}

impl Packer {
    /// The first joint, and its field, that came in the states and was never finite.
    pub fn never_finite(&self) -> Option<(String, &'static str)> {
        let (joint, field) = self.state.never_finite()?;
        Some((self.layouts.joint_name(joint).to_owned(), field))
    }

    /// The joint that messages name more than once, if they do.
    pub fn twice(&self) -> Option<Twice> {
        self.twice.map(|(joint, places)| Twice {
            joint: self.layouts.joint_name(joint).to_owned(),
            entries: places.map(|place| place + 1),
            messages: self.counts.ambiguous,
        })
    }

    /// What was refused, in a sentence: of which joint and field, how often and from when on. Seconds count from the
    /// first message on.
    pub fn refused(&self) -> Option<String> {
        let topics = [
            (&self.state, ""),
            (&self.command, " (of the commands)"),
            (&self.reference, " (of the other twin)"),
        ];
        let bad = topics.into_iter().flat_map(|(gather, of)| {
            let all = gather.not_finite();
            all.map(move |(joint, bad)| (self.layouts.joint_name(joint), bad, of))
        });
        sentence(self.twice().as_ref(), bad)
    }

    /// The same for a live source, which says it once something is refused and while that goes on now and then.
    pub fn newly_refused(&mut self, now_ns: i64) -> Option<String> {
        let gathers = [&self.state, &self.command, &self.reference];
        let bad: u64 = gathers.map(Gather::bad).iter().sum();
        let count = bad + self.counts.ambiguous;
        if self.told_refused.is_due(count, now_ns) {
            return self.refused();
        }
        None
    }

    /// Says, after the last message, why there was no sample if there was none.
    ///
    /// # Errors
    /// What kept every message from becoming a sample.
    pub fn verdict(&self) -> Result<(), PackError> {
        if self.counts.packed > 0 || !self.pending.is_empty() {
            return Ok(());
        }
        let messages = self.messages;
        if let Some((joint, field)) = self.never_finite() {
            return Err(PackError::NotFiniteThroughout {
                joint,
                field,
                messages,
            });
        }
        if let Some(twice) = self.twice() {
            return Err(PackError::NamedTwice(twice));
        }
        let missing = self.layouts.never_named();
        if messages > 0 && !missing.is_empty() {
            let found = self.layouts.names_found();
            return Err(PackError::JointsMissing { missing, found });
        }
        if messages > 0 && self.counts.incomplete == messages {
            return Err(PackError::NoPositions { messages });
        }
        Err(PackError::NoSample { messages })
    }
}
