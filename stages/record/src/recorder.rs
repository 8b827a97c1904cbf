//! The recorder as a stage.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_bus::{SampleRef, Sink, StageError};

use crate::config::Config;
use crate::contacts::Contacts;
use crate::error::RecordError;
use crate::files::Files;
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
    live: Option<LivePicture>,
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
        let picture = config.rerun.as_ref();
        let viewer = picture.and_then(|rerun| rerun.connect.as_ref());
        let file = picture.and_then(|rerun| rerun.file.as_ref());
        if config.mcap.is_none() && viewer.is_none() && file.is_none() {
            return Err(RecordError::NothingToWrite);
        }
        let streams = Streams::new(cells, streams)?;
        let files = Files::new(config, provenance, &streams)?;
        let live = viewer.map(|url| LivePicture::start(url, &streams));
        let live = live.transpose()?;
        Ok(Self {
            contacts: Contacts::new(streams.all.len()),
            streams,
            files,
            live,
        })
    }

    /// Messages of the live picture that the viewer was too slow for, or not there for. No data is
    /// lost by it: the files hold everything.
    pub fn live_dropped(&self) -> u64 {
        self.live.as_ref().map_or(0, LivePicture::dropped)
    }

    fn keep(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), RecordError> {
        let index = self.streams.find(from, &sample)?;
        let told = self.contacts.push(index, sample);
        self.files.accept(&self.streams, index, sample, told)?;
        if let Some(live) = &mut self.live {
            live.accept(&self.streams, index, sample, told)?;
        }
        Ok(())
    }

    fn show_and_flush(&mut self) -> Result<(), RecordError> {
        self.files.flush()?;
        self.live.as_mut().map_or(Ok(()), LivePicture::idle)
    }

    fn complete(&mut self) -> Result<(), RecordError> {
        self.files.finish(&self.streams)?;
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
        self.files.completed()
    }
}
