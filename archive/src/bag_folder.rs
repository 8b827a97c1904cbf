//! A rosbag2 bag: a folder with `metadata.yaml` and one file or several that follow each other in
//! time.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::compressed::unpacked_path;
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;

/// Files of a bag.
#[derive(Debug)]
pub(crate) struct BagFolder {
    /// In the order in which they were written.
    pub(crate) files: Vec<PathBuf>,
    pub(crate) damage: Vec<Damage>,
}

#[derive(Deserialize)]
struct BagFile {
    rosbag2_bagfile_information: BagInformation,
}

/// The keys of `metadata.yaml` that are read; the files themselves are the better source for the others.
#[derive(Deserialize)]
struct BagInformation {
    #[serde(default)]
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
    /// Finds the files of the bag in `folder`: those that `metadata.yaml` lists, or if it cannot be used, those in
    /// the folder.
    ///
    /// # Errors
    /// If the folder cannot be read or holds no such file, or the messages are compressed in an unknown format.
    pub(crate) fn read(folder: &Path) -> Result<Self, ArchiveError> {
        let metadata = folder.join(METADATA);
        let own = own_files(folder)?;
        let (reason, lost) = match listed(&metadata)? {
            Err(reason) => (reason, Vec::new()),
            Ok(listed) => match as_listed(folder, &listed, &own) {
                Ok(files) => {
                    let damage = Vec::new();
                    return Ok(Self { files, damage });
                }
                Err(unfit) => unfit,
            },
        };
        if own.is_empty() {
            return Err(ArchiveError::UnknownFormat {
                path: folder.to_owned(),
                reason: format!("a folder without .mcap or .db3 files; {reason}"),
            });
        }
        let mut files: Vec<PathBuf> = own.into_values().collect();
        files.sort_by_key(|path| split_number(path));
        let mut damage = vec![flaw(&metadata, DamageKind::Index { reason })];
        damage.extend(lost.iter().map(|path| {
            let reason = format!("{METADATA} lists it");
            flaw(path, DamageKind::File { reason })
        }));
        Ok(Self { files, damage })
    }
}

/// The listed files. Missing ones are among them if the folder has no other files.
///
/// # Errors
/// The reason why the folder's own files are to be used, and the listed files that are lost.
fn as_listed(
    folder: &Path,
    listed: &[PathBuf],
    own: &BTreeMap<OsString, PathBuf>,
) -> Result<Vec<PathBuf>, (String, Vec<PathBuf>)> {
    let mut files = Vec::new();
    let mut missing = Vec::new();
    for path in listed {
        let file = find(folder, path, own).unwrap_or_else(|| {
            missing.push(folder.join(path));
            folder.join(path)
        });
        files.push(file);
    }
    if files.is_empty() {
        return Err((format!("{METADATA} lists no files"), missing));
    }
    let known: BTreeSet<&PathBuf> = files.iter().collect();
    let unlisted = own.values().filter(|file| !known.contains(file)).count();
    match missing.first() {
        Some(first) if unlisted > 0 || missing.len() == files.len() => {
            let reason = not_there(first, missing.len());
            // Renaming explains at most one missing file by each unlisted one.
            let may_be_renamed = missing.len() <= unlisted;
            Err((reason, if may_be_renamed { Vec::new() } else { missing }))
        }
        _ => Ok(files),
    }
}

/// Returns the files that `metadata.yaml` lists. The inner error is the reason why it cannot be used.
///
/// # Errors
/// If the messages are compressed in an unknown format.
fn listed(metadata: &Path) -> Result<Result<Vec<PathBuf>, String>, ArchiveError> {
    let text = match text(metadata) {
        Ok(text) => text,
        Err(reason) => return Ok(Err(reason)),
    };
    let bag = match serde_saphyr::from_str(&text) {
        Ok(BagFile {
            rosbag2_bagfile_information: bag,
        }) => bag,
        Err(error) => {
            let error = error.to_string();
            let line = error.lines().next().unwrap_or_default();
            return Ok(Err(format!("{METADATA} cannot be parsed: {line}")));
        }
    };
    // Whole compressed files are recognised as they are opened.
    let by_message = bag.compression_mode.eq_ignore_ascii_case("message");
    if by_message && bag.compression_format != "zstd" {
        return Err(ArchiveError::Unreadable {
            path: metadata.to_owned(),
            reason: format!(
                "its messages are compressed as {:?}, and only zstd can be read: `ros2 bag convert` writes them \
                 without compression",
                bag.compression_format
            ),
        });
    }
    Ok(Ok(bag.relative_file_paths))
}

/// Returns the text of `metadata.yaml`, or the reason why it has none.
fn text(metadata: &Path) -> Result<String, String> {
    let bytes = match std::fs::metadata(metadata) {
        Ok(file) => file.len(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(format!("there is no {METADATA}"));
        }
        Err(error) => return Err(format!("{METADATA} cannot be opened: {error}")),
    };
    if bytes > MAX_METADATA_BYTES {
        return Err(format!(
            "{METADATA} has {bytes} bytes, the limit is {MAX_METADATA_BYTES}"
        ));
    }
    match std::fs::read_to_string(metadata) {
        Ok(text) if text.trim().is_empty() => Err(format!("{METADATA} is empty")),
        Ok(text) => Ok(text),
        Err(error) => Err(format!("{METADATA} cannot be read: {error}")),
    }
}

fn not_there(first: &Path, count: usize) -> String {
    let name = first.file_name().unwrap_or_default().to_string_lossy();
    match count {
        1 => format!("{METADATA} lists {name}, which is not there"),
        _ => format!(
            "{METADATA} lists {name} and {} more, which are not there",
            count - 1
        ),
    }
}

fn flaw(path: &Path, kind: DamageKind) -> Damage {
    Damage {
        path: path.to_owned(),
        at: 0,
        kind,
        readable_until_ns: None,
    }
}

/// Returns the MCAP and SQLite files in `folder` by their name without the extension of a compressed file. If a file
/// exists in both forms, the uncompressed one is returned.
fn own_files(folder: &Path) -> Result<BTreeMap<OsString, PathBuf>, ArchiveError> {
    let mut own = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(ArchiveError::io(folder))? {
        let path = entry.map_err(ArchiveError::io(folder))?.path();
        let unpacked = unpacked_path(&path);
        let plain = unpacked.as_ref().unwrap_or(&path);
        let extension = plain.extension().unwrap_or_default();
        if extension != "mcap" && extension != "db3" {
            continue;
        }
        let name = plain.file_name().unwrap_or_default().to_owned();
        if unpacked.is_none() {
            own.insert(name, path);
        } else {
            own.entry(name).or_insert(path);
        }
    }
    Ok(own)
}

/// The file that is listed as `path`. Older bags give paths that begin with the folder itself, and the user may have
/// compressed or unpacked it.
fn find(folder: &Path, path: &Path, own: &BTreeMap<OsString, PathBuf>) -> Option<PathBuf> {
    let direct = folder.join(path);
    let plain = unpacked_path(path);
    // `exists` would take the folder itself, listed as "" or ".".
    if plain.is_none() && direct.is_file() {
        return Some(direct);
    }
    let name = plain.as_deref().unwrap_or(path).file_name()?;
    let own = own.get(name).cloned();
    own.or_else(|| direct.is_file().then_some(direct))
}

/// `bag_10.mcap` comes after `bag_9.mcap`.
fn split_number(path: &Path) -> (u64, PathBuf) {
    let plain = unpacked_path(path);
    let stem = plain.as_deref().unwrap_or(path).file_stem();
    let stem = stem.unwrap_or_default().to_string_lossy();
    let number = stem.rsplit('_').next().and_then(|text| text.parse().ok());
    (number.unwrap_or(0), path.to_owned())
}
