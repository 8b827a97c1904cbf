//! Repair of MCAP files. It rebuilds a file whose writer crashed or that was damaged later, and joins the pieces of a
//! writer that crashed several times.

mod error;
mod folder;

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};

use crate::chunks::Order;
use crate::cursor::Cursor;
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::mcap_file::{Layout, attachment_header, mcap_cursor};
use crate::mcap_write::rosbag2::{self, BagFile, BagTopic};
use crate::mcap_write::{self, Compression, WriteError, Written};
use crate::recording::{Recording, RecordingKind};
use crate::whole_file::{self, Existing};

pub use error::RepairError;
pub use folder::{RepairedFolder, repair_folder, repaired_folder_path};

/// Name of the metadata record with the repair report.
const REPAIR: &str = "tauscope_repair";
/// Name of the metadata record that rosbag2 expects.
const ROSBAG2: &str = "rosbag2";
/// Minimum size of the chunks of a repaired file, except the last \[bytes\].
/// Resolution: the file's size, against memory and the loss by a damaged chunk.
const CHUNK_BYTES: usize = 1 << 20;

/// Result of [`repair`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repaired {
    /// The new file.
    pub written: Written,
    /// The source files, in the order of their times.
    pub from: Vec<PathBuf>,
    /// Parts of the source files that could not be recovered. Empty if they were intact.
    pub damage: Vec<Damage>,
    /// Path to which [`repair_in_place`] moved a damaged file that lost more than its torn end.
    pub set_aside: Option<PathBuf>,
}

/// Returns the default path of a repaired file: `a.repaired.mcap` next to `a.mcap` or `a.mcap.part`.
pub fn repaired_path(path: &Path) -> PathBuf {
    path.with_file_name(format!("{}.repaired.mcap", stem(path)))
}

/// Returns `a` for `a.mcap` and for `a.mcap.part`.
fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".part").unwrap_or(&name);
    stem.strip_suffix(".mcap").unwrap_or(stem).to_owned()
}

/// Writes all readable data of the MCAP files `pieces` into the new file `to`. The pieces follow each other in the
/// order of their times, each in its file order. The new file has a sound index, statistics and the metadata that
/// rosbag2 expects. Its metadata record `tauscope_repair` lists the damage. The pieces are not modified.
///
/// # Errors
/// If a piece is not an MCAP file, is being written or cannot be read from its first record, or if `to` already
/// exists or cannot be written.
pub fn repair(pieces: &[impl AsRef<Path>], to: &Path) -> Result<Repaired, RepairError> {
    let part = whole_file::part_of(to);
    write(pieces, to, &part)
}

/// Repairs `part`, the file `a.mcap.part` of a crashed writer of `a.mcap`. The result is `a.mcap`, or the first free
/// name of `a.1.mcap`, `a.2.mcap`, ... Once the new file is on the disk, `part` is removed if only its torn end was
/// lost. Otherwise it is renamed to `a.mcap.damaged`, so that it is not mistaken for an unrepaired file.
///
/// # Errors
/// As [`repair`]; `part` is then kept.
pub fn repair_in_place(part: &Path) -> Result<Repaired, RepairError> {
    let held = File::open(part).map_err(ArchiveError::io(part))?;
    if held.try_lock().is_err() {
        return Err(RepairError::BeingWritten {
            path: part.to_owned(),
        });
    }
    let name = part.with_extension("");
    let to = whole_file::unused_name(&name).map_err(ArchiveError::io(&name))?;
    let work = part.with_file_name(format!("{}.repairing.mcap.part", stem(part)));
    let mut repaired = write_held(&[part], &to, &work)?;
    let torn = |damage: &Damage| damage.kind == DamageKind::TornTail || !damage.loses_data();
    let settled = if repaired.damage.iter().all(torn) {
        fs::remove_file(part).and_then(|()| whole_file::sync_folder_of(part))
    } else {
        whole_file::set_damaged_aside(part).map(|aside| repaired.set_aside = Some(aside))
    };
    settled.map_err(ArchiveError::io(part))?;
    Ok(repaired)
}

fn write(pieces: &[impl AsRef<Path>], to: &Path, work: &Path) -> Result<Repaired, RepairError> {
    for piece in pieces {
        let path = piece.as_ref();
        if whole_file::is_being_written(path).map_err(ArchiveError::io(path))? {
            let path = path.to_owned();
            return Err(RepairError::BeingWritten { path });
        }
    }
    write_held(pieces, to, work)
}

/// Like [`repair`], through the unfinished file `work`, for pieces that are not being written.
fn write_held(
    pieces: &[impl AsRef<Path>],
    to: &Path,
    work: &Path,
) -> Result<Repaired, RepairError> {
    if to.try_exists().map_err(ArchiveError::io(to))? {
        return Err(RepairError::Exists {
            path: to.to_owned(),
        });
    }
    let mut layouts = Vec::new();
    for piece in pieces {
        layouts.push(Arc::new(layout(piece.as_ref())?));
    }
    layouts.sort_by_key(|layout| layout.log_times.map(|(start_ns, _)| start_ns));
    let Some(first) = layouts.first() else {
        let path = to.to_owned();
        return Err(RepairError::NothingThere { path });
    };
    let anew = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .clone();
    let file = whole_file::create(work, &anew).map_err(mcap_write::io(work))?;
    let writer = mcap_write::options(Compression::Zstd)
        .profile(&first.profile)
        .library(&first.library)
        .create(BufWriter::new(file))
        .map_err(mcap_write::mcap(work))?;
    let mut copy = Copy {
        damage: Vec::new(),
        topics: BTreeMap::new(),
        log_times_ns: None,
        metadata: Vec::new(),
        writer,
        part: work.to_owned(),
    };
    for layout in &layouts {
        copy.piece(layout)?;
    }
    copy.finish_metadata(&layouts, to)?;
    let messages = copy.topics.values().map(|topic| topic.messages).sum();
    let bytes = mcap_write::complete(copy.writer, &copy.part, to, Existing::Keep)?;
    Ok(Repaired {
        written: Written {
            path: to.to_owned(),
            messages,
            bytes,
        },
        from: layouts.iter().map(|layout| layout.path.clone()).collect(),
        damage: copy.damage,
        set_aside: None,
    })
}

fn layout(path: &Path) -> Result<Layout, RepairError> {
    let recording = Recording::open(path)?;
    if recording.kind() != RecordingKind::Mcap {
        return Err(RepairError::Read(ArchiveError::UnknownFormat {
            path: path.to_owned(),
            reason: format!("{}; only MCAP files can be repaired", recording.kind()),
        }));
    }
    Ok(Layout::read(path)?)
}

struct Copy {
    writer: mcap::Writer<BufWriter<File>>,
    part: PathBuf,
    /// Topics by channel of the new file.
    topics: BTreeMap<u16, BagTopic>,
    log_times_ns: Option<(i64, i64)>,
    /// Metadata records in the new file.
    metadata: Vec<Metadata>,
    damage: Vec<Damage>,
}

impl Copy {
    fn piece(&mut self, layout: &Arc<Layout>) -> Result<(), RepairError> {
        self.damage.extend_from_slice(&layout.damage);
        let channels = self.declare(layout)?;
        self.messages(layout, &channels)?;
        self.attachments(layout)?;
        Ok(self.metadata(layout)?)
    }

    /// Declares the schemas and channels: those of the first piece with their old numbers, and the new ones of each
    /// further piece. Returns the new number of each channel.
    fn declare(&mut self, layout: &Layout) -> Result<BTreeMap<u16, u16>, WriteError> {
        let first = self.topics.is_empty();
        let mut schemas = BTreeMap::new();
        for (&id, schema) in &layout.schemas {
            let (name, encoding, data) = (&schema.name, &schema.encoding, &schema.data);
            let new = if first {
                self.writer.add_schema_with_id(id, name, encoding, data)
            } else {
                self.writer.add_schema(name, encoding, data)
            };
            schemas.insert(id, new.map_err(mcap_write::mcap(&self.part))?);
        }
        let mut channels = BTreeMap::new();
        for (&id, channel) in &layout.channels {
            // A schema behind the torn end is lost.
            let schema = schemas.get(&channel.schema_id).copied().unwrap_or(0);
            let (topic, encoding) = (&channel.topic, &channel.message_encoding);
            let metadata = &channel.metadata;
            let new = if first {
                self.writer
                    .add_channel_with_id(id, schema, topic, encoding, metadata)
            } else {
                self.writer.add_channel(schema, topic, encoding, metadata)
            };
            let new = new.map_err(mcap_write::mcap(&self.part))?;
            channels.insert(id, new);
            let of = |key: &str| channel.metadata.get(key).cloned();
            let type_of = layout.schemas.get(&channel.schema_id);
            self.topics.entry(new).or_insert_with(|| BagTopic {
                name: topic.clone(),
                type_name: type_of.map_or_else(String::new, |schema| schema.name.clone()),
                encoding: encoding.clone(),
                type_hash: of("topic_type_hash").unwrap_or_default(),
                offered_qos: of("offered_qos_profiles"),
                messages: 0,
            });
        }
        Ok(channels)
    }

    fn messages(
        &mut self,
        layout: &Arc<Layout>,
        channels: &BTreeMap<u16, u16>,
    ) -> Result<(), RepairError> {
        let every = |channel| channels.get(&channel).map(|&new| usize::from(new));
        let mut cursor = mcap_cursor(Arc::clone(layout), Order::File, every)?;
        let mut chunk_bytes = 0;
        loop {
            match cursor.advance() {
                Ok(true) => {}
                Ok(false) => break,
                Err(ArchiveError::Damaged(damage)) => {
                    // A flaw within a torn or plain part may have been found before.
                    if !self.damage.contains(&damage) {
                        self.damage.push(damage);
                    }
                    continue;
                }
                Err(error) => return Err(error.into()),
            }
            let Some(message) = cursor.current() else {
                break;
            };
            let header = MessageHeader {
                channel_id: message.topic as u16,
                sequence: message.sequence,
                log_time: message.log_time_ns as u64,
                publish_time: message.publish_time_ns as u64,
            };
            self.writer
                .write_to_known_channel(&header, message.body)
                .map_err(mcap_write::mcap(&self.part))?;
            if let Some(topic) = self.topics.get_mut(&header.channel_id) {
                topic.messages += 1;
            }
            let ns = message.log_time_ns;
            let (start_ns, end_ns) = self.log_times_ns.unwrap_or((ns, ns));
            self.log_times_ns = Some((start_ns.min(ns), end_ns.max(ns)));
            chunk_bytes += message.body.len();
            if chunk_bytes >= CHUNK_BYTES {
                chunk_bytes = 0;
                self.writer.flush().map_err(mcap_write::mcap(&self.part))?;
            }
        }
        // The next piece begins a chunk of its own.
        Ok(self.writer.flush().map_err(mcap_write::mcap(&self.part))?)
    }

    fn attachments(&mut self, layout: &Layout) -> Result<(), RepairError> {
        let mut file = File::open(&layout.path).map_err(ArchiveError::io(&layout.path))?;
        for &(at, len) in &layout.attachments {
            file.seek(SeekFrom::Start(at))
                .map_err(ArchiveError::io(&layout.path))?;
            let Some((header, data_at, data_len)) =
                attachment_header(&mut file, len).map_err(ArchiveError::io(&layout.path))?
            else {
                let reason = "an attachment that makes no sense".to_owned();
                self.damage.push(Damage {
                    path: layout.path.clone(),
                    at,
                    kind: DamageKind::Record { reason },
                    readable_until_ns: None,
                });
                continue;
            };
            file.seek(SeekFrom::Start(at + data_at))
                .map_err(ArchiveError::io(&layout.path))?;
            self.attachment(&mut file, &layout.path, header, data_len)?;
        }
        Ok(())
    }

    fn attachment(
        &mut self,
        from: &mut File,
        path: &Path,
        header: mcap::records::AttachmentHeader,
        len: u64,
    ) -> Result<(), RepairError> {
        self.writer
            .start_attachment(len, header)
            .map_err(mcap_write::mcap(&self.part))?;
        let mut left = from.take(len);
        let mut piece = vec![0; 64 << 10];
        loop {
            let read = left.read(&mut piece).map_err(ArchiveError::io(path))?;
            if read == 0 {
                break;
            }
            self.writer
                .put_attachment_bytes(&piece[..read])
                .map_err(mcap_write::mcap(&self.part))?;
        }
        self.writer
            .finish_attachment()
            .map_err(mcap_write::mcap(&self.part))?;
        Ok(())
    }

    /// Copies the metadata records of a piece, except those of earlier pieces and the `rosbag2` record, which is
    /// rewritten.
    fn metadata(&mut self, layout: &Layout) -> Result<(), WriteError> {
        for metadata in &layout.metadata {
            if metadata.name != ROSBAG2 && !self.metadata.contains(metadata) {
                self.write_metadata(metadata.clone())?;
            }
        }
        Ok(())
    }

    fn finish_metadata(&mut self, pieces: &[Arc<Layout>], to: &Path) -> Result<(), WriteError> {
        let damage = self.damage.iter().enumerate();
        let mut report: BTreeMap<_, _> = damage
            .map(|(i, damage)| (format!("damage_{i}"), damage.to_string()))
            .collect();
        let source = |layout: &Arc<Layout>| {
            let name = layout.path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        };
        let sources: Vec<String> = pieces.iter().map(source).collect();
        report.insert("source".to_owned(), sources.join(", "));
        self.write_metadata(Metadata {
            name: REPAIR.to_owned(),
            metadata: report,
        })?;
        if pieces.iter().all(|layout| layout.profile != "ros2") {
            return Ok(());
        }
        let topics: Vec<BagTopic> = self.topics.values().cloned().collect();
        let bag = rosbag2::information(&topics, &[BagFile::new(to, self.log_times_ns)])
            .map_err(mcap_write::yaml(&self.part))?;
        self.write_metadata(Metadata {
            name: ROSBAG2.to_owned(),
            metadata: BTreeMap::from([("serialized_metadata".to_owned(), bag)]),
        })
    }

    fn write_metadata(&mut self, metadata: Metadata) -> Result<(), WriteError> {
        self.writer
            .write_metadata(&metadata)
            .map_err(mcap_write::mcap(&self.part))?;
        self.metadata.push(metadata);
        Ok(())
    }
}
