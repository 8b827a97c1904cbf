//! Writing MCAP files as ROS 2 does.

mod disk_sync;
mod error;
mod options;
pub(crate) mod rosbag2;
mod summary_order;

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::BufWriter;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::Duration;

use mcap::records::{MessageHeader, Metadata};

use crate::ros;
use crate::whole_file::{self, Existing, part_of};
use disk_sync::DiskSync;
pub use error::WriteError;
pub(crate) use error::{io, mcap, yaml};
pub use options::Compression;
pub(crate) use options::options;

/// Maximum log time spanned by a chunk \[ns\]. A full chunk is handed to the operating system, so a killed process
/// loses at most this span.
/// Resolution: the file's size, against the loss when the process is killed.
pub const CHUNK_SPAN_NS: i64 = 100_000_000;
/// Size at which a chunk is closed early \[bytes\].
/// Resolution: memory, against the file's size.
const CHUNK_BYTES: usize = 1 << 20;
/// Upper bound on the size of the index per chunk, with a dozen topics \[bytes\].
/// Resolution: the disk space reserved for the end of an open file.
const INDEX_BYTES_A_CHUNK: u64 = 500;
/// Name of the writing library in the header. The version is in the provenance.
const LIBRARY: &str = "tauscope";
/// Name of the metadata record with the provenance.
pub const PROVENANCE: &str = "tauscope";

/// Writes one MCAP file: profile `ros2`, CDR messages with their `ros2msg` text, and the metadata
/// that rosbag2 looks for.
///
/// While it is written the file is called `<name>.mcap.part`; [`McapWriter::finish`] completes and renames it. So a
/// file with its final name is complete. A writer that crashed leaves a `.part` that
/// [`Recording::open`](crate::Recording::open) reads and [`repair`](crate::repair()) completes.
///
/// The same calls produce the same bytes on any machine. Memory is bounded by the open chunk, except for the index,
/// which grows by about 300 bytes with each chunk (10 MB an hour).
pub struct McapWriter {
    writer: mcap::Writer<BufWriter<File>>,
    /// Second handle of the file, to sync it and to query its length.
    file: File,
    path: PathBuf,
    part: PathBuf,
    set_aside: Option<PathBuf>,
    existing: Existing,
    sync: Option<DiskSync>,
    topics: Vec<WrittenTopic>,
    /// Log time of the first message in the open chunk.
    chunk_start_ns: Option<i64>,
    chunk_bytes: usize,
    /// Number of closed chunks.
    chunks: u64,
    /// Length of the file when the last chunk was closed.
    bytes: u64,
    log_times_ns: Option<(i64, i64)>,
    body: Vec<u8>,
}

/// A topic of a [`McapWriter`] that carries messages of type `M`.
#[derive(Debug)]
pub struct TopicWriter<M> {
    index: usize,
    of: PhantomData<fn(M)>,
}

impl<M> Clone for TopicWriter<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for TopicWriter<M> {}

struct WrittenTopic {
    name: String,
    type_name: &'static str,
    type_hash: &'static str,
    channel: u16,
    count: u64,
}

/// Result of [`McapWriter::finish`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// The file.
    pub path: PathBuf,
    /// Messages in it.
    pub messages: u64,
    /// Its length \[bytes\].
    pub bytes: u64,
}

impl McapWriter {
    /// Creates the file `path` as `<path>.part`, and its folder if necessary. The `provenance` (versions, hashes of
    /// the input files) is written first.
    ///
    /// A `.part` that an earlier writer left behind may be the only copy of a recording. It is renamed and kept, see
    /// [`McapWriter::set_aside`].
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(
        path: impl AsRef<Path>,
        compression: Compression,
        provenance: &BTreeMap<String, String>,
    ) -> Result<Self, WriteError> {
        let path = path.as_ref().to_owned();
        let part = part_of(&path);
        if let Some(folder) = path.parent() {
            whole_file::create_folder(folder).map_err(io(folder))?;
        }
        let set_aside = whole_file::set_part_aside(&path).map_err(io(&part))?;
        let new = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .clone();
        let file = whole_file::create(&part, &new).map_err(io(&part))?;
        whole_file::hold(&file).map_err(io(&part))?;
        whole_file::sync_folder_of(&part).map_err(io(&part))?;
        let twin = file.try_clone().map_err(io(&part))?;
        let writer = options(compression)
            .profile("ros2")
            .library(LIBRARY)
            .create(BufWriter::new(file))
            .map_err(mcap(&part))?;
        let mut this = Self {
            writer,
            file: twin,
            path,
            part,
            set_aside,
            existing: Existing::Keep,
            sync: None,
            topics: Vec::new(),
            chunk_start_ns: None,
            chunk_bytes: 0,
            chunks: 0,
            bytes: 0,
            log_times_ns: None,
            body: Vec::new(),
        };
        this.write_metadata(PROVENANCE, provenance)?;
        Ok(this)
    }

    /// Sets the policy for a file that already has the final name. By default it is kept, and the new file gets the
    /// first free name: `a.1.mcap` for `a.mcap`.
    #[must_use]
    pub fn existing(mut self, existing: Existing) -> Self {
        self.existing = existing;
        self
    }

    /// Syncs closed chunks to the disk, at most once per `every`. Without this only the complete file is synced, and
    /// a power failure may lose all of an incomplete one.
    ///
    /// # Errors
    /// If the thread for it cannot be started.
    pub fn synced_every(mut self, every: Duration) -> Result<Self, WriteError> {
        let file = self.file.try_clone();
        let sync = file.and_then(|file| DiskSync::start(file, every));
        self.sync = Some(sync.map_err(io(&self.part))?);
        Ok(self)
    }

    /// Returns the longest duration of a sync.
    pub fn slowest_sync(&self) -> Duration {
        self.sync.as_ref().map_or(Duration::ZERO, DiskSync::slowest)
    }

    /// Returns the estimated size of the index, which is written at the end \[bytes\].
    pub fn index_bytes(&self) -> u64 {
        self.chunks * INDEX_BYTES_A_CHUNK
    }

    /// Returns the length of the file when its last chunk was closed \[bytes\].
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the path to which the `.part` of an earlier writer was moved.
    pub fn set_aside(&self) -> Option<&Path> {
        self.set_aside.as_deref()
    }

    /// Declares a topic with messages of type `M`.
    ///
    /// # Errors
    /// [`WriteError::Mcap`] beyond 65 536 topics, or if an earlier write has failed.
    pub fn add_topic<M: ros::Message>(&mut self, name: &str) -> Result<TopicWriter<M>, WriteError> {
        let schema = self
            .writer
            .add_schema(M::TYPE, "ros2msg", M::definition().as_bytes())
            .map_err(mcap(&self.part))?;
        let metadata = BTreeMap::from([
            (
                "offered_qos_profiles".to_owned(),
                rosbag2::offered_qos_profiles().map_err(yaml(&self.part))?,
            ),
            ("topic_type_hash".to_owned(), M::TYPE_HASH.to_owned()),
        ]);
        let channel = self
            .writer
            .add_channel(schema, name, "cdr", &metadata)
            .map_err(mcap(&self.part))?;
        self.topics.push(WrittenTopic {
            name: name.to_owned(),
            type_name: M::TYPE,
            type_hash: M::TYPE_HASH,
            channel,
            count: 0,
        });
        Ok(TopicWriter {
            index: self.topics.len() - 1,
            of: PhantomData,
        })
    }

    /// Writes a message that was received at `log_time_ns` and sent at `publish_time_ns` \[ns since
    /// the epoch\].
    ///
    /// # Errors
    /// If it cannot be encoded or written, or a time lies before the epoch.
    ///
    /// # Panics
    /// If `topic` belongs to another writer.
    pub fn write<M: ros::Message>(
        &mut self,
        topic: TopicWriter<M>,
        log_time_ns: i64,
        publish_time_ns: i64,
        message: &M,
    ) -> Result<(), WriteError> {
        let topic = &mut self.topics[topic.index];
        let time = |ns: i64| {
            u64::try_from(ns).map_err(|_| WriteError::BeforeEpoch {
                path: self.part.clone(),
                topic: topic.name.clone(),
                ns,
            })
        };
        let (log_time, publish_time) = (time(log_time_ns)?, time(publish_time_ns)?);
        ros::encode(message, &mut self.body).map_err(|source| WriteError::Encode {
            path: self.part.clone(),
            topic: topic.name.clone(),
            source,
        })?;
        let header = MessageHeader {
            channel_id: topic.channel,
            sequence: topic.count as u32,
            log_time,
            publish_time,
        };
        topic.count += 1;

        let late = |start_ns: i64| log_time_ns.abs_diff(start_ns) >= CHUNK_SPAN_NS as u64;
        if self.chunk_start_ns.is_some_and(late) || self.chunk_bytes >= CHUNK_BYTES {
            self.flush()?;
        }
        self.chunk_start_ns.get_or_insert(log_time_ns);
        self.chunk_bytes += self.body.len();
        let (start_ns, end_ns) = self.log_times_ns.unwrap_or((log_time_ns, log_time_ns));
        self.log_times_ns = Some((start_ns.min(log_time_ns), end_ns.max(log_time_ns)));
        self.writer
            .write_to_known_channel(&header, &self.body)
            .map_err(mcap(&self.part))
    }

    /// Closes the open chunk and hands it to the operating system. While a live stream is silent, call this about ten
    /// times a second; otherwise the last messages before the silence stay in memory.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        if self.chunk_start_ns.take().is_none() {
            return Ok(());
        }
        self.chunk_bytes = 0;
        self.writer.flush().map_err(mcap(&self.part))?;
        self.chunks += 1;
        self.bytes = self.file.metadata().map_err(io(&self.part))?.len();
        self.sync
            .as_ref()
            .map_or(Ok(()), |sync| sync.ask().map_err(io(&self.part)))
    }

    /// Completes the file and renames it to its final name, which is [`Written::path`].
    ///
    /// # Errors
    /// If it cannot be written; the `.part` stays.
    pub fn finish(mut self) -> Result<Written, WriteError> {
        if self.existing == Existing::Keep {
            self.path = whole_file::unused_name(&self.path).map_err(io(&self.path))?;
        }
        let bag = self.bag().map_err(yaml(&self.part))?;
        self.write_metadata(
            "rosbag2",
            &BTreeMap::from([("serialized_metadata".to_owned(), bag)]),
        )?;
        let Self {
            writer,
            path,
            part,
            existing,
            topics,
            ..
        } = self;
        let bytes = complete(writer, &part, &path, existing)?;
        Ok(Written {
            messages: topics.iter().map(|topic| topic.count).sum(),
            path,
            bytes,
        })
    }

    /// The metadata of the bag that consists of this one file.
    fn bag(&self) -> Result<String, serde_saphyr::SerializeError> {
        let topics = self.topics.iter().map(|topic| rosbag2::BagTopic {
            name: topic.name.clone(),
            type_name: topic.type_name.to_owned(),
            encoding: "cdr".to_owned(),
            type_hash: topic.type_hash.to_owned(),
            offered_qos: None,
            messages: topic.count,
        });
        let file = rosbag2::BagFile::new(&self.path, self.log_times_ns);
        rosbag2::information(&topics.collect::<Vec<_>>(), &[file])
    }

    fn write_metadata(
        &mut self,
        name: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<(), WriteError> {
        let metadata = Metadata {
            name: name.to_owned(),
            metadata: metadata.clone(),
        };
        self.writer
            .write_metadata(&metadata)
            .map_err(mcap(&self.part))
    }
}

/// Completes the file that `writer` has written as `part` and renames it. Returns its length.
pub(crate) fn complete(
    mut writer: mcap::Writer<BufWriter<File>>,
    part: &Path,
    path: &Path,
    existing: Existing,
) -> Result<u64, WriteError> {
    writer.finish().map_err(mcap(part))?;
    let file = writer
        .into_inner()
        .into_inner()
        .map_err(|error| io(part)(error.into_error()))?;
    summary_order::sort(&file).map_err(io(part))?;
    file.sync_all().map_err(io(part))?;
    let bytes = file.metadata().map_err(io(part))?.len();
    whole_file::put_in_place(part, path, existing).map_err(io(path))?;
    Ok(bytes)
}
