//! Messages that cannot be decoded, counted by reason.

use std::fmt;
use std::mem::Discriminant;

use serde::Serialize;

use crate::error::ArchiveError;
use crate::ros::DecodeError;

/// Most reasons of a topic that are listed.
/// Resolution: bounds memory and the length of the list.
const MAX_REASONS: usize = 4;

/// Messages of a topic that cannot be decoded for reasons of one kind.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Undecodable {
    /// Number of messages.
    pub count: u64,
    /// Reason of the first of them.
    pub reason: String,
    /// Log time of the first of them \[ns since the epoch\].
    pub first_log_time_ns: i64,
}

impl fmt::Display for Undecodable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = &self.reason;
        write!(f, "{} cannot be used: {reason}", messages(self.count))
    }
}

/// The reasons in words, and the messages without a listed reason.
pub(crate) fn lines(count: u64, reasons: &[Undecodable]) -> Vec<String> {
    let mut lines: Vec<String> = reasons.iter().map(ToString::to_string).collect();
    let listed: u64 = reasons.iter().map(|reason| reason.count).sum();
    if count > listed {
        let others = messages(count - listed);
        lines.push(format!("{others} cannot be used for other reasons"));
    }
    lines
}

fn messages(count: u64) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} message{plural}")
}

/// Reasons of one kind: of one variant, and for lengths of arrays with the same numbers.
#[derive(PartialEq)]
struct Kind(Discriminant<DecodeError>, Option<String>);

/// Counts undecodable messages of a topic.
#[derive(Default)]
pub(crate) struct UndecodableTally {
    count: u64,
    reasons: Vec<(Kind, Undecodable)>,
}

impl UndecodableTally {
    /// Counts a message that cannot be decoded.
    pub(crate) fn add(&mut self, error: &ArchiveError, log_time_ns: i64) {
        self.count += 1;
        let ArchiveError::Decode { source, .. } = error else {
            return;
        };
        let lengths = matches!(source, DecodeError::ArrayLength { .. });
        let kind = Kind(
            std::mem::discriminant(source),
            lengths.then(|| source.to_string()),
        );
        let same = self.reasons.iter_mut().find(|(known, _)| *known == kind);
        if let Some((_, undecodable)) = same {
            undecodable.count += 1;
        } else if self.reasons.len() < MAX_REASONS {
            let undecodable = Undecodable {
                count: 1,
                reason: source.to_string(),
                first_log_time_ns: log_time_ns,
            };
            self.reasons.push((kind, undecodable));
        }
    }

    /// Number of all undecodable messages.
    pub(crate) fn count(&self) -> u64 {
        self.count
    }

    /// The first reason of each kind; of many kinds the first [`MAX_REASONS`].
    pub(crate) fn reasons(self) -> Vec<Undecodable> {
        self.reasons.into_iter().map(|(_, reason)| reason).collect()
    }
}
