//! Kind of a stage with its input and output sample types.

use tauscope_bus::SampleKind;

use super::Kind;

/// A kind of stage with the sample types of one stage.
#[derive(Debug, Clone, Copy)]
pub struct Role {
    /// The kind.
    pub kind: &'static Kind,
    /// Permitted inputs.
    pub takes: Takes,
    /// Type of the output samples.
    pub gives: Option<SampleKind>,
}

/// Permitted inputs of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Takes {
    /// None: the stage is a source.
    Nothing,
    /// One stream of this kind.
    One(SampleKind),
    /// One stream of any kind, or none.
    AnyOne,
    /// Any number of streams, at least one.
    Many,
}

/// Default process of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Placement {
    /// The process of its cell. The stages of a process call each other, so that no alarm waits for another process.
    WithCell,
    /// A process of its own, because it may wait for a disk or a network.
    Alone,
    /// It is a program itself.
    Program,
}

/// Stages that emit `kind`, in words.
pub fn makers_of(kind: SampleKind) -> &'static str {
    match kind {
        SampleKind::JointState => "an `ingest` stage",
        SampleKind::TwinState => "a `twin` stage",
        SampleKind::Detection => "a `detect` or `watch` stage",
        SampleKind::Health => "any stage",
    }
}

/// A kind of sample in words.
pub fn words_for(kind: SampleKind) -> &'static str {
    match kind {
        SampleKind::JointState => "joint states",
        SampleKind::TwinState => "twin states",
        SampleKind::Detection => "detections",
        SampleKind::Health => "health reports",
    }
}
