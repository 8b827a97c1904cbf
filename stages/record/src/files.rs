//! The files that a recorder writes at a time: the archive and the picture of the same samples.

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

/// Where files go and when new ones begin.
pub(crate) struct Files {
    config: Config,
    /// What made them: stands in each archive.
    provenance: BTreeMap<String, String>,
    mcap: Option<FileName>,
    rerun: Option<FileName>,
    open: Option<OpenFiles>,
    clock: SetBack,
    room: Room,
    retention: Retention,
    /// The disk has too little room: what comes is counted and not kept.
    paused: bool,
    /// Samples that were not kept.
    dropped: u64,
    /// Those of them that were told.
    dropped_told: u64,
    /// Names of the files that were completed last.
    completed: Vec<PathBuf>,
    completed_count: u64,
}

struct OpenFiles {
    archive: Option<Archive>,
    picture: Option<FilePicture>,
    /// When the first sample in them was received \[ns since the epoch\].
    start_ns: Option<i64>,
    /// Samples since the archive's last chunk was closed: what is lost where it cannot be written on.
    unwritten: u64,
    /// Length of the archive at that time \[bytes\].
    written_bytes: u64,
}

impl Files {
    /// Takes the names apart and begins the files whose names are known by now.
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

    /// Takes the names apart; files are begun with the first sample.
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

    /// Samples that were not kept because the disk had no room.
    pub fn dropped(&self) -> u64 {
        self.dropped
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
        // Of what a stage has done is told ahead of its samples, which may wait in a queue.
        let is_of_time = !matches!(sample, SampleRef::Health(_));
        // A file is read in the order of reception: what came behind a clock that was set back would come first.
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

    /// Whether the disk has room to go on; pauses where it has none, and says so.
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
            tracing::warn!("{}: recording goes on; {lost}", self.room);
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

    /// Where old files may go for new ones: removes the oldest until there is room.
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

    /// What was lost since it was last told.
    fn lost(&mut self) -> String {
        let lost = self.dropped - std::mem::replace(&mut self.dropped_told, self.dropped);
        format!("{lost} samples were not kept")
    }

    /// Leaves the open files as they are: the disk was full before it was noticed.
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
        // What this run has completed is not replaced by what it goes on with.
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

    /// Hands all to the operating system.
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

    /// Completes the files that are open. The names of those that were completed last are forgotten.
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
            // The archive first: it is what lasts, whatever becomes of the picture.
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
