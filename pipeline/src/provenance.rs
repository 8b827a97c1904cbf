//! Hashes of the files that went into a result.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use sha2::{Digest, Sha256};

/// SHA-256 of a recording in hexadecimal. For a bag's folder it covers all files in the order of their names. For an
/// episode of a LeRobot data set it covers the number and the files of the episode.
///
/// # Errors
/// If the file cannot be read.
pub fn sha256_of_file(path: &Path) -> std::io::Result<String> {
    let sources = tauscope_archive::sources(path).map_err(std::io::Error::other)?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    if let Some(episode) = sources.episode {
        hash.update(episode.to_le_bytes());
    }
    for file in sources.files {
        let mut file = File::open(&file)?;
        loop {
            let count = file.read(&mut buffer)?;
            if count == 0 {
                break;
            }
            hash.update(&buffer[..count]);
        }
    }
    Ok(hex(&hash.finalize()))
}

/// SHA-256 in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
