//! A rosbag2 bag: a folder with `metadata.yaml` and one file or several that follow each other in
//! time.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;

/// What a bag's folder says of it.
#[derive(Debug)]
pub(crate) struct BagFolder {
    /// Its files, in the order they were written.
    pub(crate) files: Vec<PathBuf>,
    /// Each message is packed for itself.
    pub(crate) packed_messages: bool,
    pub(crate) damage: Vec<Damage>,
}

#[derive(Deserialize)]
struct BagFile {
    rosbag2_bagfile_information: BagInformation,
}

/// The keys of `metadata.yaml` that matter here; the files themselves know the rest better.
#[derive(Deserialize)]
struct BagInformation {
    relative_file_paths: Vec<PathBuf>,
    #[serde(default)]
    compression_format: String,
    #[serde(default)]
    compression_mode: String,
}

const METADATA: &str = "metadata.yaml";
/// Longest `metadata.yaml` \[bytes\]: some 100 000 files.
/// Resolution: bounds memory.
const MAX_METADATA_BYTES: u64 = 16 << 20;

impl BagFolder {
    pub(crate) fn read(folder: &Path) -> Result<Self, ArchiveError> {
        let metadata = folder.join(METADATA);
        if metadata.is_file() {
            Self::from_metadata(folder, &metadata)
        } else {
            Self::from_files(folder, &metadata)
        }
    }

    fn from_metadata(folder: &Path, metadata: &Path) -> Result<Self, ArchiveError> {
        let unreadable = |reason: String| ArchiveError::Unreadable {
            path: metadata.to_owned(),
            reason,
        };
        let bytes = std::fs::metadata(metadata)
            .map_err(ArchiveError::io(metadata))?
            .len();
        if bytes > MAX_METADATA_BYTES {
            return Err(unreadable(format!(
                "{bytes} bytes, the limit is {MAX_METADATA_BYTES}"
            )));
        }
        let text = std::fs::read_to_string(metadata).map_err(ArchiveError::io(metadata))?;
        let BagFile {
            rosbag2_bagfile_information: bag,
        } = serde_saphyr::from_str(&text).map_err(|error| unreadable(error.to_string()))?;
        let packed_messages = match bag.compression_mode.to_lowercase().as_str() {
            "" | "none" => false,
            "message" if bag.compression_format == "zstd" => true,
            "file" => {
                return Err(unreadable(format!(
                    "the bag's files are packed as a whole ({}): unpack them first, and set \
                     compression_mode to \"\"",
                    bag.compression_format
                )));
            }
            mode => {
                return Err(unreadable(format!(
                    "compression mode {mode:?} with {:?} is not known",
                    bag.compression_format
                )));
            }
        };
        let files = bag.relative_file_paths.iter();
        let files = files.map(|path| find(folder, path)).collect();
        Ok(Self {
            files,
            packed_messages,
            damage: Vec::new(),
        })
    }

    /// A recorder that was killed leaves no `metadata.yaml`.
    fn from_files(folder: &Path, metadata: &Path) -> Result<Self, ArchiveError> {
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(ArchiveError::io(folder))? {
            let path = entry.map_err(ArchiveError::io(folder))?.path();
            let extension = path.extension().unwrap_or_default();
            if extension == "mcap" || extension == "db3" {
                files.push(path);
            }
        }
        if files.is_empty() {
            return Err(ArchiveError::UnknownFormat {
                path: folder.to_owned(),
                reason: format!("a folder without {METADATA}, .mcap or .db3 files"),
            });
        }
        files.sort_by_key(|path| split_number(path));
        Ok(Self {
            files,
            packed_messages: false,
            damage: vec![Damage {
                path: metadata.to_owned(),
                at: 0,
                kind: DamageKind::Index {
                    reason: format!("there is no {METADATA}"),
                },
                readable_until_ns: None,
            }],
        })
    }
}

/// Older bags give paths that begin with the folder itself.
fn find(folder: &Path, path: &Path) -> PathBuf {
    let direct = folder.join(path);
    match path.file_name() {
        Some(name) if !direct.exists() => folder.join(name),
        _ => direct,
    }
}

/// `bag_10.mcap` comes after `bag_9.mcap`.
fn split_number(path: &Path) -> (u64, PathBuf) {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let number = stem.rsplit('_').next().and_then(|text| text.parse().ok());
    (number.unwrap_or(0), path.to_owned())
}
