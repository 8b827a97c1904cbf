//! The current files of a recorder: archive and picture of the same samples.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_archive::whole_file::Existing;
use tauscope_bus::SampleRef;

use crate::archive::Archive;
use crate::config::Config;
use crate::contacts::Told;
use crate::error::RecordError;
use crate::file_name::{FileName, fill_in};
use crate::rerun::FilePicture;
use crate::retention::Retention;
use crate::room::Room;
use crate::set_back::SetBack;
use crate::streams::Streams;

/// Writer of the recorder's files, which begins new ones according to the settings.
pub(crate) struct Files {
    config: Config,
    /// Provenance, stored in each archive.
    provenance: BTreeMap<String, String>,
    mcap: Option<FileName>,
    rerun: Option<FileName>,
    open: Option<OpenFiles>,
    clock: SetBack,
    room: Room,
    retention: Retention,
    /// Whether the disk has too little space, so that samples are counted but not kept.
    paused: bool,
    /// Number of samples that were not kept.
    dropped: u64,
    /// Number of lost samples that were already reported.
    dropped_told: u64,
    /// Names of the most recently completed files.
    completed: Vec<PathBuf>,
    completed_count: u64,
}

struct OpenFiles {
    archive: Option<Archive>,
    picture: Option<FilePicture>,
    /// Reception time of their first sample \[ns since the epoch\].
    start_ns: Option<i64>,
    /// Number of samples since the archive's last chunk was closed, which a failed write would lose.
    unwritten: u64,
    /// Length of the archive up to that chunk \[bytes\].
    written_bytes: u64,
}

impl Files {
    /// Parses the names, and begins the files if their names are known in advance.
    pub fn new(
        config: &Config,
        provenance: &BTreeMap<String, String>,
        streams: &Streams,
    ) -> Result<Self, RecordError> {
        let mut files = Self::later(config, provenance, streams)?;
        let known = files.names().all(FileName::is_known_at_start);
        if known && files.has_room(streams)? {
            files.open = Some(files.begin(streams, 0)?);
        }
        Ok(files)
    }

    /// Parses the names; files are begun with the first sample.
    pub fn later(
        config: &Config,
        provenance: &BTreeMap<String, String>,
        streams: &Streams,
    ) -> Result<Self, RecordError> {
        let rerun = config.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        let parse = |path: Option<&PathBuf>| path.map(|path| FileName::parse(path)).transpose();
        let mut files = Self {
            mcap: parse(config.mcap.as_ref())?,
            rerun: parse(rerun)?,
            config: config.clone(),
            provenance: provenance.clone(),
            open: None,
            clock: SetBack::new(streams),
            room: Room::new(PathBuf::new(), config.min_free_mb),
            retention: Retention::new(),
            paused: false,
            dropped: 0,
            dropped_told: 0,
            completed: Vec::new(),
            completed_count: 0,
        };
        let cells = streams.cells.len();
        if cells > 1 && files.names().any(FileName::is_of_one_cell) {
            return Err(RecordError::SeveralCells { cells });
        }
        let cell = first_cell(streams);
        let folder = files.names().next().map(|name| name.known_folder(cell));
        if let Some(folder) = folder {
            files.room = Room::new(folder, config.min_free_mb);
        }
        files.remove_what_is_beyond(cell);
        Ok(files)
    }

    /// Number of samples that were lost because the disk was full.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    fn names(&self) -> impl Iterator<Item = &FileName> {
        self.mcap.iter().chain(&self.rerun)
    }

    /// Writes a sample of the stream number `index`; begins new files if they are due.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: &Told<'_>,
    ) -> Result<(), RecordError> {
        if self.names().next().is_none() {
            return Ok(());
        }
        if !self.has_room(streams)? {
            self.dropped += 1;
            return Ok(());
        }
        match self.keep(streams, index, sample, told) {
            Err(error) if error.is_disk_full() => {
                self.abandon(&error);
                Ok(())
            }
            kept => kept,
        }
    }

    fn keep(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: &Told<'_>,
    ) -> Result<(), RecordError> {
        let now_ns = sample.header().received_ns;
        // Health reports may overtake the samples of their stage, which wait in a queue.
        let is_of_time = !matches!(sample, SampleRef::Health(_));
        // Files are read in the order of reception times, so samples after a clock step back would be sorted first.
        let is_set_back = is_of_time && self.clock.note(index, now_ns).is_some();
        let ends = is_set_back && self.names().all(FileName::can_differ);
        if is_of_time && (self.open.as_ref()).is_some_and(|open| ends || self.is_full(open, now_ns))
        {
            self.complete(streams)?;
        }
        let mut open = match self.open.take() {
            Some(open) => open,
            None => match self.begin(streams, now_ns) {
                Ok(open) => open,
                Err(error) => {
                    self.dropped += u64::from(error.is_disk_full());
                    return Err(error);
                }
            },
        };
        if is_of_time {
            open.start_ns.get_or_insert(now_ns);
        }
        let kept = open.accept(streams, index, sample, told);
        self.open = Some(open);
        kept
    }

    /// Checks the free disk space; pauses or resumes recording accordingly, with a warning.
    fn has_room(&mut self, streams: &Streams) -> Result<bool, RecordError> {
        let archive = self.open.as_ref().and_then(|open| open.archive.as_ref());
        let reserve = archive.map_or(0, Archive::index_bytes);
        let mut enough = self.room.is_enough(reserve, self.paused);
        if !enough {
            enough = self.make_room(streams, reserve);
        }
        if enough && self.paused {
            self.paused = false;
            let lost = self.lost();
            tracing::warn!("{}: recording continues; {lost}", self.room);
        }
        if !enough && !self.paused {
            self.paused = true;
            let room = self.room.to_string();
            match self.complete(streams) {
                Err(error) if error.is_disk_full() => self.abandon(&error),
                completed => completed?,
            }
            tracing::warn!(
                "{room}: recording pauses until there is more; what comes is counted as lost"
            );
        }
        Ok(enough)
    }

    /// Removes the oldest files until there is enough space, if the settings allow it.
    fn make_room(&mut self, streams: &Streams, reserve: u64) -> bool {
        if self.config.keep.is_none() {
            return false;
        }
        let cell = first_cell(streams);
        loop {
            let mut removed = Vec::new();
            for name in self.mcap.iter().chain(&self.rerun) {
                match self.retention.remove_oldest(name, cell) {
                    Ok(mut gone) => removed.append(&mut gone),
                    Err(error) => tracing::warn!("cannot remove an old recording: {error}"),
                }
            }
            if removed.is_empty() {
                return false;
            }
            tell_removed(&removed);
            self.room.look();
            if self.room.is_enough(reserve, self.paused) {
                return true;
            }
        }
    }

    /// Message about the samples lost since the last report.
    fn lost(&mut self) -> String {
        let lost = self.dropped - std::mem::replace(&mut self.dropped_told, self.dropped);
        format!("{lost} samples were not kept")
    }

    /// Leaves the open files unfinished after a write failed because the disk was full.
    fn abandon(&mut self, error: &RecordError) {
        self.paused = true;
        self.room.look();
        let lost = self.open.take().map_or(0, |open| open.unwritten);
        self.dropped += lost;
        tracing::warn!(
            "{error}: recording pauses until there is room; the next run repairs the unfinished file"
        );
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
        let cell = first_cell(streams);
        let names: Vec<&FileName> = self.names().collect();
        let paths = fill_in(&names, cell, start_ns).map_err(RecordError::Folder)?;
        // Later files of this run must not replace its own earlier ones.
        let again = paths.iter().any(|path| self.completed.contains(path));
        let existing = if again {
            Existing::Keep
        } else {
            self.config.existing
        };
        let mut paths = paths.into_iter();
        let mut next = |name: &Option<FileName>| name.as_ref().and_then(|_| paths.next());
        let (mcap, rerun) = (next(&self.mcap), next(&self.rerun));
        let archive = mcap
            .map(|path| Archive::create(&path, &self.config, existing, &self.provenance, streams));
        let picture = rerun.map(|path| FilePicture::create(&path, existing, streams));
        Ok(OpenFiles {
            archive: archive.transpose()?,
            picture: picture.transpose()?,
            start_ns: None,
            unwritten: 0,
            written_bytes: 0,
        })
    }

    /// Flushes all data to the operating system.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        let Some(open) = &mut self.open else {
            return Ok(());
        };
        match open.archive.as_mut().map_or(Ok(()), Archive::flush) {
            Err(error) if error.is_disk_full() => self.abandon(&error),
            flushed => flushed?,
        }
        Ok(())
    }

    /// Completes the open files and replaces the list of completed names.
    pub fn finish(&mut self, streams: &Streams) -> Result<(), RecordError> {
        match self.complete(streams) {
            Err(error) if error.is_disk_full() => self.abandon(&error),
            completed => completed?,
        }
        if self.dropped > self.dropped_told {
            let lost = self.lost();
            tracing::warn!("{}: {lost}", self.room);
        }
        Ok(())
    }

    fn complete(&mut self, streams: &Streams) -> Result<(), RecordError> {
        let Some(open) = self.open.take() else {
            return Ok(());
        };
        let unwritten = open.unwritten;
        let mut completed = Vec::new();
        let complete = || {
            // The archive first, because it is the permanent record even if the picture fails.
            if let Some(archive) = open.archive {
                completed.push(archive.finish()?);
            }
            if let Some(picture) = open.picture {
                completed.push(picture.finish(streams)?);
            }
            Ok(())
        };
        let outcome: Result<(), RecordError> = complete();
        self.completed_count += completed.len() as u64;
        if completed.is_empty() && outcome.is_err() {
            self.dropped += unwritten;
        }
        if self.config.keep.is_some() {
            self.retention.complete(&completed);
        }
        self.completed = completed;
        self.remove_what_is_beyond(first_cell(streams));
        outcome
    }

    fn remove_what_is_beyond(&mut self, cell: &str) {
        let Some(keep) = &self.config.keep else {
            return;
        };
        for name in self.mcap.iter().chain(&self.rerun) {
            match self.retention.remove_what_is_beyond(keep, name, cell) {
                Ok(removed) => tell_removed(&removed),
                Err(error) => tracing::warn!("cannot remove old recordings: {error}"),
            }
        }
    }

    /// Returns the most recently completed files, and the total number of completed files.
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
        told: &Told<'_>,
    ) -> Result<(), RecordError> {
        if let Some(archive) = &mut self.archive {
            self.unwritten += 1;
            archive.accept(streams, index, sample, told)?;
            if archive.bytes() != self.written_bytes {
                self.written_bytes = archive.bytes();
                self.unwritten = 1;
            }
        }
        if let Some(picture) = &mut self.picture {
            picture.accept(streams, index, sample, told)?;
        }
        Ok(())
    }
}

fn first_cell(streams: &Streams) -> &str {
    streams.cells.first().map_or("", |cell| &cell.name)
}

fn tell_removed(removed: &[PathBuf]) {
    for path in removed {
        tracing::warn!(
            "{} was removed: the oldest goes first (`keep`)",
            path.display()
        );
    }
}
