//! The recordings of a set behind one twin, one after the other as one session: what a twin or a
//! detector has learnt of the arm (how warm it is, what its cycle looks like) it keeps from one to the next.

use tauscope_archive::Damage;
use tauscope_bus::{Emit, LinkError, Sample, Source as _, Stage as _, TwinState, flags};
use tauscope_detect::Lesson;
use tauscope_ingest::{FileConfig, RecordedSource, Topics};
use tauscope_pipeline::build;
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::replay::ReplayError;
use tauscope_session::Finding;
use tauscope_twin::Twin;

use crate::recording::Named;

/// A recording behind the twin.
#[derive(Debug, Clone)]
pub struct Played {
    /// Every sample, in order.
    pub samples: Vec<TwinState>,
    /// Findings about the recording.
    pub findings: Vec<Finding>,
    /// Samples of the recording that were lost or refused.
    pub refused: u64,
    /// Parts of the recording that cannot be read, and what was in them is lost.
    pub damage: Vec<Damage>,
    /// Gaps and steps of the clock after which the filters began anew.
    pub gaps: u64,
    /// Samples at which they had not settled.
    pub unsettled: u64,
}

/// A twin that goes from recording to recording.
pub struct Session<'a> {
    cell: &'a Cell,
    topics: Topics,
    twin: Twin,
}

impl<'a> Session<'a> {
    /// A session that begins with the next recording that is played.
    pub fn new(cell: &'a Cell, topics: Topics, twin: Twin) -> Self {
        Self { cell, topics, twin }
    }

    /// Plays a recording to its end; `progress` is told how far it is, from 0 to 1.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn play(
        &mut self,
        recording: &Named,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Played, ReplayError> {
        /// Samples between two reports of progress.
        /// Resolution: the cost of reporting.
        const STEP: u64 = 1024;
        let file = FileConfig {
            path: recording.path.clone(),
            topics: self.topics.clone(),
        };
        let config = tauscope_ingest::Config::default();
        let setup = build::ingest_setup(self.cell);
        let mut source = RecordedSource::open_to_learn(&file, &config, &setup)?;
        let findings = source.findings();
        let mut all = Gathered(Vec::new());
        let mut count = 0;
        while let Some(sample) = source.next_packed()? {
            self.twin.accept(&sample, &mut all)?;
            count += 1;
            if count % STEP == 0 {
                progress(source.fraction_done().unwrap_or(0.0));
            }
        }
        let samples = all.0;
        let resets = samples.iter().skip(1);
        let damage = source.damage().iter().filter(|part| part.loses_data());
        let damage: Vec<Damage> = damage.cloned().collect();
        Ok(Played {
            refused: source.dropped() - damage.len() as u64 + self.twin.dropped(),
            damage,
            gaps: resets.filter(|s| s.header.has(flags::RESET)).count() as u64,
            unsettled: (samples.iter().filter(|s| !s.header.has(flags::READY))).count() as u64,
            findings: findings.get(),
            samples,
        })
    }
}

/// What detectors learn from a recording.
pub fn lesson(recording: &Named, samples: Vec<TwinState>) -> Lesson {
    let events = recording.truth.as_ref().map(|truth| &truth.events);
    Lesson {
        name: recording.name.clone(),
        samples,
        contacts: events.map(|events| {
            let labelled = events
                .iter()
                .map(|event| event.labelled(recording.start_ns));
            labelled.collect()
        }),
    }
}

/// Keeps everything that a stage puts out.
struct Gathered<T>(Vec<T>);

impl<T: Sample> Emit<T> for Gathered<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut slot = T::default();
        write(&mut slot);
        slot.header_mut().sequence = self.0.len() as u64;
        self.0.push(slot);
        Ok(())
    }
}
