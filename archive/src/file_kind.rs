//! What a file is, told by how it begins: for whoever was given another kind of file than expected.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use crate::ros1_bag;
use crate::sqlite_file;

/// As many bytes tell.
const BEGINNING: u64 = 64;

/// What lies at `path`, in words, if it is one of the files that people mix up.
pub fn file_kind(path: &Path) -> Option<&'static str> {
    if path.is_dir() {
        return Some("a folder");
    }
    let mut beginning = Vec::new();
    let file = File::open(path).ok()?;
    file.take(BEGINNING).read_to_end(&mut beginning).ok()?;
    kind_of(&beginning)
}

/// What begins so.
fn kind_of(beginning: &[u8]) -> Option<&'static str> {
    let known: [(&[u8], &str); 7] = [
        (mcap::MAGIC, "an MCAP recording"),
        (
            sqlite_file::MAGIC,
            "a SQLite database, perhaps a rosbag2 bag",
        ),
        (ros1_bag::MAGIC, "a bag of ROS 1"),
        (b"RRF", "a picture for the Rerun viewer"),
        (b"PAR1", "a Parquet table"),
        (b"<robot", "a URDF"),
        (b"<", "XML, perhaps a URDF"),
    ];
    if beginning.is_empty() {
        return Some("empty");
    }
    let begins = |magic: &[u8]| {
        beginning.trim_ascii_start().starts_with(magic) || beginning.starts_with(magic)
    };
    let found = known.iter().find(|(magic, _)| begins(magic));
    found.map(|(_, words)| *words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_people_mix_up_are_told_apart() {
        assert_eq!(kind_of(b""), Some("empty"));
        assert_eq!(kind_of(mcap::MAGIC), Some("an MCAP recording"));
        assert_eq!(kind_of(b"\n<robot name=\"arm\">"), Some("a URDF"));
        assert_eq!(kind_of(b"version: 1\n"), None);
    }
}
