//! The picture of the streams, for the Rerun viewer: to a file, live, or both.
//!
//! Entities lie where Rerun's own MCAP importer would put those of the archive
//! (`<topic>/{position,velocity,effort}`), on its timelines, and beside them what the importer does
//! not make: the robot (`robot/<link>`, moved by `transforms`), detectors
//! (`detections/<detector>/{score,threshold,state,events}`) and forces
//! (`external_wrench/<detector>`). With several cells all begins with the cell's name.

mod blueprint;
mod detections;
pub(crate) mod explanation;
mod file;
mod live;
mod painter;
mod palette;
mod queue;
mod robot;
mod store;
mod tracks;

use rerun::log::LogMsg;
use tauscope_bus::SampleRef;

use self::blueprint::Purpose;
use self::file::PictureFile;
use self::live::Live;
use self::painter::{Pace, Painter};
use crate::config::RerunConfig;
use crate::error::RecordError;
use crate::streams::Streams;

/// The picture in all its outputs.
pub(crate) struct Picture {
    file: Option<FilePicture>,
    live: Option<LivePicture>,
}

struct FilePicture {
    painter: Painter,
    file: PictureFile,
}

struct LivePicture {
    painter: Painter,
    live: Live,
}

impl Picture {
    /// Opens what is configured: makes the file, begins to connect.
    pub fn open(config: &RerunConfig, streams: &Streams) -> Result<Self, RecordError> {
        let file = match &config.file {
            Some(path) => {
                let mut file = PictureFile::create(path)?;
                let painter = Painter::new(streams, Pace::FILE, &mut |m| file.write(&m))?;
                for message in blueprint::messages(streams, &painter, Purpose::File)? {
                    file.write(&message)?;
                }
                Some(FilePicture { painter, file })
            }
            None => None,
        };
        let live = match &config.connect {
            Some(url) => {
                let mut preamble = Vec::new();
                let mut gather = |message: LogMsg| {
                    preamble.push(message);
                    Ok(())
                };
                let painter = Painter::new(streams, Pace::LIVE, &mut gather)?;
                preamble.extend(blueprint::messages(streams, &painter, Purpose::Live)?);
                Some(LivePicture {
                    painter,
                    live: Live::start(url, preamble)?,
                })
            }
            None => None,
        };
        Ok(Self { file, live })
    }

    /// Takes a sample of the stream number `index`.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
    ) -> Result<(), RecordError> {
        if let Some(FilePicture { painter, file }) = &mut self.file {
            painter.accept(streams, index, sample, &mut |message| file.write(&message))?;
        }
        if let Some(LivePicture { painter, live }) = &mut self.live {
            painter.accept(streams, index, sample, &mut push_to(live))?;
        }
        Ok(())
    }

    /// Shows a live viewer what was gathered.
    pub fn idle(&mut self) -> Result<(), RecordError> {
        if let Some(LivePicture { painter, live }) = &mut self.live {
            painter.flush(&mut push_to(live))?;
        }
        Ok(())
    }

    /// Completes the file and lets the viewer go.
    pub fn finish(&mut self, streams: &Streams) -> Result<(), RecordError> {
        if let Some(FilePicture { painter, file }) = &mut self.file {
            painter.flush(&mut |message| file.write(&message))?;
            // Once more: only now is known where the robot went, and so from where to look at it.
            for message in blueprint::messages(streams, painter, Purpose::File)? {
                file.write(&message)?;
            }
            file.finish()?;
        }
        if let Some(LivePicture { painter, live }) = &mut self.live {
            painter.flush(&mut push_to(live))?;
            live.finish();
        }
        Ok(())
    }

    /// Messages for the viewer that gave way to newer ones.
    pub fn live_dropped(&self) -> u64 {
        self.live
            .as_ref()
            .map_or(0, |picture| picture.live.counts().dropped)
    }
}

fn push_to(live: &Live) -> impl FnMut(LogMsg) -> Result<(), RecordError> {
    |message| {
        live.push(message);
        Ok(())
    }
}
