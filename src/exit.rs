//! How a command ends.

use tauscope_pipeline::report::{Problem, Report};

use crate::output::Output;
use crate::terminal;

/// How a command ended that did what was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done, nothing lost.
    Done,
    /// Begun, but not brought to its end; the reason was said where it came up.
    Failed,
    /// Done, but data was lost. The summary says which and how much.
    Lossy,
    /// Wrong arguments or files: nothing was started, and the result says why.
    Rejected,
}

impl Exit {
    /// [`Exit::Lossy`] if anything was lost.
    pub fn from_loss(lost: bool) -> Self {
        if lost { Self::Lossy } else { Self::Done }
    }

    /// The worse of two: rejected, then failed, then lossy, then done.
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Rejected, _) | (_, Self::Rejected) => Self::Rejected,
            (Self::Failed, _) | (_, Self::Failed) => Self::Failed,
            (Self::Lossy, _) | (_, Self::Lossy) => Self::Lossy,
            (Self::Done, Self::Done) => Self::Done,
        }
    }
}

/// Why a command did not do what was asked.
#[derive(Debug)]
pub enum Failure {
    /// Wrong arguments or files: nothing was started.
    Rejected(Report),
    /// Something failed on the way.
    Failed(anyhow::Error),
    /// Ctrl-C or SIGTERM; how far it got, and what is there of it.
    Interrupted(String),
}

impl Failure {
    /// Wrong arguments or files, in one sentence.
    pub fn rejected(title: impl Into<String>) -> Self {
        Self::Rejected(Problem::new(title).into())
    }
}

impl From<Report> for Failure {
    fn from(report: Report) -> Self {
        Self::Rejected(report)
    }
}

impl From<tauscope_evaluate::WriteError> for Failure {
    fn from(error: tauscope_evaluate::WriteError) -> Self {
        match error {
            tauscope_evaluate::WriteError::Refused(report) => Self::Rejected(report),
            error @ tauscope_evaluate::WriteError::Failed { .. } => {
                Self::Failed(anyhow::Error::msg(error.to_string()))
            }
        }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Failed(error)
    }
}

/// The exit code, which is the same for every command; what went wrong is said.
///
/// 0 done; 1 failed; 2 wrong arguments or files, nothing was started; 3 done, but data was lost.
pub fn code(outcome: Result<Exit, Failure>, out: &mut Output) -> u8 {
    match outcome {
        Ok(Exit::Done) => 0,
        Ok(Exit::Failed) => 1,
        Ok(Exit::Lossy) => {
            out.say("Some data was left out, so the exit code is 3.");
            3
        }
        Ok(Exit::Rejected) => 2,
        Err(Failure::Failed(error)) => {
            out.say(&format!("error: {}", told_once(&error)));
            1
        }
        Err(Failure::Interrupted(far)) => {
            out.say(&format!("interrupted {far}"));
            1
        }
        Err(Failure::Rejected(report)) => {
            let styled = matches!(out, Output::Terminal) && terminal::has_colour();
            out.say(&report.render(styled));
            2
        }
    }
}

/// An error and its causes; what one says already, the next does not say again.
fn told_once(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text += &format!(": {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use anyhow::Context as _;

    use super::*;

    #[test]
    fn no_cause_is_told_twice() {
        let denied = std::io::Error::from(std::io::ErrorKind::PermissionDenied);
        let once: Result<(), _> = Err(denied).context("cannot write: permission denied");
        let told = once.map_err(|error| told_once(&error.context("ro/x.mcap")));
        assert_eq!(
            told,
            Err("ro/x.mcap: cannot write: permission denied".to_owned())
        );
    }
}
