//! Repair of a folder of MCAP files to one bag.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use super::{REPAIR, RepairError, Repaired, repair, stem};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::mcap_write::rosbag2::{self, BagFile, BagTopic};
use crate::mcap_write::{self, Written};
use crate::recording::Recording;
use crate::whole_file::{self, Existing};

/// Result of [`repair_folder`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RepairedFolder {
    /// The new folder, a bag that rosbag2 opens.
    pub path: PathBuf,
    /// Its files; an intact one is a hard link to the old file, or a copy of it.
    pub files: Vec<Repaired>,
    /// Files of the old folder that cannot be read at all.
    pub damage: Vec<Damage>,
}

/// Returns the default path of a repaired folder: `bag.repaired` next to `bag`.
pub fn repaired_folder_path(folder: &Path) -> PathBuf {
    let mut name = folder.file_name().map_or_else(
        || OsString::from("recordings"),
        std::ffi::OsStr::to_os_string,
    );
    name.push(".repaired");
    folder.parent().unwrap_or(Path::new("")).join(name)
}

/// Creates the bag `to` from the MCAP files in the folder `from`. Intact files are kept as they are, torn ones are
/// rebuilt, and the pieces of a recorder that crashed and was restarted are joined. A `metadata.yaml` describes all
/// of them. `from` is not modified.
///
/// Pieces belong together if their names differ only in the number (`a.mcap`, `a.1.mcap.part`), their provenance is
/// the same, and all but the last are torn.
///
/// # Errors
/// If there is no MCAP file, one is being written, or the new folder already exists or cannot be written.
pub fn repair_folder(from: &Path, to: &Path) -> Result<RepairedFolder, RepairError> {
    if to.try_exists().map_err(ArchiveError::io(to))? {
        return Err(RepairError::Exists {
            path: to.to_owned(),
        });
    }
    let mut damage = Vec::new();
    let mut pieces = Vec::new();
    for path in mcap_files(from)? {
        match Piece::look_at(&path) {
            Ok(piece) => pieces.push(piece),
            Err(error) => damage.push(Damage {
                path,
                at: 0,
                kind: DamageKind::File {
                    reason: error.to_string(),
                },
                readable_until_ns: None,
            }),
        }
    }
    if pieces.is_empty() {
        let path = from.to_owned();
        return Err(RepairError::NothingThere { path });
    }
    let mut work = to.as_os_str().to_owned();
    work.push(".part");
    let work = PathBuf::from(work);
    if work.is_dir() {
        // Output of an interrupted repair.
        fs::remove_dir_all(&work).map_err(ArchiveError::io(&work))?;
    }
    whole_file::create_folder(&work).map_err(ArchiveError::io(&work))?;
    let mut files = Vec::new();
    for chain in chains(pieces) {
        files.push(place(&chain, &work)?);
    }
    write_metadata(&work, &files)?;
    whole_file::put_in_place(&work, to, Existing::Keep).map_err(ArchiveError::io(to))?;
    for file in &mut files {
        let name = file.written.path.file_name().unwrap_or_default().to_owned();
        file.written.path = to.join(name);
    }
    Ok(RepairedFolder {
        path: to.to_owned(),
        files,
        damage,
    })
}

fn mcap_files(folder: &Path) -> Result<Vec<PathBuf>, ArchiveError> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(ArchiveError::io(folder))? {
        let path = entry.map_err(ArchiveError::io(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // The source of an unfinished repair still holds all of its data.
        let unfinished = name.ends_with(".repairing.mcap.part");
        if (name.ends_with(".mcap") || name.ends_with(".mcap.part")) && !unfinished {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// A file of the folder, with the facts that decide which pieces belong together.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Piece {
    path: PathBuf,
    start_ns: Option<i64>,
    /// Whether its writer crashed, or the writer of the file from which it was repaired.
    torn: bool,
    /// Whether it can be used as it is.
    whole: bool,
    provenance: Option<BTreeMap<String, String>>,
}

impl Piece {
    fn look_at(path: &Path) -> Result<Self, ArchiveError> {
        let recording = Recording::open(path)?;
        let is_part = path.extension().is_some_and(|kind| kind == "part");
        let tail = |damage: &Damage| damage.kind == DamageKind::TornTail;
        let repaired = recording.metadata().contains_key(REPAIR);
        Ok(Self {
            path: path.to_owned(),
            start_ns: recording.start_ns(),
            torn: is_part || repaired || recording.damage().iter().any(tail),
            whole: !is_part && recording.damage().is_empty(),
            provenance: recording.provenance().cloned(),
        })
    }

    /// Returns its name without the number of the piece: `a` for `a.1.mcap.part`.
    fn base(&self) -> String {
        let name = stem(&self.path);
        match name.rsplit_once('.') {
            Some((base, number)) if number.bytes().all(|b| b.is_ascii_digit()) => base.to_owned(),
            _ => name,
        }
    }
}

/// Groups the pieces that belong together, in the order of their times.
fn chains(mut pieces: Vec<Piece>) -> Vec<Vec<Piece>> {
    pieces.sort_by_key(|piece| (piece.base(), piece.start_ns, piece.path.clone()));
    let mut chains: Vec<Vec<Piece>> = Vec::new();
    for piece in pieces {
        let follows = |last: &Piece| {
            last.torn
                && last.base() == piece.base()
                && last.provenance.is_some()
                && last.provenance == piece.provenance
        };
        match chains.last_mut() {
            Some(chain) if chain.last().is_some_and(follows) => chain.push(piece),
            _ => chains.push(vec![piece]),
        }
    }
    chains
}

/// Puts a chain into `folder` as one file, named after its only piece or the common part of their names.
fn place(chain: &[Piece], folder: &Path) -> Result<Repaired, RepairError> {
    let paths: Vec<&Path> = chain.iter().map(|piece| piece.path.as_path()).collect();
    let name = match chain {
        [piece] => format!("{}.mcap", stem(&piece.path)),
        pieces => format!("{}.mcap", pieces[0].base()),
    };
    let to = whole_file::unused_name(&folder.join(name)).map_err(ArchiveError::io(folder))?;
    let [
        Piece {
            whole: true, path, ..
        },
    ] = chain
    else {
        return repair(&paths, &to);
    };
    // A hard link, or a copy if the file system does not support links.
    if fs::hard_link(path, &to).is_err() {
        fs::copy(path, &to).map_err(ArchiveError::io(&to))?;
    }
    let recording = Recording::open(&to)?;
    Ok(Repaired {
        written: Written {
            messages: recording.message_count(),
            bytes: recording.bytes(),
            path: to,
        },
        from: vec![path.clone()],
        damage: Vec::new(),
        set_aside: None,
    })
}

fn write_metadata(folder: &Path, files: &[Repaired]) -> Result<(), RepairError> {
    let mut topics: Vec<BagTopic> = Vec::new();
    let mut bag_files = Vec::new();
    for file in files {
        let recording = Recording::open(&file.written.path)?;
        for topic in recording.topics() {
            let same = |known: &&mut BagTopic| {
                known.name == topic.name && known.type_name == topic.type_name
            };
            match topics.iter_mut().find(same) {
                Some(known) => known.messages += topic.message_count,
                None => topics.push(BagTopic {
                    name: topic.name.clone(),
                    type_name: topic.type_name.clone(),
                    encoding: topic.message_encoding.clone(),
                    type_hash: topic.type_hash.clone().unwrap_or_default(),
                    offered_qos: topic.offered_qos.clone(),
                    messages: topic.message_count,
                }),
            }
        }
        let times = recording.start_ns().zip(recording.end_ns());
        let bag_file = BagFile::new(&file.written.path, times);
        bag_files.push(bag_file.with_messages(file.written.messages));
    }
    let path = folder.join("metadata.yaml");
    let text = rosbag2::metadata_yaml(&topics, &bag_files).map_err(mcap_write::yaml(&path))?;
    whole_file::write(&path, text, Existing::Keep).map_err(ArchiveError::io(&path))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(name: &str, start_ns: i64, torn: bool, made_by: &str) -> Piece {
        Piece {
            path: name.into(),
            start_ns: Some(start_ns),
            torn,
            whole: !torn,
            provenance: Some(BTreeMap::from([("made_by".to_owned(), made_by.to_owned())])),
        }
    }

    fn names(chains: &[Vec<Piece>]) -> Vec<Vec<&str>> {
        chains
            .iter()
            .map(|chain| chain.iter().filter_map(|p| p.path.to_str()).collect())
            .collect()
    }

    #[test]
    fn pieces_of_one_recorder_belong_together_and_others_do_not() {
        let found = chains(vec![
            piece("a.mcap", 30, false, "x"),
            piece("a.1.mcap.part", 10, true, "x"),
            piece("a.2.mcap.part", 20, true, "x"),
            piece("b.1.mcap.part", 5, true, "x"),
            piece("c.mcap", 1, false, "x"),
            piece("c.1.mcap", 2, false, "x"),
            piece("d.1.mcap.part", 1, true, "x"),
            piece("d.mcap", 2, false, "another pipeline"),
        ]);
        assert_eq!(
            names(&found),
            [
                vec!["a.1.mcap.part", "a.2.mcap.part", "a.mcap"],
                vec!["b.1.mcap.part"],
                vec!["c.mcap"],
                vec!["c.1.mcap"],
                vec!["d.1.mcap.part"],
                vec!["d.mcap"],
            ]
        );
    }
}
