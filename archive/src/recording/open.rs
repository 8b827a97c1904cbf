//! Opening of the recording at a path, with detection of its format.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::several::Part;
use super::{Recording, RecordingKind, Store};
use crate::bag_folder::BagFolder;
use crate::csv_file::{self, CsvMapping, CsvTable};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::file_kind::{self, file_kind};
use crate::lerobot::{self, Episode};
use crate::mcap_file::Layout;
use crate::parquet_file;
use crate::ros::{JointState, Message as _};
use crate::ros1_bag::{self, Ros1Bag};
use crate::sqlite_file::{self, SqliteFile};
use crate::topic::{Topic, Topics};

impl Recording {
    /// Opens the recording at `path`: an MCAP file (also an unfinished `.part`), the folder of a
    /// rosbag2 bag with MCAP or SQLite files, one such SQLite file, a bag of ROS 1 (`.bag`), a table
    /// (`.csv`) with a recognised header or a file `NAME.columns.yaml`, or an episode of a LeRobot data
    /// set (`DATASET/episode_000003`, or the set's folder or Parquet file if it holds one episode).
    ///
    /// Of an MCAP file or a bag of ROS 1 with a sound index, only the index is read; without one, the whole file is
    /// read once. The rows of a database are counted once, and an episode is read once.
    ///
    /// # Errors
    /// [`ArchiveError::Io`]; [`ArchiveError::UnknownFormat`]; [`ArchiveError::Unreadable`] if not
    /// even its first record can be read. A recording that can be read in part is no error; see
    /// [`Recording::damage`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ArchiveError> {
        let path = path.as_ref();
        if let Some(place) = lerobot::locate(path)? {
            return Self::open_episode(path, place);
        }
        if path.is_dir() {
            return Self::open_folder(path);
        }
        if path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("csv"))
            && path.exists()
        {
            let (mapping, remark) = csv_file::mapping_of(path)?;
            let table = CsvTable::check(path, &mapping, &[], remark)?;
            return Ok(Self::from_csv(path, table));
        }
        Self::open_file(path)
    }

    fn open_file(path: &Path) -> Result<Self, ArchiveError> {
        let mut beginning = Vec::new();
        File::open(path)
            .and_then(|file| file.take(16).read_to_end(&mut beginning))
            .map_err(ArchiveError::io(path))?;
        if beginning.starts_with(mcap::MAGIC) {
            return Ok(Self::from_mcap(Layout::read(path)?));
        }
        if beginning.starts_with(sqlite_file::MAGIC) {
            return Ok(Self::from_sqlite(path, SqliteFile::read(path)?));
        }
        if beginning.starts_with(ros1_bag::MAGIC) {
            return Ok(Self::from_ros1(Ros1Bag::read(path)?));
        }
        if beginning.starts_with(parquet_file::MAGIC) {
            return Self::open_episode(path, lerobot::of_table(path)?);
        }
        if let Some(packing) = file_kind::packing(path) {
            return Err(ArchiveError::Compressed {
                path: path.to_owned(),
                format: packing.words,
                command: packing.command(path),
                others: 0,
            });
        }
        let reason = match file_kind(path) {
            Some("empty") => "the file is empty".to_owned(),
            Some(kind) => format!("it is {kind}"),
            None => "it begins as no MCAP file, SQLite database, ROS 1 bag or Parquet table does"
                .to_owned(),
        };
        Err(ArchiveError::UnknownFormat {
            path: path.to_owned(),
            reason,
        })
    }

    fn from_mcap(layout: Layout) -> Self {
        let time = |ns: u64| i64::try_from(ns).unwrap_or(i64::MAX);
        let mut metadata: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
        for record in &layout.metadata {
            let entries = metadata.entry(record.name.clone()).or_default();
            entries.extend(record.metadata.clone());
        }
        Self {
            path: layout.path.clone(),
            kind: RecordingKind::Mcap,
            topics: Arc::new(layout.topics()),
            log_times_ns: layout
                .log_times
                .map(|(start, end)| (time(start), time(end))),
            bytes: layout.file_bytes,
            metadata,
            damage: layout.damage.clone(),
            store: Store::Mcap(Arc::new(layout)),
        }
    }

    fn from_sqlite(path: &Path, file: SqliteFile) -> Self {
        let mut topics = Topics::default();
        let numbers = file.topics.iter().map(|(id, topic)| {
            let index = topics.add_stored(topic.clone(), "");
            (*id, index)
        });
        let numbers = numbers.collect();
        Self {
            path: path.to_owned(),
            kind: RecordingKind::Sqlite,
            topics: Arc::new(topics),
            log_times_ns: file.log_times_ns,
            bytes: length(path),
            metadata: BTreeMap::new(),
            damage: file.damage.clone(),
            store: Store::Sqlite {
                file: Box::new(file),
                numbers,
            },
        }
    }

    fn from_ros1(bag: Ros1Bag) -> Self {
        let (topics, places) = bag.topics();
        Self {
            path: bag.path.clone(),
            kind: RecordingKind::Ros1Bag,
            topics: Arc::new(topics),
            log_times_ns: bag.log_times_ns,
            bytes: bag.file_bytes,
            metadata: BTreeMap::new(),
            damage: bag.damage.clone(),
            store: Store::Ros1 {
                bag: Arc::new(bag),
                topics: places,
            },
        }
    }

    fn open_folder(folder: &Path) -> Result<Self, ArchiveError> {
        let bag = BagFolder::read(folder)?;
        let mut damage = bag.damage;
        let mut parts = Vec::new();
        let mut topics = Topics::default();
        let mut compressed = Vec::new();
        for file in &bag.files {
            let recording = match Self::open_file(file) {
                Ok(recording) => recording,
                Err(error) => {
                    damage.push(missing(file, &error));
                    if matches!(error, ArchiveError::Compressed { .. }) {
                        compressed.push(error);
                    }
                    continue;
                }
            };
            damage.extend_from_slice(recording.damage());
            parts.push(Part {
                topics: topics.add_part(&recording.topics),
                recording,
            });
        }
        if parts.is_empty() {
            return Err(none_of(folder, compressed, &damage));
        }
        let recordings = || parts.iter().map(|part| &part.recording);
        let start_ns = recordings().filter_map(Recording::start_ns).min();
        let end_ns = recordings().filter_map(Recording::end_ns).max();
        let mut metadata = BTreeMap::new();
        for recording in recordings() {
            metadata.extend(recording.metadata().clone());
        }
        Ok(Self {
            path: folder.to_owned(),
            kind: RecordingKind::Rosbag2,
            topics: Arc::new(topics),
            log_times_ns: start_ns.zip(end_ns),
            bytes: recordings().map(Recording::bytes).sum(),
            metadata,
            damage,
            store: Store::Several(Arc::new(parts)),
        })
    }

    fn open_episode(path: &Path, place: lerobot::Place) -> Result<Self, ArchiveError> {
        let (root, number) = place.one()?;
        let episode = Episode::check(&root, number)?;
        Ok(Self {
            path: path.to_owned(),
            kind: RecordingKind::Lerobot,
            topics: Arc::new(joint_states(lerobot::TOPIC, episode.rows)),
            log_times_ns: episode.times_ns,
            bytes: episode.bytes(),
            metadata: BTreeMap::new(),
            damage: Vec::new(),
            store: Store::Lerobot(Box::new(episode)),
        })
    }

    /// Opens the table at `path`, with `joints` as the names that its columns stand for unless the
    /// mapping has its own. Its rows appear as joint states on the topic `/joint_states`.
    ///
    /// All of it is read and checked: once, or twice if the unit of its time has to be recognised.
    /// [`Recording::remarks`] reports what was recognised.
    ///
    /// # Errors
    /// [`ArchiveError::Io`]; [`ArchiveError::CsvMapping`] if the mapping does not fit the table;
    /// [`ArchiveError::Csv`] with the first malformed line.
    pub fn open_csv(
        path: impl AsRef<Path>,
        mapping: &CsvMapping,
        joints: &[String],
    ) -> Result<Self, ArchiveError> {
        let path = path.as_ref();
        let table = CsvTable::check(path, mapping, joints, None)?;
        Ok(Self::from_csv(path, table))
    }

    fn from_csv(path: &Path, table: CsvTable) -> Self {
        Self {
            path: path.to_owned(),
            kind: RecordingKind::Csv,
            topics: Arc::new(joint_states(csv_file::TOPIC, table.rows)),
            log_times_ns: table.times_ns,
            bytes: length(path),
            metadata: BTreeMap::new(),
            damage: table.damage.clone(),
            store: Store::Csv(Box::new(table)),
        }
    }
}

/// Returns the only topic of a table.
fn joint_states(name: &str, message_count: u64) -> Topics {
    let mut topics = Topics::default();
    let topic = Topic {
        name: name.to_owned(),
        type_name: JointState::TYPE.to_owned(),
        message_encoding: "cdr".to_owned(),
        type_hash: Some(JointState::TYPE_HASH.to_owned()),
        offered_qos: None,
        message_count,
    };
    topics.add_stored(topic, "");
    topics
}

/// Returns the error for a bag without a readable file: compressed files first, because the user can unpack them.
fn none_of(folder: &Path, mut compressed: Vec<ArchiveError>, damage: &[Damage]) -> ArchiveError {
    let count = compressed.len();
    if let Some(mut error) = compressed.drain(..).next() {
        if let ArchiveError::Compressed { others, .. } = &mut error {
            *others = count - 1;
        }
        return error;
    }
    let first = damage.iter().find(|damage| damage.loses_data());
    ArchiveError::Unreadable {
        path: folder.to_owned(),
        reason: first.map_or_else(|| "the bag lists no files".to_owned(), ToString::to_string),
    }
}

/// A file of a bag that cannot be opened.
fn missing(file: &Path, error: &ArchiveError) -> Damage {
    Damage {
        path: PathBuf::from(file),
        at: 0,
        kind: DamageKind::File {
            reason: error.to_string(),
        },
        readable_until_ns: None,
    }
}

/// Returns the length of a file that has just been read; 0 if it has been removed since.
fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}
