//! The recordings of a set behind one twin, played one after the other as one session. The state that a twin or a
//! detector has learnt (the arm's warm-up, its cycle) is kept from one recording to the next.

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

/// Output of the twin for a recording.
#[derive(Debug, Clone)]
pub struct Played {
    /// All samples in order of time.
    pub samples: Vec<TwinState>,
    /// Findings about the recording.
    pub findings: Vec<Finding>,
    /// Number of samples of the recording that were lost or refused.
    pub refused: u64,
    /// Parts of the recording that cannot be read.
    pub damage: Vec<Damage>,
    /// Number of gaps and clock steps after which the filters restarted.
    pub gaps: u64,
    /// Number of samples at which the filters had not settled.
    pub unsettled: u64,
}

/// A twin that keeps its state from recording to recording.
pub struct Session<'a> {
    cell: &'a Cell,
    topics: Topics,
    twin: Twin,
}

impl<'a> Session<'a> {
    /// Creates a session that begins with the first recording that is played.
    pub fn new(cell: &'a Cell, topics: Topics, twin: Twin) -> Self {
        Self { cell, topics, twin }
    }

    /// Plays a recording to its end; `progress` receives the completed fraction, 0 to 1.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn play(
        &mut self,
        recording: &Named,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Played, ReplayError> {
        /// Number of samples between two progress reports.
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

/// Labelled samples of a recording, from which detectors learn.
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

/// Collects the output of a stage.
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
