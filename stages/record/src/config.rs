//! The recorder's part of the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_archive::Compression;
use tauscope_archive::whole_file::Existing;

use crate::error::RecordError;
use crate::file_name::FileName;

/// A recorder: what is kept of the streams it listens to. At least one of `mcap` and `rerun`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// The picture for the Rerun viewer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<RerunConfig>,
}

impl Config {
    /// The names of the files in this configuration: archive, then picture.
    pub(crate) fn names(&self) -> impl Iterator<Item = &PathBuf> {
        let picture = self.rerun.as_ref().and_then(|rerun| rerun.file.as_ref());
        self.mcap.iter().chain(picture)
    }

    /// Checks the files' names.
    ///
    /// # Errors
    /// If a name holds a field that there is none of, or files are to be split that have one name.
    pub fn check_names(&self) -> Result<(), RecordError> {
        for path in self.names() {
            let name = FileName::parse(path)?;
            if self.split.is_some() && !name.can_differ() {
                return Err(RecordError::OneName { name: path.clone() });
            }
        }
        Ok(())
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
