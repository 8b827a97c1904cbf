//! The kind of a file by its first bytes, for messages about a file of an unexpected kind.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use crate::compressed::Packing;
use crate::ros1_bag;
use crate::sqlite_file;

/// Number of examined bytes at the start of a file.
/// Chosen: an XML file may have a licence as long before its first element.
const BEGINNING: u64 = 16 << 10;

/// Returns the kind of the file at `path` as a noun phrase, if it is a kind that is often passed by mistake.
pub fn file_kind(path: &Path) -> Option<&'static str> {
    if path.is_dir() {
        return Some("a folder");
    }
    kind_of(&beginning(path).ok()?)
}

/// Returns the format of the file at `path`, if it is compressed or an archive of files.
pub(crate) fn packing(path: &Path) -> Option<&'static Packing> {
    Packing::of(&beginning(path).ok()?)
}

fn beginning(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut beginning = Vec::new();
    let file = File::open(path)?;
    file.take(BEGINNING).read_to_end(&mut beginning)?;
    Ok(beginning)
}

/// Returns the kind of a file with these first bytes.
fn kind_of(beginning: &[u8]) -> Option<&'static str> {
    let known: [(&[u8], &str); 5] = [
        (mcap::MAGIC, "an MCAP recording"),
        (
            sqlite_file::MAGIC,
            "a SQLite database, perhaps a rosbag2 bag",
        ),
        (ros1_bag::MAGIC, "a bag of ROS 1"),
        (b"RRF", "a picture for the Rerun viewer"),
        (b"PAR1", "a Parquet table"),
    ];
    if beginning.is_empty() {
        return Some("empty");
    }
    let found = known.iter().find(|(magic, _)| beginning.starts_with(magic));
    let found = found.map(|(_, words)| *words);
    let packing = || Packing::of(beginning).map(|packing| packing.words);
    found.or_else(packing).or_else(|| kind_of_xml(beginning))
}

/// Returns the kind of an XML file by its first element.
fn kind_of_xml(beginning: &[u8]) -> Option<&'static str> {
    /// Byte order mark of UTF-8, which some editors write.
    const MARK: &[u8] = b"\xef\xbb\xbf";
    let text = String::from_utf8_lossy(beginning.strip_prefix(MARK).unwrap_or(beginning));
    let mut rest = text.trim_start();
    if !rest.starts_with('<') {
        return None;
    }
    // Skips declarations and comments before the first element.
    while rest.starts_with("<?") || rest.starts_with("<!") {
        let end = if rest.starts_with("<!--") { "-->" } else { ">" };
        rest = rest.split_once(end)?.1.trim_start();
    }
    let element = rest.split('>').next().unwrap_or_default();
    let is = |name: &str| {
        let after = element
            .strip_prefix('<')
            .and_then(|element| element.strip_prefix(name));
        after.is_some_and(|after| !after.starts_with(|next: char| next.is_alphanumeric()))
    };
    Some(match () {
        () if is("robot") && element.contains("xmlns:xacro") => {
            "a xacro file, the source of a URDF"
        }
        () if is("robot") => "a URDF",
        () if is("mujoco") => "an MJCF model of MuJoCo",
        () if is("sdf") => "an SDF model of Gazebo",
        () => "XML, perhaps a URDF",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_people_mix_up_are_recognised() {
        for (beginning, kind) in [
            (&b""[..], Some("empty")),
            (mcap::MAGIC, Some("an MCAP recording")),
            (b"\x28\xb5\x2f\xfd\x04", Some("a Zstandard-compressed file")),
            (b"PK\x03\x04", Some("a zip archive")),
            (b"version: 1\n", None),
        ] {
            assert_eq!(kind_of(beginning), kind);
        }
    }

    #[test]
    fn xml_is_known_by_its_first_element() {
        let before = "\u{feff}<?xml version=\"1.0\"?>\n<!-- <mujoco> or <sdf> -->\n";
        for (element, kind) in [
            ("<robot name=\"arm\">", "a URDF"),
            (
                "<robot\n  xmlns:xacro=\"http://ros.org/wiki/xacro\">",
                "a xacro file, the source of a URDF",
            ),
            ("<mujoco model=\"arm\">", "an MJCF model of MuJoCo"),
            ("<sdf version='1.9'>", "an SDF model of Gazebo"),
            ("<robots>", "XML, perhaps a URDF"),
        ] {
            assert_eq!(kind_of(element.as_bytes()), Some(kind));
            assert_eq!(kind_of(format!("{before}{element}").as_bytes()), Some(kind));
        }
        // A comment without an end.
        assert_eq!(kind_of(b"<!-- licence"), None);
    }
}
