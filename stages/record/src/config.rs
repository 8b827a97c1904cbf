//! Settings of the recorder in the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_archive::Compression;
use tauscope_archive::whole_file::Existing;

use crate::error::RecordError;
use crate::file_name::FileName;

/// A recorder of the streams it listens to. At least one of `mcap`, `rerun` and `around_alarms` must be given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The archive of all samples to write (`.mcap`), readable by any ROS 2 tool. Until the file is complete, its
    /// name ends with `.part`. The name may contain `{cell}`, `{date}` and `{time}` (UTC, of its first sample) and
    /// `{n}` (the first unused number).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<PathBuf>,
    /// Compression of the archive's chunks.
    pub compression: Compression,
    /// Condition for closing files and beginning new ones. The names must then contain `{n}` or `{time}`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<Split>,
    /// Policy for a file that already has the name. `keep`: a run that would replace it does not start. `replace`: it
    /// is replaced when the new file is complete.
    pub existing: Existing,
    /// Smallest interval between syncs of closed chunks to the disk \[s\]. With 0 only complete files are synced, so
    /// a power failure may lose all of an incomplete file.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub sync_s: f64,
    /// Free disk space below which recording pauses \[MB, 10⁶ bytes\]. Samples during the pause are counted as lost.
    #[schemars(range(min = 1.0))]
    pub min_free_mb: f64,
    /// Retention of recorded files; by default all are kept. The names must then contain `{n}`, `{date}` or `{time}`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep: Option<Keep>,
    /// Separate files around each alarm, with or without a complete archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub around_alarms: Option<AroundAlarms>,
    /// The picture for the Rerun viewer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<RerunConfig>,
}

/// Default sync interval of chunks \[s\].
/// Resolution: loss in a power failure, against disk load; as long as a chunk.
const SYNC_S: f64 = 0.1;
/// Default free space below which recording pauses \[MB\].
/// Resolution: enough for other programs and for completing open files.
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
    /// Names of the files of the whole run: archive, then picture.
    pub(crate) fn names(&self) -> impl Iterator<Item = &PathBuf> {
        let picture = self.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        self.mcap.iter().chain(picture)
    }

    /// Names of all files, including those around alarms: archives and pictures.
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

    /// Names of the files that show an alarm: all archives, and the picture with the shortest time span.
    pub fn names_of_alarms(&self) -> Vec<&PathBuf> {
        let [archives, pictures] = self.all_names();
        archives
            .into_iter()
            .chain(pictures.last().copied())
            .collect()
    }

    /// Names of all files, including those around alarms.
    pub fn all_names_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let picture = self.rerun.as_mut().and_then(|rerun| rerun.file.as_mut());
        let around = self.around_alarms.as_mut().into_iter();
        let around = around.flat_map(|around| around.mcap.iter_mut().chain(&mut around.rerun));
        self.mcap.iter_mut().chain(picture).chain(around)
    }

    /// Whether it writes any output.
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
    /// If a name contains an unknown field, or several files would have the same name.
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

    /// Folders of the files, as far as they are known before the first sample.
    pub fn folders(&self, cell: &str) -> Vec<PathBuf> {
        let around = self.around_alarms.as_ref().map(|around| around.files(self));
        let around = around.iter().flat_map(Self::names);
        let names = self.names().chain(around);
        let names = names.filter_map(|path| FileName::parse(path).ok());
        names.map(|name| name.known_folder(cell)).collect()
    }

    /// Existing files that a recorder of `cell` would have to replace.
    pub fn in_the_way(&self, cell: &str) -> Vec<PathBuf> {
        let fixed = |path: &PathBuf| FileName::parse(path).ok()?.fixed(cell);
        self.names()
            .filter_map(fixed)
            .filter(|path| path.exists())
            .collect()
    }
}

/// Condition for closing the files and beginning new ones. Each file is self-contained: the state at its beginning
/// (command, tool, threshold, alarm) is written again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Split {
    /// Duration of a file, by the clock of the samples \[s\].
    #[schemars(range(min = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_s: Option<f64>,
    /// Size of the archive \[MB, 10⁶ bytes\].
    #[schemars(range(min = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_mb: Option<f64>,
}

/// Retention of recorded files. The oldest complete files are removed when a file is completed, and when the disk has
/// less than `min_free_mb` free. Only files that match this recorder's names are removed; the current file is kept.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Keep {
    /// Largest total size of archives, and of pictures \[MB, 10⁶ bytes\].
    #[schemars(range(min = 1.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most_mb: Option<f64>,
    /// Largest age of a file, from its completion to now or to the newest file; the newest file is kept \[days\].
    #[schemars(range(min = 0.01))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_most_days: Option<f64>,
}

/// Files around each alarm. The samples before an alarm are buffered in memory. Alarms whose files would overlap
/// share one file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AroundAlarms {
    /// The archive of each alarm (`.mcap`), with `{n}` or `{time}` in its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<PathBuf>,
    /// The picture of each alarm (`.rrd`), with `{n}` or `{time}` in its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<PathBuf>,
    /// Recorded time before the alarm \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub before_s: f64,
    /// Recorded time after the end of the alarm \[s\].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub after_s: f64,
    /// Memory for the samples before an alarm; if it is too small, the file begins later \[MB, 10⁶ bytes\].
    #[schemars(range(min = 1.0))]
    pub at_most_mb: f64,
}

/// Default recorded time before an alarm \[s\].
/// Resolution: enough for a person to see what led to the alarm.
const BEFORE_S: f64 = 20.0;
/// Default recorded time after an alarm \[s\].
/// Resolution: enough for a person to see what followed the alarm.
const AFTER_S: f64 = 10.0;
/// Default memory for the samples before an alarm, a minute of three streams at 1 kHz \[MB\].
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
    /// Settings of a plain recorder for its files, with a new file for each alarm.
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

/// Output of the picture: a file, a viewer, or both.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RerunConfig {
    /// The file to write (`.rrd`), named and split like the archive. Only the viewer of this version and the next is
    /// sure to open it; for permanent storage use the archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The viewer to stream to, e.g. `rerun+http://127.0.0.1:9876/proxy`. It may connect and disconnect at any time.
    /// Data that it does not receive in time is missing only in the live view.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connect: Option<String>,
}
