//! The files that a recorder writes at a time: the archive and the picture of the same samples.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_bus::SampleRef;

use crate::archive::Archive;
use crate::config::Config;
use crate::contacts::Told;
use crate::error::RecordError;
use crate::file_name::{FileName, fill_in};
use crate::rerun::FilePicture;
use crate::streams::Streams;

/// Where files go and when new ones begin.
pub(crate) struct Files {
    config: Config,
    /// What made them: stands in each archive.
    provenance: BTreeMap<String, String>,
    mcap: Option<FileName>,
    rerun: Option<FileName>,
    open: Option<OpenFiles>,
    /// Names of the files that were completed last.
    completed: Vec<PathBuf>,
    completed_count: u64,
}

struct OpenFiles {
    archive: Option<Archive>,
    picture: Option<FilePicture>,
    /// When the first sample in them was received \[ns since the epoch\].
    start_ns: Option<i64>,
}

impl Files {
    /// Takes the names apart and begins the files whose names are known by now.
    pub fn new(
        config: &Config,
        provenance: &BTreeMap<String, String>,
        streams: &Streams,
    ) -> Result<Self, RecordError> {
        config.check_names()?;
        let rerun = config.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        let parse = |path: Option<&PathBuf>| path.map(|path| FileName::parse(path)).transpose();
        let mut files = Self {
            mcap: parse(config.mcap.as_ref())?,
            rerun: parse(rerun)?,
            config: config.clone(),
            provenance: provenance.clone(),
            open: None,
            completed: Vec::new(),
            completed_count: 0,
        };
        let cells = streams.cells.len();
        if cells > 1 && files.names().any(FileName::is_of_one_cell) {
            return Err(RecordError::SeveralCells { cells });
        }
        if files.names().all(FileName::is_known_at_start) {
            files.open = Some(files.begin(streams, 0)?);
        }
        Ok(files)
    }

    fn names(&self) -> impl Iterator<Item = &FileName> {
        self.mcap.iter().chain(&self.rerun)
    }

    /// Takes a sample of the stream number `index`, into new files if it is time for them.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: Told<'_>,
    ) -> Result<(), RecordError> {
        if self.names().next().is_none() {
            return Ok(());
        }
        let now_ns = sample.header().received_ns;
        if self
            .open
            .as_ref()
            .is_some_and(|open| self.is_full(open, now_ns))
        {
            self.finish(streams)?;
        }
        let mut open = match self.open.take() {
            Some(open) => open,
            None => self.begin(streams, now_ns)?,
        };
        open.start_ns.get_or_insert(now_ns);
        let kept = open.accept(streams, index, sample, told);
        self.open = Some(open);
        kept
    }

    fn is_full(&self, open: &OpenFiles, now_ns: i64) -> bool {
        let Some(split) = self.config.split else {
            return false;
        };
        let age_s = open.start_ns.map_or(0.0, |start_ns| {
            now_ns.saturating_sub(start_ns) as f64 * 1e-9
        });
        let size_mb = open
            .archive
            .as_ref()
            .map_or(0.0, |archive| archive.bytes() as f64 * 1e-6);
        split.after_s.is_some_and(|limit| age_s >= limit)
            || split.after_mb.is_some_and(|limit| size_mb >= limit)
    }

    fn begin(&self, streams: &Streams, start_ns: i64) -> Result<OpenFiles, RecordError> {
        let cell = streams.cells.first().map_or("", |cell| &cell.name);
        let names: Vec<&FileName> = self.names().collect();
        let mut paths = fill_in(&names, cell, start_ns)
            .map_err(RecordError::Folder)?
            .into_iter();
        let existing = self.config.existing;
        let mut next = |name: &Option<FileName>| name.as_ref().and_then(|_| paths.next());
        let (mcap, rerun) = (next(&self.mcap), next(&self.rerun));
        let archive = mcap.map(|path| {
            let compression = self.config.compression;
            Archive::create(&path, compression, existing, &self.provenance, streams)
        });
        let picture = rerun.map(|path| FilePicture::create(&path, existing, streams));
        Ok(OpenFiles {
            archive: archive.transpose()?,
            picture: picture.transpose()?,
            start_ns: None,
        })
    }

    /// Hands all to the operating system.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        let archive = self.open.as_mut().and_then(|open| open.archive.as_mut());
        archive.map_or(Ok(()), Archive::flush)
    }

    /// Completes the files that are open.
    pub fn finish(&mut self, streams: &Streams) -> Result<(), RecordError> {
        let Some(open) = self.open.take() else {
            return Ok(());
        };
        self.completed.clear();
        // The archive first: it is what lasts, whatever becomes of the picture.
        if let Some(archive) = open.archive {
            self.completed.push(archive.finish()?);
        }
        if let Some(picture) = open.picture {
            self.completed.push(picture.finish(streams)?);
        }
        self.completed_count += self.completed.len() as u64;
        Ok(())
    }

    /// The files that were completed last, and how many were in all.
    pub fn completed(&self) -> (&[PathBuf], u64) {
        (&self.completed, self.completed_count)
    }
}

impl OpenFiles {
    fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: Told<'_>,
    ) -> Result<(), RecordError> {
        if let Some(archive) = &mut self.archive {
            archive.accept(streams, index, sample, told)?;
        }
        if let Some(picture) = &mut self.picture {
            picture.accept(streams, index, sample, told)?;
        }
        Ok(())
    }
}
