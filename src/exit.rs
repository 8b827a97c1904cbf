//! Outcomes of commands and their exit codes.

use tauscope_pipeline::report::{Problem, Report};

use crate::output::Output;
use crate::terminal;

/// Outcome of a command that was started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done, nothing lost.
    Done,
    /// Started, but not completed; the reason was reported when it occurred.
    Failed,
    /// Done, but data was lost. The summary reports which data and how much.
    Lossy,
    /// Wrong arguments or files: nothing was started, and the result gives the reason.
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

/// Reason why a command failed.
#[derive(Debug)]
pub enum Failure {
    /// Wrong arguments or files: nothing was started.
    Rejected(Report),
    /// An error during the work.
    Failed(anyhow::Error),
    /// Ctrl-C or SIGTERM, with the progress at that time and the results written so far.
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

/// Reports what went wrong, and returns the exit code, which has the same meaning for every command.
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

/// Formats an error and its causes; a cause that the text already contains is omitted.
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
