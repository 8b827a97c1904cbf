//! Rebuilds an MCAP file whose writer died, or that was damaged since.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};

use crate::cursor::Cursor;
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::mcap_file::{Layout, McapCursor, Order, attachment_header};
use crate::mcap_write::{self, Compression, WriteError, Written};
use crate::recording::{Recording, RecordingKind};
use crate::whole_file::{self, Existing};

/// Name of the metadata record that says what was repaired.
const REPAIR: &str = "tauscope_repair";
/// Chunks of a repaired file have at least this size, but for the last \[bytes\].
/// Resolution: the file's size, against memory and what a damaged chunk costs.
const CHUNK_BYTES: usize = 1 << 20;

/// Why a recording cannot be repaired.
#[derive(Debug, thiserror::Error)]
pub enum RepairError {
    /// It cannot be read at all.
    #[error(transparent)]
    Read(#[from] ArchiveError),
    /// The new file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Something lies where the new file should go.
    #[error("{}: is there already", path.display())]
    Exists {
        /// Where.
        path: PathBuf,
    },
}

/// What [`repair`] has made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repaired {
    /// The new file.
    pub written: Written,
    /// What of the old one could not be taken over. Empty if it was whole.
    pub damage: Vec<Damage>,
}

/// Where [`repair`] puts its file: `a.repaired.mcap` beside `a.mcap` or `a.mcap.part`.
pub fn repaired_path(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".part").unwrap_or(&name);
    let stem = stem.strip_suffix(".mcap").unwrap_or(stem);
    path.with_file_name(format!("{stem}.repaired.mcap"))
}

/// Writes all that can be read of the MCAP file `from` into the new file `to`, in the order in which
/// it lies there, with a sound index. A metadata record `tauscope_repair` says what was damaged.
/// `from` is not touched.
///
/// # Errors
/// If `from` is no MCAP file or cannot be read from its first record, or `to` is there already or
/// cannot be written.
pub fn repair(from: &Path, to: &Path) -> Result<Repaired, RepairError> {
    if to.try_exists().map_err(ArchiveError::io(to))? {
        return Err(RepairError::Exists {
            path: to.to_owned(),
        });
    }
    let recording = Recording::open(from)?;
    if recording.kind() != RecordingKind::Mcap {
        return Err(RepairError::Read(ArchiveError::UnknownFormat {
            path: from.to_owned(),
            reason: format!("{}; only MCAP files can be repaired", recording.kind()),
        }));
    }
    let layout = Arc::new(Layout::read(from)?);
    let part = whole_file::part_of(to);
    whole_file::begin(&part);
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .open(&part)
        .map_err(mcap_write::io(&part))?;
    let writer = mcap_write::options(Compression::Zstd)
        .profile(&layout.profile)
        .library(&layout.library)
        .create(BufWriter::new(file))
        .map_err(mcap_write::mcap(&part))?;
    let mut copy = Copy {
        damage: layout.damage.clone(),
        layout,
        writer,
        part,
        messages: 0,
    };
    copy.declare()?;
    copy.messages()?;
    copy.attachments()?;
    copy.metadata()?;
    let bytes = mcap_write::complete(copy.writer, &copy.part, to, Existing::Keep)?;
    Ok(Repaired {
        written: Written {
            path: to.to_owned(),
            messages: copy.messages,
            bytes,
        },
        damage: copy.damage,
    })
}

struct Copy {
    layout: Arc<Layout>,
    writer: mcap::Writer<BufWriter<File>>,
    part: PathBuf,
    messages: u64,
    damage: Vec<Damage>,
}

impl Copy {
    /// Schemas and channels, with the numbers they had.
    fn declare(&mut self) -> Result<(), WriteError> {
        for (&id, schema) in &self.layout.schemas {
            self.writer
                .add_schema_with_id(id, &schema.name, &schema.encoding, &schema.data)
                .map_err(mcap_write::mcap(&self.part))?;
        }
        for (&id, channel) in &self.layout.channels {
            // A schema that lay behind the tear is gone.
            let known = self.layout.schemas.contains_key(&channel.schema_id);
            self.writer
                .add_channel_with_id(
                    id,
                    if known { channel.schema_id } else { 0 },
                    &channel.topic,
                    &channel.message_encoding,
                    &channel.metadata,
                )
                .map_err(mcap_write::mcap(&self.part))?;
        }
        Ok(())
    }

    fn messages(&mut self) -> Result<(), RepairError> {
        let every = |channel| Some(usize::from(channel));
        let mut cursor = McapCursor::new(Arc::clone(&self.layout), Order::File, every)?;
        let mut chunk_bytes = 0;
        loop {
            match cursor.advance() {
                Ok(true) => {}
                Ok(false) => return Ok(()),
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
                return Ok(());
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
            self.messages += 1;
            chunk_bytes += message.body.len();
            if chunk_bytes >= CHUNK_BYTES {
                chunk_bytes = 0;
                self.writer.flush().map_err(mcap_write::mcap(&self.part))?;
            }
        }
    }

    fn attachments(&mut self) -> Result<(), RepairError> {
        let layout = Arc::clone(&self.layout);
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
            self.attachment(&mut file, header, data_len)?;
        }
        Ok(())
    }

    fn attachment(
        &mut self,
        from: &mut File,
        header: mcap::records::AttachmentHeader,
        len: u64,
    ) -> Result<(), RepairError> {
        self.writer
            .start_attachment(len, header)
            .map_err(mcap_write::mcap(&self.part))?;
        let mut left = from.take(len);
        let mut piece = vec![0; 64 << 10];
        loop {
            let read = left
                .read(&mut piece)
                .map_err(ArchiveError::io(&self.layout.path))?;
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

    fn metadata(&mut self) -> Result<(), WriteError> {
        let damage = self.damage.iter().enumerate();
        let mut report: BTreeMap<_, _> = damage
            .map(|(i, damage)| (format!("damage_{i}"), damage.to_string()))
            .collect();
        let source = self.layout.path.file_name().unwrap_or_default();
        report.insert("source".to_owned(), source.to_string_lossy().into_owned());
        let report = Metadata {
            name: REPAIR.to_owned(),
            metadata: report,
        };
        for metadata in self.layout.metadata.iter().chain([&report]) {
            self.writer
                .write_metadata(metadata)
                .map_err(mcap_write::mcap(&self.part))?;
        }
        Ok(())
    }
}
