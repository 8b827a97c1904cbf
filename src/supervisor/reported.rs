//! What a stage's process says, as the supervisor takes it.

/// What a line of a stage's standard output said.
#[derive(Debug, PartialEq, Eq)]
pub enum Reported<'a> {
    /// It begins, with so many receivers missing.
    Ready {
        /// How many.
        missing: usize,
    },
    /// What it has counted.
    Counts,
    /// That it does not go on.
    Stuck,
    /// What holds there.
    Holds,
    /// What it has found.
    Note(String),
    /// Something that is none of the protocol.
    Other(&'a str),
}
