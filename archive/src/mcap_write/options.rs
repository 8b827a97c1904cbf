//! Options for writing MCAP files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Compression of the chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Zstandard: smallest.
    #[default]
    Zstd,
    /// LZ4: faster, larger.
    Lz4,
    /// No compression.
    None,
}

/// Options of every MCAP file that tauscope writes.
pub(crate) fn options(compression: Compression) -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .compression(match compression {
            Compression::Zstd => Some(mcap::Compression::Zstd),
            Compression::Lz4 => Some(mcap::Compression::Lz4),
            Compression::None => None,
        })
        // One thread; otherwise the bytes depend on the number of cores.
        .compression_threads(0)
        // Chunks are closed by time and size here.
        .chunk_size(None)
        // A chunk is written to the file at once, so that an incomplete one is never patched.
        .disable_seeking(true)
}
