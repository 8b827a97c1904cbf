//! Lines of a stage's process, as the supervisor handles them.

/// Meaning of a line of a stage's standard output.
#[derive(Debug, PartialEq, Eq)]
pub enum Reported<'a> {
    /// The stage is ready.
    Ready {
        /// Number of its receivers that are missing.
        missing: usize,
    },
    /// Its counts.
    Counts,
    /// It blocks its thread.
    Stuck,
    /// Its current condition.
    Holds,
    /// A finding or a note.
    Note(String),
    /// A line that is not part of the protocol.
    Other(&'a str),
}
