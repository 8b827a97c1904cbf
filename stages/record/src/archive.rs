//! The MCAP archive of the streams, in messages that any ROS 2 tool reads. `docs/archive.md` describes its topics.

mod command;
mod detections;
mod joints;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tauscope_archive::ros::{self, DiagnosticArray};
use tauscope_archive::whole_file::Existing;
use tauscope_archive::{McapWriter, TopicWriter, WriteError};
use tauscope_bus::{Header, Health, SampleKind, SampleRef, TwinState, flags};

use self::command::CommandTopics;
use self::detections::DetectionTopics;
use self::joints::{JointTopic, status};
use crate::config::Config;
use crate::contacts::Told;
use crate::error::RecordError;
use crate::streams::{Stream, Streams};

/// Sync duration above which a slow disk is reported.
/// Resolution: ten chunks.
const SLOW_DISK: Duration = Duration::from_secs(1);

/// An archive that is being written.
pub(crate) struct Archive {
    file: File,
    /// Topics by stream.
    topics: Vec<Topics>,
    /// Diagnostics topic by cell; created with the first report.
    diagnostics: Vec<Option<TopicWriter<DiagnosticArray>>>,
}

/// Topics of a stream.
enum Topics {
    JointState {
        state: JointTopic,
        command: Box<CommandTopics>,
    },
    TwinState {
        expected: JointTopic,
        residual: JointTopic,
    },
    Detection(Box<DetectionTopics>),
    Health,
}

/// The file; messages get the times of the sample's header.
pub(crate) struct File {
    writer: McapWriter,
}

impl File {
    fn add<M: ros::Message>(&mut self, topic: &str) -> Result<TopicWriter<M>, WriteError> {
        self.writer.add_topic(topic)
    }

    fn write<M: ros::Message>(
        &mut self,
        topic: TopicWriter<M>,
        header: &Header,
        message: &M,
    ) -> Result<(), WriteError> {
        self.writer
            .write(topic, header.received_ns, header.stamp_ns, message)
    }

    /// Writes to a topic that is created with the first message.
    fn write_late<M: ros::Message>(
        &mut self,
        topic: &mut Option<TopicWriter<M>>,
        name: impl FnOnce() -> String,
        header: &Header,
        message: &M,
    ) -> Result<(), WriteError> {
        let topic = match *topic {
            Some(topic) => topic,
            None => *topic.insert(self.add(&name())?),
        };
        self.write(topic, header, message)
    }
}

impl Archive {
    /// Creates the file with the topics that are known in advance.
    pub fn create(
        path: &Path,
        config: &Config,
        existing: Existing,
        provenance: &BTreeMap<String, String>,
        streams: &Streams,
    ) -> Result<Self, RecordError> {
        let mut writer =
            McapWriter::create(path, config.compression, provenance)?.existing(existing);
        if config.sync_s > 0.0 {
            writer = writer.synced_every(Duration::from_secs_f64(config.sync_s))?;
        }
        if let Some(aside) = writer.set_aside() {
            let aside = aside.display();
            tracing::warn!("an unfinished archive of an earlier run was kept as {aside}");
        }
        let mut file = File { writer };
        let mut topics = Vec::new();
        // One topic of detections for all detectors of a cell.
        let mut detections = vec![None; streams.cells.len()];
        for stream in &streams.all {
            topics.push(Topics::new(
                &mut file,
                streams,
                stream,
                &mut detections[stream.cell],
            )?);
        }
        let diagnostics = vec![None; streams.cells.len()];
        Ok(Self {
            file,
            topics,
            diagnostics,
        })
    }

    /// Writes a sample of the stream number `index`.
    pub fn accept(
        &mut self,
        streams: &Streams,
        index: usize,
        sample: SampleRef<'_>,
        told: &Told<'_>,
    ) -> Result<(), RecordError> {
        let stream = &streams.all[index];
        match (sample, &mut self.topics[index]) {
            (SampleRef::Health(health), _) => self.report(streams, stream, health)?,
            (SampleRef::JointState(sample), Topics::JointState { state, command }) => {
                let has = |flag, values| {
                    if sample.header.has(flag) {
                        values
                    } else {
                        None
                    }
                };
                command.write_ahead(&mut self.file, sample)?;
                state.write(
                    &mut self.file,
                    &sample.header,
                    Some(&sample.position),
                    has(flags::VELOCITY_MEASURED, Some(&sample.velocity)),
                    has(flags::EFFORT_MEASURED, Some(&sample.effort)),
                )?;
                command.write(&mut self.file, sample)?;
            }
            (SampleRef::TwinState(sample), Topics::TwinState { expected, residual }) => {
                let TwinState { header, .. } = sample;
                let file = &mut self.file;
                expected.write(file, header, None, None, Some(&sample.expected_effort))?;
                if header.has(flags::READY) {
                    residual.write(file, header, None, None, Some(&sample.residual))?;
                }
            }
            (SampleRef::Detection(detection), Topics::Detection(topics)) => {
                topics.write(&mut self.file, streams, stream, (detection, told))?;
            }
            // `Streams::find` passes samples of the announced type only.
            _ => {}
        }
        Ok(())
    }

    fn report(
        &mut self,
        streams: &Streams,
        stream: &Stream,
        health: &Health,
    ) -> Result<(), WriteError> {
        let level = if health.dropped > 0 {
            ros::Level::Warn
        } else {
            ros::Level::Ok
        };
        let message = match health.dropped {
            0 => "nothing lost".to_owned(),
            dropped => format!("{dropped} samples lost"),
        };
        let values = [
            ("received", health.received),
            ("emitted", health.emitted),
            ("dropped", health.dropped),
            ("restarts", health.restarts),
        ];
        let status = status(
            level,
            health.stage.as_str(),
            message,
            &streams.cells[stream.cell].name,
            values.map(|(key, count)| (key, count.to_string())),
        );
        let array = DiagnosticArray {
            header: ros::Header::new(health.header.stamp_ns, ""),
            status: vec![status],
        };
        self.file.write_late(
            &mut self.diagnostics[stream.cell],
            || format!("{}/diagnostics", streams.prefix(stream.cell)),
            &health.header,
            &array,
        )
    }

    /// Flushes all data to the operating system.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        Ok(self.file.writer.flush()?)
    }

    /// Length of the file up to the last closed chunk \[bytes\].
    pub fn bytes(&self) -> u64 {
        self.file.writer.bytes()
    }

    /// Size of the index at the end of the file \[bytes\].
    pub fn index_bytes(&self) -> u64 {
        self.file.writer.index_bytes()
    }

    /// Completes and renames the file; returns its path.
    pub fn finish(self) -> Result<PathBuf, RecordError> {
        let slowest = self.file.writer.slowest_sync();
        if slowest > SLOW_DISK {
            let slowest_s = slowest.as_secs_f64();
            tracing::warn!(
                "the disk took up to {slowest_s:.1} s to sync: a power failure could have lost as much data"
            );
        }
        Ok(self.file.writer.finish()?.path)
    }
}

impl Topics {
    fn new(
        file: &mut File,
        streams: &Streams,
        stream: &Stream,
        detections: &mut Option<TopicWriter<DiagnosticArray>>,
    ) -> Result<Self, WriteError> {
        let joints = &streams.cells[stream.cell].joint_names;
        Ok(match stream.kind {
            SampleKind::JointState => Self::JointState {
                state: JointTopic::new(file.add(&stream.topic)?, joints),
                command: Box::new(CommandTopics::new(streams, stream)),
            },
            SampleKind::TwinState => Self::TwinState {
                expected: JointTopic::new(file.add(&stream.topic)?, joints),
                residual: JointTopic::new(file.add(&streams.residual_topic(stream))?, joints),
            },
            SampleKind::Detection => {
                let events = match *detections {
                    Some(topic) => topic,
                    None => *detections.insert(file.add(&stream.topic)?),
                };
                Self::Detection(Box::new(DetectionTopics::new(
                    file, streams, stream, events,
                )?))
            }
            SampleKind::Health => Self::Health,
        })
    }
}
