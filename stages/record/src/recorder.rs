//! The recorder as a stage.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_bus::{SampleRef, Sink, StageError};

use crate::around_alarms::AroundAlarms;
use crate::config::Config;
use crate::contacts::Contacts;
use crate::error::RecordError;
use crate::files::Files;
use crate::leftovers::Leftovers;
use crate::rerun::LivePicture;
use crate::streams::{CellInfo, StreamInfo, Streams};

/// Keeps what it listens to: all of it in an archive, a view of it for the Rerun viewer.
///
/// Memory is bounded: an open chunk of the archive, some seconds of the picture's file, some seconds
/// of a live picture that no viewer takes. Only the indexes of the two files grow, by about 35 MB an
/// hour together.
pub struct Recorder {
    streams: Streams,
    contacts: Contacts,
    files: Files,
    around_alarms: Option<AroundAlarms>,
    live: Option<LivePicture>,
    leftovers: Option<Leftovers>,
    /// Names of the files that were completed last.
    completed: Vec<PathBuf>,
    completed_count: u64,
}

impl Recorder {
    /// Opens all that `config` asks for. `cells` and `streams` say what will come; `provenance` is
    /// what made it (versions, hashes of the files that went in) and stands in the archive.
    ///
    /// # Errors
    /// If nothing is to be written, cells, streams and file names do not fit together, a file cannot
    /// be made or the viewer's address is none. That no viewer is there is no error.
    pub fn new(
        config: &Config,
        cells: &[CellInfo],
        streams: &[StreamInfo],
        provenance: &BTreeMap<String, String>,
    ) -> Result<Self, RecordError> {
        if !config.writes_something() {
            return Err(RecordError::NothingToWrite);
        }
        config.check_names()?;
        let picture = config.rerun.as_ref();
        let viewer = picture.and_then(|rerun| rerun.connect.as_ref());
        let streams = Streams::new(cells, streams)?;
        let files = Files::new(config, provenance, &streams)?;
        let around_alarms = config
            .around_alarms
            .as_ref()
            .map(|around| AroundAlarms::new(around, config, provenance, &streams));
        let live = viewer.map(|url| LivePicture::start(url, &streams));
        let live = live.transpose()?;
        Ok(Self {
            contacts: Contacts::new(&streams),
            streams,
            files,
            around_alarms: around_alarms.transpose()?,
            live,
            leftovers: None,
            completed: Vec::new(),
            completed_count: 0,
        })
    }

    /// Begins to repair what earlier recorders of `config`'s names, which died, left unfinished. It says
    /// what it has repaired. Never destroys data: what is repaired is only removed once all of it is in a
    /// new file on the disk.
    pub fn repair_leftovers(&mut self, config: &Config) {
        let cell = self.streams.cells.first().map_or("", |cell| &cell.name);
        self.leftovers = Some(Leftovers::repair(config, cell));
    }

    /// Messages of the live picture that the viewer was too slow for, or not there for. No data is
    /// lost by it: the files hold everything.
    pub fn live_dropped(&self) -> u64 {
        self.live.as_ref().map_or(0, LivePicture::dropped)
    }

    fn keep(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), RecordError> {
        let index = self.streams.find(from, &sample)?;
        let told = self.contacts.push(&self.streams, index, sample);
        self.files.accept(&self.streams, index, sample, &told)?;
        if let Some(around) = &mut self.around_alarms {
            around.accept(&self.streams, index, sample)?;
        }
        if let Some(live) = &mut self.live {
            live.accept(&self.streams, index, sample, &told)?;
        }
        self.note_completed();
        Ok(())
    }

    fn show_and_flush(&mut self) -> Result<(), RecordError> {
        self.files.flush()?;
        if let Some(around) = &mut self.around_alarms {
            around.flush(&self.streams)?;
        }
        self.note_completed();
        self.live.as_mut().map_or(Ok(()), LivePicture::idle)
    }

    /// The files of all, and those around alarms, in one list.
    fn note_completed(&mut self) {
        let (files, count) = self.files.completed();
        let around = self.around_alarms.as_ref().map(AroundAlarms::completed);
        let (more, more_count) = around.unwrap_or_default();
        if count + more_count != self.completed_count {
            self.completed = files.iter().chain(more).cloned().collect();
            self.completed_count = count + more_count;
        }
    }

    fn complete(&mut self) -> Result<(), RecordError> {
        self.files.finish(&self.streams)?;
        if let Some(around) = &mut self.around_alarms {
            around.finish(&self.streams)?;
        }
        self.note_completed();
        if let Some(leftovers) = &mut self.leftovers {
            leftovers.wait();
        }
        self.live.as_mut().map_or(Ok(()), LivePicture::finish)
    }
}

impl Sink for Recorder {
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        self.keep(from, sample).map_err(StageError::failed)
    }

    fn idle(&mut self) -> Result<(), StageError> {
        self.show_and_flush().map_err(StageError::failed)
    }

    fn finish(&mut self) -> Result<(), StageError> {
        self.complete().map_err(StageError::failed)
    }

    fn completed_files(&self) -> (&[PathBuf], u64) {
        (&self.completed, self.completed_count)
    }

    fn dropped(&self) -> u64 {
        let around = self.around_alarms.as_ref();
        // A sample that neither kept is one sample.
        (self.files.dropped()).max(around.map_or(0, AroundAlarms::dropped))
    }
}
