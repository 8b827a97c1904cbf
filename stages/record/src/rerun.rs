//! The picture of the streams for the Rerun viewer: in a file, live, or both.
//!
//! Entities and timelines are those of Rerun's MCAP importer for the archive
//! (`<topic>/{position,velocity,effort}`). In addition there are entities that the importer does
//! not create: the robot (`robot/<link>`, moved by `transforms`), detectors
//! (`detections/<detector>/{score,threshold,state,events}`) and forces
//! (`external_wrench/<detector>`). With several cells, all paths begin with the cell's name.

mod blueprint;
mod detections;
pub(crate) mod explanation;
mod file;
mod live;
mod painter;
mod palette;
mod queue;
mod repair;
mod robot;
mod store;
mod tracks;

use std::path::{Path, PathBuf};

use rerun::log::LogMsg;
use tauscope_archive::whole_file::Existing;
use tauscope_bus::SampleRef;

use self::blueprint::Purpose;
use self::file::PictureFile;
use self::live::Live;
use self::painter::{Pace, Painter};
pub(crate) use self::repair::repair_in_place;
use crate::contacts::Told;
use crate::error::RecordError;
use crate::streams::Streams;

/// The picture in a file.
pub(crate) struct FilePicture {
    painter: Painter,
    file: PictureFile,
}

impl FilePicture {
    /// Creates the file.
    pub fn create(path: &Path, existing: Existing, streams: &Streams) -> Result<Self, RecordError> {
        let mut file = PictureFile::create(path, existing)?;
        let painter = Painter::new(streams, Pace::FILE, &mut |m| file.write(&m))?;
        for message in blueprint::messages(streams, &painter, Purpose::File)? {
            file.write(&message)?;
        }
        Ok(Self { painter, file })
    }

    /// Takes a sample of the stream number `index`.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: &Told<'_>,
    ) -> Result<(), RecordError> {
        let Self { painter, file } = self;
        painter.accept(streams, (index, sample, told), &mut |message| {
            file.write(&message)
        })
    }

    /// Completes the file; returns its path.
    pub fn finish(self, streams: &Streams) -> Result<PathBuf, RecordError> {
        let Self {
            mut painter,
            mut file,
        } = self;
        painter.flush(&mut |message| file.write(&message))?;
        // Repeat the layout: only now the extent of the robot's motion, and thus the view point, is known.
        for message in blueprint::messages(streams, &painter, Purpose::File)? {
            file.write(&message)?;
        }
        file.finish()
    }
}

/// The picture streamed to a viewer.
pub(crate) struct LivePicture {
    painter: Painter,
    live: Live,
}

impl LivePicture {
    /// Starts to connect.
    pub fn start(url: &str, streams: &Streams) -> Result<Self, RecordError> {
        let mut preamble = Vec::new();
        let mut gather = |message: LogMsg| {
            preamble.push(message);
            Ok(())
        };
        let painter = Painter::new(streams, Pace::LIVE, &mut gather)?;
        preamble.extend(blueprint::messages(streams, &painter, Purpose::Live)?);
        let live = Live::start(url, preamble)?;
        Ok(Self { painter, live })
    }

    /// Takes a sample of the stream number `index`.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: &Told<'_>,
    ) -> Result<(), RecordError> {
        let Self { painter, live } = self;
        painter.accept(streams, (index, sample, told), &mut push_to(live))
    }

    /// Sends the gathered data to the viewer.
    pub fn idle(&mut self) -> Result<(), RecordError> {
        let Self { painter, live } = self;
        painter.flush(&mut push_to(live))
    }

    /// Sends the remaining data and disconnects from the viewer.
    pub fn finish(&mut self) -> Result<(), RecordError> {
        self.idle()?;
        self.live.finish();
        Ok(())
    }

    /// Number of messages for the viewer that were dropped in favour of newer ones.
    pub fn dropped(&self) -> u64 {
        self.live.counts().dropped
    }
}

fn push_to(live: &Live) -> impl FnMut(LogMsg) -> Result<(), RecordError> {
    |message| {
        live.push(message);
        Ok(())
    }
}
