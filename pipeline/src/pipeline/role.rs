//! Stage kinds with their input and output sample types.

use tauscope_bus::SampleKind;

use super::file::StageEntry;
use crate::settings::OutputEntry;

/// Kind of a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A source of joint states.
    Ingest,
    /// The twin.
    Twin,
    /// A detector.
    Detect,
    /// A watch over a twin.
    Watch,
    /// A recorder.
    Record,
    /// A publisher.
    Publish,
    /// An external program, with its output type.
    Outside(Option<SampleKind>),
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

/// Keys that define the kind of a stage.
pub const ROLE_KEYS: [&str; 7] = [
    "ingest", "twin", "detect", "watch", "record", "publish", "outside",
];

/// Former key of a watch, which is still accepted.
pub const FORMER_WATCH_KEY: &str = "explain";

impl Role {
    /// All kinds that `entry` declares, with their keys. A valid entry declares exactly one.
    pub fn claimed(entry: &StageEntry) -> Vec<(&'static str, Self)> {
        let outside = entry
            .outside
            .as_ref()
            .map(|outside| Self::Outside(outside.output.map(kind_of)));
        let claims = [
            entry.ingest.as_ref().map(|_| Self::Ingest),
            entry.twin.as_ref().map(|_| Self::Twin),
            entry.detect.as_ref().map(|_| Self::Detect),
            entry.watch.as_ref().map(|_| Self::Watch),
            entry.record.as_ref().map(|_| Self::Record),
            entry.publish.as_ref().map(|_| Self::Publish),
            outside,
        ];
        let former = entry
            .explain
            .as_ref()
            .map(|_| (FORMER_WATCH_KEY, Self::Watch));
        let claims = ROLE_KEYS.into_iter().zip(claims);
        let claims = claims.filter_map(|(key, role)| Some((key, role?)));
        claims.chain(former).collect()
    }

    /// Key in the file.
    pub fn key(self) -> &'static str {
        match self {
            Self::Ingest => "ingest",
            Self::Twin => "twin",
            Self::Detect => "detect",
            Self::Watch => "watch",
            Self::Record => "record",
            Self::Publish => "publish",
            Self::Outside(_) => "outside",
        }
    }

    /// Permitted inputs.
    pub fn takes(self) -> Takes {
        match self {
            Self::Ingest => Takes::Nothing,
            Self::Twin => Takes::One(SampleKind::JointState),
            Self::Detect | Self::Watch => Takes::One(SampleKind::TwinState),
            Self::Record | Self::Publish | Self::Outside(None) => Takes::Many,
            Self::Outside(Some(_)) => Takes::AnyOne,
        }
    }

    /// Whether it also receives the health reports of its input stages.
    pub fn hears_health(self) -> bool {
        matches!(self, Self::Record | Self::Publish)
    }

    /// Output sample type.
    pub fn gives(self) -> Option<SampleKind> {
        match self {
            Self::Ingest => Some(SampleKind::JointState),
            Self::Twin => Some(SampleKind::TwinState),
            Self::Detect | Self::Watch => Some(SampleKind::Detection),
            Self::Record | Self::Publish => None,
            Self::Outside(output) => output,
        }
    }
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

fn kind_of(output: OutputEntry) -> SampleKind {
    match output {
        OutputEntry::JointState => SampleKind::JointState,
        OutputEntry::TwinState => SampleKind::TwinState,
        OutputEntry::Detection => SampleKind::Detection,
    }
}
