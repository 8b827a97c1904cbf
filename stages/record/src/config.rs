//! The recorder's part of the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_archive::Compression;
use tauscope_archive::whole_file::Existing;

use crate::error::RecordError;
use crate::file_name::FileName;

/// A recorder: what is kept of the streams it listens to. At least one of `mcap` and `rerun`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The archive to write (`.mcap`), complete and readable by any ROS 2 tool. Its name has `.part`
    /// at the end until it is whole. It may hold `{cell}`, `{date}` and `{time}` (UTC, of the first
    /// sample in it) and `{n}` (the first number that makes the name new).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<PathBuf>,
    /// How the archive's chunks are compressed.
    pub compression: Compression,
    /// When files are closed and new ones begun; their names must hold `{n}` or `{time}` then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<Split>,
    /// What becomes of a file that already has the name: it is kept, and a run that would replace it
    /// does not start, or it is replaced once the new one is whole.
    pub existing: Existing,
    /// The archive's chunks are brought to the disk as soon as they are closed, but not more often than
    /// this \[s\]; 0: only a complete file is, and a power cut may cost all of an incomplete one.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub sync_s: f64,
    /// Recording pauses while the disk has less room than this \[MB, 10⁶ bytes\]. What is not kept
    /// meanwhile is counted as lost.
    #[schemars(range(min = 1.0))]
    pub min_free_mb: f64,
    /// How much of what was recorded is kept; by default all. Their names must hold `{n}`, `{date}`
    /// or `{time}`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep: Option<Keep>,
    /// Files of their own around each alarm, with or without an archive of everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around_alarms: Option<AroundAlarms>,
    /// The picture for the Rerun viewer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<RerunConfig>,
}

/// How often chunks are synced unless told otherwise \[s\].
/// Resolution: what a power cut may cost, against the disk's work; as long as a chunk.
const SYNC_S: f64 = 0.1;
/// Room that recording leaves on a disk unless told otherwise \[MB\].
/// Resolution: enough for others and for the end of what is open.
const MIN_FREE_MB: f64 = 500.0;

impl Default for Config {
    fn default() -> Self {
        Self {
            mcap: None,
            compression: Compression::default(),
            split: None,
            existing: Existing::default(),
            sync_s: SYNC_S,
            min_free_mb: MIN_FREE_MB,
            keep: None,
            around_alarms: None,
            rerun: None,
        }
    }
}

impl Config {
    /// The names of the files in this configuration: archive, then picture.
    pub(crate) fn names(&self) -> impl Iterator<Item = &PathBuf> {
        let picture = self.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        self.mcap.iter().chain(picture)
    }

    /// The names of all files that it asks for, those around alarms, too: of archives, and of pictures.
    pub(crate) fn all_names(&self) -> [Vec<&PathBuf>; 2] {
        let around = self.around_alarms.as_ref();
        let picture = self.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        let archives = self
            .mcap
            .iter()
            .chain(around.and_then(|it| it.mcap.as_ref()));
        let pictures = picture
            .into_iter()
            .chain(around.and_then(|it| it.rerun.as_ref()));
        [archives.collect(), pictures.collect()]
    }

    /// The names of the files in which an alarm can be looked at: archives, and the picture that shows least beside it.
    pub fn names_of_alarms(&self) -> Vec<&PathBuf> {
        let [archives, pictures] = self.all_names();
        archives
            .into_iter()
            .chain(pictures.last().copied())
            .collect()
    }

    /// The names of all files that it asks for, those around alarms, too.
    pub fn all_names_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let picture = self.rerun.as_mut().and_then(|rerun| rerun.file.as_mut());
        let around = self.around_alarms.as_mut().into_iter();
        let around = around.flat_map(|around| around.mcap.iter_mut().chain(&mut around.rerun));
        self.mcap.iter_mut().chain(picture).chain(around)
    }

    /// Whether it asks for anything.
    pub fn writes_something(&self) -> bool {
        let picture = self.rerun.as_ref();
        self.mcap.is_some()
            || picture.is_some_and(|rerun| rerun.file.is_some() || rerun.connect.is_some())
            || (self.around_alarms.as_ref())
                .is_some_and(|around| around.mcap.is_some() || around.rerun.is_some())
    }

    /// Checks the files' names.
    ///
    /// # Errors
    /// If a name holds a field that there is none of, or there are to be several files of one name.
    pub fn check_names(&self) -> Result<(), RecordError> {
        for path in self.names() {
            let name = FileName::parse(path)?;
            if (self.split.is_some() || self.keep.is_some()) && !name.can_differ() {
                return Err(RecordError::OneName { name: path.clone() });
            }
        }
        if let Some(around) = &self.around_alarms {
            return around.files(self).check_names();
        }
        Ok(())
    }

    /// Folders that files go to, as far as their names are known before there is a sample.
    pub fn folders(&self, cell: &str) -> Vec<PathBuf> {
        let around = self.around_alarms.as_ref().map(|around| around.files(self));
        let around = around.iter().flat_map(Self::names);
        let names = self.names().chain(around);
        let names = names.filter_map(|path| FileName::parse(path).ok());
        names.map(|name| name.known_folder(cell)).collect()
    }

    /// Files that are there and that a recorder of `cell` would have to replace.
    pub fn in_the_way(&self, cell: &str) -> Vec<PathBuf> {
        let fixed = |path: &PathBuf| FileName::parse(path).ok()?.fixed(cell);
        self.names()
            .filter_map(fixed)
            .filter(|path| path.exists())
            .collect()
    }
}

/// When a recorder closes its files and begins new ones. Each file stands for itself: what holds at
/// its beginning (command, tool, threshold, alarm) is told again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Split {
    /// After this time, by the samples' own clock \[s\].
    #[schemars(range(min = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_s: Option<f64>,
    /// Once the archive has this size \[MB, 10⁶ bytes\].
    #[schemars(range(min = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_mb: Option<f64>,
}

/// How much of what was recorded is kept. The oldest complete file goes first, whenever one was
/// completed, and also when the disk has less than `min_free_mb`. Only files go that have a name which
/// this recorder's can become; the one that is being written stays.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Keep {
    /// Of archives together, and of pictures together \[MB, 10⁶ bytes\].
    #[schemars(range(min = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most_mb: Option<f64>,
    /// For so long after a file was completed, or until the newest one was; the newest stays \[days\].
    #[schemars(range(min = 0.01))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most_days: Option<f64>,
}

/// Files around each alarm. What came before an alarm is held in memory; alarms that lie so close that
/// their files would overlap share one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AroundAlarms {
    /// The archive of each alarm (`.mcap`), with `{n}` or `{time}` in its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<PathBuf>,
    /// The picture of each alarm (`.rrd`), likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<PathBuf>,
    /// From so long before the alarm \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub before_s: f64,
    /// To so long after its end \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub after_s: f64,
    /// Memory for what came before; where it is not enough, the file begins later \[MB, 10⁶ bytes\].
    #[schemars(range(min = 1.0))]
    pub at_most_mb: f64,
}

/// Time before an alarm unless told otherwise \[s\].
/// Resolution: what a person wants to see of how it came to it.
const BEFORE_S: f64 = 20.0;
/// Time after an alarm unless told otherwise \[s\].
/// Resolution: likewise.
const AFTER_S: f64 = 10.0;
/// Memory for it unless told otherwise \[MB\]: a minute of three streams at 1 kHz.
/// Resolution: memory.
const RING_MB: f64 = 150.0;

impl Default for AroundAlarms {
    fn default() -> Self {
        Self {
            mcap: None,
            rerun: None,
            before_s: BEFORE_S,
            after_s: AFTER_S,
            at_most_mb: RING_MB,
        }
    }
}

impl AroundAlarms {
    /// Its files, as a recorder of everything would be told them: a new one each time.
    pub(crate) fn files(&self, of: &Config) -> Config {
        Config {
            mcap: self.mcap.clone(),
            rerun: self.rerun.clone().map(|file| RerunConfig {
                file: Some(file),
                connect: None,
            }),
            split: Some(Split::default()),
            around_alarms: None,
            ..of.clone()
        }
    }
}

/// Where the picture goes: to a file, to a viewer, or to both.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RerunConfig {
    /// The file to write (`.rrd`), named and split as the archive is. Sure to
    /// open in the viewer of this version and the next; the archive is what lasts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The viewer to stream to, e.g. `rerun+http://127.0.0.1:9876/proxy`. It may come and go; what
    /// it does not take in time is left out of the live picture only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connect: Option<String>,
}
