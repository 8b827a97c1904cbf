//! Checks for anything on this machine that would keep a pipeline from running, with remedies.
//!
//! [`facts`] reads the machine; [`verdicts`] judges the facts and has no side effects.

mod certificate;
mod endpoint;
pub mod facts;
pub mod verdicts;

use serde::Serialize;

/// Severity of a verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// A pipeline runs, but degraded or not for long.
    Warning,
    /// A pipeline cannot run or record.
    Error,
}

impl Level {
    /// Returns the severity as it is printed.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// Verdict of one check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Name of the check.
    pub check: &'static str,
    /// Severity.
    pub level: Level,
    /// Finding, as a clause.
    pub found: String,
    /// Remedy; none if all is well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
}

/// Returns the verdict on shared memory if it is an error: with too little of it, stages would die of a bus error.
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
