//! The recorder's part of the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_archive::Compression;

/// A recorder: what is kept of the streams it listens to. At least one of `mcap` and `rerun`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The archive to write (`.mcap`), complete and readable by any ROS 2 tool. Written beside it
    /// with `.part` at the end of its name until it is whole; a file of that name is replaced.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mcap: Option<PathBuf>,
    /// How the archive's chunks are compressed.
    pub compression: Compression,
    /// The picture for the Rerun viewer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<RerunConfig>,
}

/// Where the picture goes: to a file, to a viewer, or to both.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RerunConfig {
    /// The file to write (`.rrd`), with `.part` at the end of its name until it is whole. Sure to
    /// open in the viewer of this version and the next; the archive is what lasts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The viewer to stream to, e.g. `rerun+http://127.0.0.1:9876/proxy`. It may come and go; what
    /// it does not take in time is left out of the live picture only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connect: Option<String>,
}
