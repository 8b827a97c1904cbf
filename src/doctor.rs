//! What on this machine would keep a pipeline from running, and what to do about it.
//!
//! [`facts`] reads the machine, [`verdicts`] judges what was read and touches nothing.

mod certificate;
mod endpoint;
pub mod facts;
pub mod verdicts;

use serde::Serialize;

/// How it stands with one thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// A pipeline runs, but not as well or not for long.
    Warning,
    /// It would keep a pipeline from running or from recording.
    Error,
}

impl Level {
    /// In the words of the list.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// What was found of one thing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// The thing.
    pub check: &'static str,
    /// How it stands.
    pub level: Level,
    /// What was found.
    pub found: String,
    /// What to do; nothing where all is well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

/// What keeps any run from using shared memory here, and what to do: too little of it would end the
/// stages with a bus error.
pub fn no_shared_memory() -> Option<Verdict> {
    let verdict = verdicts::shared_memory(&facts::shared_memory());
    (verdict.level == Level::Error).then_some(verdict)
}

impl Verdict {
    fn ok(check: &'static str, found: impl Into<String>) -> Self {
        Self {
            check,
            level: Level::Ok,
            found: found.into(),
            remedy: None,
        }
    }

    fn bad(
        check: &'static str,
        level: Level,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            check,
            level,
            found: found.into(),
            remedy: Some(remedy.into()),
        }
    }
}
