//! Execution of a stage group at full speed.

use serde::Serialize;
use tauscope_bus::StageError;
use tauscope_bus::shell::{Group, Next, Report};

/// Sample counters of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StageCounts {
    /// The stage.
    pub stage: String,
    /// Number of samples received; for a source, read.
    pub received: u64,
    /// Number of samples emitted.
    pub emitted: u64,
    /// Number of samples that were refused or did not arrive.
    pub dropped: u64,
}

impl From<Report> for StageCounts {
    fn from(report: Report) -> Self {
        Self {
            received: report.received,
            emitted: report.emitted,
            dropped: report.dropped(),
            stage: report.stage,
        }
    }
}

/// Runs a group at full speed until all its sources have ended. `progress` receives the completed fraction, 0 to 1; if
/// it returns `false`, the run is cancelled, no output is completed, and the result is `None`.
pub(crate) fn run(
    group: &mut Group<'_>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Vec<StageCounts>>, StageError> {
    loop {
        let next = group.turn(false).map_err(|error| group.failure(error).1)?;
        let goes_on = progress(group.fraction_done());
        if next == Next::Over {
            return Ok(Some(group.reports().into_iter().map(Into::into).collect()));
        }
        if !goes_on {
            return Ok(None);
        }
    }
}
