//! How the files are written.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How chunks are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Zstandard: smallest.
    #[default]
    Zstd,
    /// LZ4: faster, larger.
    Lz4,
    /// Not at all.
    None,
}

/// Options that every file of ours shares.
pub(crate) fn options(compression: Compression) -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .compression(match compression {
            Compression::Zstd => Some(mcap::Compression::Zstd),
            Compression::Lz4 => Some(mcap::Compression::Lz4),
            Compression::None => None,
        })
        // One thread: else the bytes depend on the number of cores.
        .compression_threads(0)
        // Chunks are closed by time and size here.
        .chunk_size(None)
        // A chunk comes into the file whole: a torn one is never patched.
        .disable_seeking(true)
}
