//! The recorder as a stage.

use std::collections::BTreeMap;

use tauscope_bus::{SampleRef, Sink, StageError};

use crate::archive::Archive;
use crate::config::Config;
use crate::error::RecordError;
use crate::rerun::Picture;
use crate::streams::{CellInfo, StreamInfo, Streams};

/// Keeps what it listens to: all of it in an archive, a view of it for the Rerun viewer.
///
/// Memory is bounded: an open chunk of the archive, some seconds of the picture's file, some seconds
/// of a live picture that no viewer takes. Only the indexes of the two files grow, by about 35 MB an
/// hour together.
pub struct Recorder {
    streams: Streams,
    archive: Option<Archive>,
    picture: Option<Picture>,
}

impl Recorder {
    /// Opens all that `config` asks for. `cells` and `streams` say what will come; `provenance` is
    /// what made it (versions, hashes of the files that went in) and stands in the archive.
    ///
    /// # Errors
    /// If nothing is to be written, cells and streams do not fit together, a file cannot be made or
    /// the viewer's address is none. That no viewer is there is no error.
    pub fn new(
        config: &Config,
        cells: &[CellInfo],
        streams: &[StreamInfo],
        provenance: &BTreeMap<String, String>,
    ) -> Result<Self, RecordError> {
        let picture = config.rerun.as_ref();
        let picture = picture.filter(|rerun| rerun.file.is_some() || rerun.connect.is_some());
        if config.mcap.is_none() && picture.is_none() {
            return Err(RecordError::NothingToWrite);
        }
        let streams = Streams::new(cells, streams)?;
        let archive = match &config.mcap {
            Some(path) => Some(Archive::create(
                path,
                config.compression,
                provenance,
                &streams,
            )?),
            None => None,
        };
        let picture = match picture {
            Some(rerun) => Some(Picture::open(rerun, &streams)?),
            None => None,
        };
        Ok(Self {
            streams,
            archive,
            picture,
        })
    }

    /// Messages of the live picture that the viewer was too slow for, or not there for. No data is
    /// lost by it: the files hold everything.
    pub fn live_dropped(&self) -> u64 {
        self.picture.as_ref().map_or(0, Picture::live_dropped)
    }

    fn keep(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), RecordError> {
        let index = self.streams.find(from, &sample)?;
        if let Some(archive) = &mut self.archive {
            archive.accept(&self.streams, index, sample)?;
        }
        if let Some(picture) = &mut self.picture {
            picture.accept(&self.streams, index, sample)?;
        }
        Ok(())
    }
}

impl Sink for Recorder {
    fn accept(&mut self, from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        self.keep(from, sample).map_err(StageError::failed)
    }

    fn idle(&mut self) -> Result<(), StageError> {
        if let Some(archive) = &mut self.archive {
            archive.flush().map_err(StageError::failed)?;
        }
        if let Some(picture) = &mut self.picture {
            picture.idle().map_err(StageError::failed)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), StageError> {
        // The archive first: it is what lasts, whatever becomes of the picture.
        if let Some(archive) = self.archive.take() {
            archive.finish().map_err(StageError::failed)?;
        }
        if let Some(picture) = &mut self.picture {
            picture.finish(&self.streams).map_err(StageError::failed)?;
        }
        Ok(())
    }
}
