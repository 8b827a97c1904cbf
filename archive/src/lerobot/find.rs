//! Resolution of a path to a data set and an episode.

use std::path::{Path, PathBuf};

use super::columns::ColumnsFile;
use super::info::{INFO, Info};
use super::{EPISODE_INDEX, next_index};
use crate::error::ArchiveError;
use crate::lerobot_error::{LerobotError, LerobotProblem};
use crate::parquet_file::ParquetFile;

/// Folder of the tables that list the file of each episode in version 3.
const EPISODES: &str = "meta/episodes";
/// Columns of these tables.
const CHUNK_INDEX: &str = "data/chunk_index";
const FILE_INDEX: &str = "data/file_index";
/// Prefix of the name of an episode.
const PREFIX: &str = "episode_";
/// Maximum number of parent folders in which the data set of a file is searched.
const MOST_FOLDERS: usize = 4;
/// Maximum number of episodes of a data set.
/// Resolution: bounds memory; the largest have some hundred thousand.
const MOST_EPISODES: u64 = 1 << 20;

/// Data set or episode at a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Place {
    /// All of the data set in this folder.
    Set(PathBuf),
    /// One episode of the data set in this folder.
    Episode(PathBuf, u64),
}

/// Resolves `path`, if it is a data set or `DATASET/episode_000003`. Returns `None` for a file.
///
/// # Errors
/// If a folder looks like a data set but has no `meta/info.json`.
pub(crate) fn locate(path: &Path) -> Result<Option<Place>, ArchiveError> {
    if path.is_dir() {
        if path.join(INFO).is_file() {
            return Ok(Some(Place::Set(path.to_owned())));
        }
        if path.join("data/chunk-000").is_dir() || path.join(EPISODES).is_dir() {
            return Err(LerobotError::new(path, LerobotProblem::NoInfo).into());
        }
        return Ok(None);
    }
    // An existing file is not resolved by its name but by its content, in `of_table`.
    let number = number_of(path).filter(|_| !path.exists());
    let parent = path.parent().map(or_here);
    let root = parent.filter(|root| root.join(INFO).is_file());
    let found = root.zip(number);
    Ok(found.map(|(root, number)| Place::Episode(root.to_owned(), number)))
}

/// Replaces an empty folder by the current folder.
fn or_here(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() {
        return Path::new(".");
    }
    folder
}

/// Returns the number in `episode_000003`, with or without an extension.
fn number_of(path: &Path) -> Option<u64> {
    let digits = path.file_stem()?.to_str()?.strip_prefix(PREFIX)?;
    digits.parse().ok()
}

/// Resolves the Parquet table at `path` to the one episode in it.
///
/// # Errors
/// If it belongs to no data set, or does not hold exactly one episode.
pub(crate) fn of_table(path: &Path) -> Result<Place, ArchiveError> {
    let refuse = |problem| ArchiveError::from(LerobotError::new(path, problem));
    let absolute = std::path::absolute(path).map_err(ArchiveError::io(path))?;
    let mut folders = absolute.ancestors().skip(1).take(MOST_FOLDERS);
    let root = folders.find(|folder| folder.join(INFO).is_file());
    let root = root.ok_or_else(|| refuse(LerobotProblem::NoSet))?;
    // Prefers the folder in the user's spelling over the absolute path, if it is the data set.
    let depth = absolute.components().count() - root.components().count();
    let named = path.ancestors().nth(depth);
    let named = named.map(or_here).filter(|own| own.join(INFO).is_file());
    let root = named.unwrap_or(root);
    let file = ParquetFile::open(path, &[EPISODE_INDEX])?;
    if !file.has(EPISODE_INDEX) {
        let number = number_of(path).ok_or_else(|| refuse(LerobotProblem::NoSet))?;
        return Ok(Place::Episode(root.to_owned(), number));
    }
    let mut of_rows = file.column(EPISODE_INDEX, 0)?;
    let mut numbers: Vec<u64> = Vec::new();
    while let Some(number) = next_index(&mut of_rows)? {
        if numbers.last() != Some(&number) && numbers.len() < MOST_EPISODES as usize {
            numbers.push(number);
        }
    }
    match numbers.as_slice() {
        [] => Err(refuse(LerobotProblem::Empty)),
        [number] => Ok(Place::Episode(root.to_owned(), *number)),
        _ => Err(refuse(several(root, &numbers))),
    }
}

/// Returns the numbers of the episodes of the data set in the folder `root`.
///
/// # Errors
/// If there are none, or the data set does not list them.
pub(crate) fn episodes(root: &Path) -> Result<Vec<u64>, ArchiveError> {
    let info = Info::read(root)?;
    let numbers = numbers(root, &info)?;
    if numbers.is_empty() {
        return Err(LerobotError::new(root, LerobotProblem::Empty).into());
    }
    Ok(numbers)
}

impl Place {
    /// Returns the folder of the data set, and its episode.
    ///
    /// # Errors
    /// If the data set does not have exactly one episode.
    pub(crate) fn one(self) -> Result<(PathBuf, u64), ArchiveError> {
        match self {
            Self::Episode(root, number) => Ok((root, number)),
            Self::Set(root) => match episodes(&root)?.as_slice() {
                [number] => Ok((root, *number)),
                numbers => Err(LerobotError::new(&root, several(&root, numbers)).into()),
            },
        }
    }
}

/// Returns the path that names an episode.
pub(crate) fn name(root: &Path, number: u64) -> PathBuf {
    root.join(format!("{PREFIX}{number:06}"))
}

fn several(root: &Path, numbers: &[u64]) -> LerobotProblem {
    let named = |number: Option<&u64>| name(root, number.copied().unwrap_or(0));
    LerobotProblem::Several {
        count: numbers.len(),
        first: named(numbers.first()),
        last: named(numbers.last()),
    }
}

fn numbers(root: &Path, info: &Info) -> Result<Vec<u64>, ArchiveError> {
    if info.has_file_by_episode() {
        return Ok((0..info.total_episodes.min(MOST_EPISODES)).collect());
    }
    let mut numbers = Vec::new();
    each_episode(root, |number, _, _| {
        numbers.push(number);
        true
    })?;
    numbers.sort_unstable();
    Ok(numbers)
}

/// Returns the file with the rows of an episode.
///
/// # Errors
/// If the data set has no such episode, or its file is missing.
pub(super) fn file_of(root: &Path, info: &Info, number: u64) -> Result<PathBuf, ArchiveError> {
    let wrong = |problem| ArchiveError::from(LerobotError::new(root, problem));
    let below = if info.has_file_by_episode() {
        let is_there = number < info.total_episodes;
        is_there.then(|| info.file_of_episode(number))
    } else {
        let mut found = None;
        each_episode(root, |own, chunk, file| {
            if own == number {
                found = Some(info.file_of_chunk(chunk, file));
            }
            found.is_none()
        })?;
        found
    };
    let Some(below) = below else {
        let numbers = episodes(root)?;
        return Err(wrong(LerobotProblem::NoEpisode {
            number,
            count: numbers.len(),
            first: numbers.first().copied().unwrap_or(0),
            last: numbers.last().copied().unwrap_or(0),
        }));
    };
    let below = below.ok_or_else(|| {
        let reason = "`data_path` in meta/info.json is not one of LeRobot 2.0 to 3.0".to_owned();
        wrong(LerobotProblem::Broken(reason))
    })?;
    let path = root.join(&below);
    if !path.is_file() {
        let file = below.display().to_string();
        return Err(wrong(LerobotProblem::NoFile { number, file }));
    }
    Ok(path)
}

/// Calls `take` with the number, the chunk and the file of each episode of version 3, until it returns `false`.
fn each_episode(
    root: &Path,
    mut take: impl FnMut(u64, u64, u64) -> bool,
) -> Result<(), ArchiveError> {
    let folder = root.join(EPISODES);
    let tables = tables(&folder);
    if tables.is_empty() {
        let reason = format!(
            "{} holds no table, which says where the episodes are: download the folder `meta`, too",
            folder.display()
        );
        return Err(LerobotError::new(root, LerobotProblem::Broken(reason)).into());
    }
    let mut seen = 0;
    for table in tables {
        let columns = [EPISODE_INDEX, CHUNK_INDEX, FILE_INDEX];
        let table = ParquetFile::open(&table, &columns)?;
        let mut rows = Vec::with_capacity(columns.len());
        for column in columns {
            rows.push(table.column(column, 0)?);
        }
        let [numbers, chunks, files] = rows.as_mut_slice() else {
            continue;
        };
        while let Some(number) = next_index(numbers)? {
            let chunk = next_index(chunks)?.unwrap_or(u64::MAX);
            let file = next_index(files)?.unwrap_or(u64::MAX);
            seen += 1;
            if !take(number, chunk, file) || seen > MOST_EPISODES {
                return Ok(());
            }
        }
    }
    Ok(())
}

/// Returns the files `chunk-*/file-*.parquet` in a folder, sorted by path.
fn tables(folder: &Path) -> Vec<PathBuf> {
    let entries = |folder: &Path| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect::<Vec<_>>()
    };
    let chunks = entries(folder).into_iter();
    let mut tables: Vec<PathBuf> = chunks.flat_map(|chunk| entries(&chunk)).collect();
    tables.retain(|path| path.extension().is_some_and(|ending| ending == "parquet"));
    tables.sort();
    tables
}

/// Returns the files on which the episode depends: its rows and their descriptions.
///
/// # Errors
/// As when it is opened.
pub(crate) fn files(root: &Path, number: u64) -> Result<Vec<PathBuf>, ArchiveError> {
    let rows = file_of(root, &Info::read(root)?, number)?;
    let mut files = vec![rows, root.join(INFO), ColumnsFile::path(root)];
    files.retain(|path| path.is_file());
    Ok(files)
}
