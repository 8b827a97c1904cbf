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

/// Records its input streams: completely in an archive, and as a picture for the Rerun viewer.
///
/// Memory is bounded: an open chunk of the archive, some seconds of the picture's file, and some seconds of a live
/// picture that no viewer receives. Only the indexes of the two files grow, together by about 35 MB per hour.
pub struct Recorder {
    streams: Streams,
    contacts: Contacts,
    files: Files,
    around_alarms: Option<AroundAlarms>,
    live: Option<LivePicture>,
    leftovers: Option<Leftovers>,
    /// Names of the most recently completed files.
    completed: Vec<PathBuf>,
    completed_count: u64,
}

impl Recorder {
    /// Opens all outputs of `config`. `cells` and `streams` announce the input; `provenance` (versions, hashes of the
    /// input files) is stored in the archive.
    ///
    /// # Errors
    /// If there is no output, cells, streams and file names are inconsistent, a file cannot be created, or the
    /// viewer's address is invalid. A missing viewer is no error.
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

    /// Starts the repair of unfinished files of crashed recorders that match the names of `config`, and reports each
    /// repair. It never destroys data: an unfinished file is removed only when all of its content is in a new file on
    /// the disk.
    pub fn repair_leftovers(&mut self, config: &Config) {
        let cell = self.streams.cells.first().map_or("", |cell| &cell.name);
        self.leftovers = Some(Leftovers::repair(config, cell));
    }

    /// Number of messages of the live picture that were dropped because the viewer was too slow or not connected. The
    /// files still contain all data.
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

    /// Updates the list of completed files, including those around alarms.
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
        // The maximum, because a sample missing in both outputs must count once.
        (self.files.dropped()).max(around.map_or(0, AroundAlarms::dropped))
    }
}
