//! Unit of work: from one recording to one result file.

use tauscope_bus::Sink;
use tauscope_watch as watch;

use super::identity::Identity;
use super::manifest::Wanted;
use super::rows::{Row, RowWriter};
use super::shelf::Shelf;
use crate::replay::{Outcome, Replay, ReplayError, stem};
use crate::tally::{DetectionTally, Event};

/// Outcome for a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// Its result existed already.
    Before,
    /// It was replayed.
    Now {
        /// Number of samples that were lost or refused.
        lost: u64,
    },
    /// It was replayed, but another runner finished first.
    ByAnother,
}

/// Error that prevents a result.
#[derive(Debug, thiserror::Error)]
pub enum UnitError {
    /// An unreadable recording.
    #[error("cannot read it: {0}")]
    Read(std::io::Error),
    /// A recording that has changed since the manifest was made.
    #[error("it has changed since the manifest was made: make the manifest again")]
    Changed,
    /// A failed replay.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// A result that cannot be encoded or written.
    #[error("cannot write its result: {0}")]
    Parquet(#[from] parquet::errors::ParquetError),
    /// A result that cannot be moved to its place.
    #[error("cannot put its result in place: {0}")]
    Place(std::io::Error),
}

/// Replays recordings of one source and stores the results.
pub struct Unit<'a> {
    /// The prepared replay.
    pub replay: &'a Replay<'a>,
    /// Inputs of the results.
    pub identity: &'a Identity,
    /// Store of the results.
    pub shelf: &'a dyn Shelf,
    /// Whether to write a row for each sample of a detector.
    pub with_scores: bool,
}

impl Unit<'_> {
    /// Computes the result of `wanted`, unless it exists. `progress` receives the completed fraction, 0 to 1; if it
    /// returns `false`, the work is cancelled.
    ///
    /// # Errors
    /// If the recording cannot be read or has changed, or the result cannot be written.
    pub fn run(
        &self,
        wanted: &Wanted,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Done, UnitError> {
        let name = self.identity.name(wanted, self.replay.cell_name());
        if self.shelf.holds(&name).map_err(UnitError::Place)? {
            return Ok(Done::Before);
        }
        if !wanted.is_unchanged().map_err(UnitError::Read)? {
            return Err(UnitError::Changed);
        }
        let (part, file) = self.shelf.begin(&name).map_err(UnitError::Place)?;
        let written = self.write(wanted, file, progress);
        let outcome = match written {
            Ok(outcome) => outcome,
            Err(error) => {
                // The caller receives the original error, not one of the cleanup.
                let _ = part.discard();
                return Err(error);
            }
        };
        let placed = self.shelf.place(part, &name).map_err(UnitError::Place)?;
        let lost = outcome.lost;
        Ok(if placed {
            Done::Now { lost }
        } else {
            Done::ByAnother
        })
    }

    fn write(
        &self,
        wanted: &Wanted,
        file: std::fs::File,
        progress: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Outcome, UnitError> {
        let stem = stem(&wanted.recording);
        let of = (
            stem.as_str(),
            wanted.sha256.as_str(),
            self.replay.cell_name(),
        );
        let facts = self.identity.facts(wanted);
        let mut rows = RowWriter::new(file, of, &facts)?;
        let beside: Option<Box<dyn Sink + '_>> = if self.with_scores {
            Some(Box::new(&mut rows))
        } else {
            None
        };
        let outcome = (self.replay).run_beside(&wanted.recording, beside, progress)?;
        summarise(&outcome, &mut rows)?;
        rows.finish()?;
        Ok(outcome)
    }
}

/// Writes the rows of the recording, of its twins by joint, and of each event.
fn summarise(outcome: &Outcome, rows: &mut RowWriter) -> Result<(), parquet::errors::ParquetError> {
    let (start_ns, end_ns) = outcome.stamps_ns;
    let events = |watches: bool| {
        let tallies = outcome.detectors.iter();
        let of = tallies.filter(move |tally| (tally.detector == watch::NAME) == watches);
        of.map(|tally| tally.events.len() as u64).sum::<u64>()
    };
    rows.push(&Row {
        row: "recording",
        effort_unit: Some(&outcome.effort_unit),
        t_ns: Some(start_ns),
        end_ns: Some(end_ns),
        duration_s: Some(outcome.duration_s),
        samples: outcome.stages.first().map(|source| source.emitted),
        lost_samples: Some(outcome.lost),
        events: Some(events(false)),
        ..Row::default()
    })?;
    for twin in &outcome.twins {
        for (joint, rms) in outcome.joint_names.iter().zip(twin.rms()) {
            rows.push(&Row {
                row: "residual",
                stage: Some(&twin.stage),
                joint: Some(joint),
                effort_unit: Some(&outcome.effort_unit),
                t_ns: Some(start_ns),
                end_ns: Some(end_ns),
                samples: Some(twin.samples),
                moving_samples: Some(twin.moving_samples),
                residual_rms: Some(rms.residual_rms),
                residual_rms_moving: Some(rms.residual_rms_moving),
                filtered_residual_rms: Some(rms.filtered_residual_rms),
                ..Row::default()
            })?;
        }
    }
    for tally in &outcome.detectors {
        for event in &tally.events {
            let unit = event
                .size
                .map(|_| watch::size_unit(&event.kind, &outcome.effort_unit));
            rows.push(&Row {
                size_unit: unit.as_deref(),
                ..of_event(tally, event, &outcome.effort_unit)
            })?;
        }
    }
    Ok(())
}

fn of_event<'a>(tally: &'a DetectionTally, event: &'a Event, effort_unit: &'a str) -> Row<'a> {
    // Without a first sample there are no events.
    let start_ns = tally.start_ns().unwrap_or_default();
    let stamp_ns = |t: f64| Some(start_ns + (t * 1e9).round() as i64);
    let watched = tally.detector == watch::NAME;
    Row {
        row: if watched { "physics" } else { "event" },
        stage: Some(&tally.stage),
        detector: Some(&tally.detector),
        kind: Some(&event.kind),
        link: event.link.as_deref(),
        joints: Some(&event.joints),
        effort_unit: Some(effort_unit),
        t_ns: stamp_ns(event.t),
        end_ns: stamp_ns(event.t_off),
        contact_ns: stamp_ns(event.t_contact),
        duration_s: Some(event.t_off - event.t),
        score: Some(event.peak_score),
        force_n: event.force,
        size: event.size,
        ..Row::default()
    }
}
