//! The unit of work: one recording to one file.

use tauscope_bus::Sink;
use tauscope_watch as watch;

use super::identity::Identity;
use super::manifest::Wanted;
use super::rows::{Row, RowWriter};
use super::shelf::Shelf;
use crate::replay::{Outcome, Replay, ReplayError, stem};
use crate::tally::{DetectionTally, Event};

/// What became of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// Its result was there already.
    Before,
    /// It was replayed; so many samples were lost or refused.
    Now {
        /// See above.
        lost: u64,
    },
    /// It was replayed, and another runner was faster.
    ByAnother,
}

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub enum UnitError {
    /// The recording cannot be read.
    #[error("cannot read it: {0}")]
    Read(std::io::Error),
    /// It is not what the manifest says.
    #[error("it has changed since the manifest was made: make the manifest again")]
    Changed,
    /// It cannot be replayed.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The result cannot be encoded or written.
    #[error("cannot write its result: {0}")]
    Parquet(#[from] parquet::errors::ParquetError),
    /// The result cannot be put in place.
    #[error("cannot put its result in place: {0}")]
    Place(std::io::Error),
}

/// Replays recordings of one source into a shelf.
pub struct Unit<'a> {
    /// The pipeline.
    pub replay: &'a Replay<'a>,
    /// What results depend on.
    pub identity: &'a Identity,
    /// Where they go.
    pub shelf: &'a dyn Shelf,
    /// Also a row for each sample of a detector.
    pub with_scores: bool,
}

impl Unit<'_> {
    /// Makes the result of `wanted`, unless it is there. `progress` is told how far it is, 0 to 1, and by returning
    /// `false` ends the work.
    ///
    /// # Errors
    /// If the recording cannot be read or is another one by now, or the result cannot be written.
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
                // Why there is no result is what the caller is told.
                let _ = tauscope_archive::whole_file::discard(&part);
                return Err(error);
            }
        };
        let placed = self.shelf.place(&part, &name).map_err(UnitError::Place)?;
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

/// What is said of the recording as a whole, of its twins and joints, and of each event.
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
    // Nothing was counted without a first sample.
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
