//! Compressed files and file archives: recognised by their first bytes, with the command that unpacks them.

use std::path::{Path, PathBuf};

/// First bytes of Zstandard data.
/// From: RFC 8878, section 3.1.1.
pub(crate) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// A format of compressed files or file archives.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Packing {
    /// Name with article, e.g. `a Zstandard-compressed file`.
    pub(crate) words: &'static str,
    magic: &'static [u8],
    /// File offset of the magic \[bytes\].
    magic_at: usize,
    /// File name extensions.
    endings: &'static [&'static str],
    tool: Tool,
}

/// Command line of the program that unpacks, with `IN` and `OUT` for the files.
#[derive(Debug, PartialEq, Eq)]
enum Tool {
    /// Decompresses to one file.
    OneFile(&'static str),
    /// Extracts the files in the archive.
    Archive(&'static str),
}

/// Recognised formats. From: `magic(5)` of the program `file`, and the manual page of each tool.
const ALL: [Packing; 7] = [
    Packing {
        words: "a Zstandard-compressed file",
        magic: &ZSTD_MAGIC,
        magic_at: 0,
        endings: &["zstd", "zst"],
        tool: Tool::OneFile("zstd -d IN -o OUT"),
    },
    Packing {
        words: "a gzip-compressed file",
        magic: &[0x1f, 0x8b, 0x08],
        magic_at: 0,
        endings: &["gz"],
        tool: Tool::OneFile("gzip -dc IN > OUT"),
    },
    Packing {
        words: "a bzip2-compressed file",
        magic: b"BZh",
        magic_at: 0,
        endings: &["bz2"],
        tool: Tool::OneFile("bzip2 -dc IN > OUT"),
    },
    Packing {
        words: "an xz-compressed file",
        magic: b"\xfd7zXZ\0",
        magic_at: 0,
        endings: &["xz"],
        tool: Tool::OneFile("xz -dc IN > OUT"),
    },
    Packing {
        words: "an LZ4-compressed file",
        magic: &[0x04, 0x22, 0x4d, 0x18],
        magic_at: 0,
        endings: &["lz4"],
        tool: Tool::OneFile("lz4 -d IN OUT"),
    },
    Packing {
        words: "a zip archive",
        magic: b"PK\x03\x04",
        magic_at: 0,
        endings: &["zip"],
        tool: Tool::Archive("unzip IN"),
    },
    Packing {
        words: "a tar archive",
        magic: b"ustar",
        magic_at: 257,
        endings: &["tar"],
        tool: Tool::Archive("tar -xf IN"),
    },
];

impl Packing {
    /// Returns the format of a file with these first bytes, if it is recognised.
    pub(crate) fn of(beginning: &[u8]) -> Option<&'static Self> {
        let magic = |each: &&Self| {
            let from = beginning.get(each.magic_at..);
            from.is_some_and(|from| from.starts_with(each.magic))
        };
        ALL.iter().find(magic)
    }

    /// Returns the shell command that unpacks the file at `path`.
    pub(crate) fn command(&self, path: &Path) -> String {
        let is_tar = |path: &Path| path.extension().is_some_and(|ending| ending == "tar");
        let unpacked = unpacked_path(path);
        let tool = match (&self.tool, &unpacked) {
            (Tool::OneFile(_), Some(unpacked)) if is_tar(unpacked) => "tar -xf IN",
            (Tool::OneFile(tool) | Tool::Archive(tool), _) => tool,
        };
        let unpacked = unpacked.unwrap_or_else(|| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            path.with_file_name(format!("unpacked_{name}"))
        });
        let words = tool.split(' ').map(|word| match word {
            "IN" => quoted(path),
            "OUT" => quoted(&unpacked),
            word => word.to_owned(),
        });
        words.collect::<Vec<_>>().join(" ")
    }
}

/// Returns the path without the extension of a compressed file, e.g. `a.mcap` for `a.mcap.zstd`.
pub(crate) fn unpacked_path(path: &Path) -> Option<PathBuf> {
    let ending = path.extension()?.to_str()?.to_lowercase();
    let known = ALL.iter().flat_map(|each| each.endings);
    known
        .into_iter()
        .any(|each| *each == ending)
        .then(|| path.with_extension(""))
}

/// Returns the path quoted as one word of a shell command.
fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    let plain = |letter: char| letter.is_alphanumeric() || "/._-+=:@%".contains(letter);
    if text.chars().all(plain) && !text.starts_with('-') {
        return text.into_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use std::fs;
    use std::process::Command;

    use super::*;

    #[test]
    fn each_format_has_its_command() {
        let mut tar = vec![0; 512];
        tar[257..262].copy_from_slice(b"ustar");
        for (beginning, name, command) in [
            (
                &ZSTD_MAGIC[..],
                "a.mcap.zstd",
                "zstd -d a.mcap.zstd -o a.mcap",
            ),
            (b"\x1f\x8b\x08", "a.bag.gz", "gzip -dc a.bag.gz > a.bag"),
            (b"\x1f\x8b\x08", "a.tar.gz", "tar -xf a.tar.gz"),
            (b"BZh9", "a.bag.bz2", "bzip2 -dc a.bag.bz2 > a.bag"),
            (b"\xfd7zXZ\0", "it's.xz", r"xz -dc 'it'\''s.xz' > 'it'\''s'"),
            (
                b"\x04\x22\x4d\x18",
                "a.mcap",
                "lz4 -d a.mcap unpacked_a.mcap",
            ),
            (b"PK\x03\x04", "bag.zip", "unzip bag.zip"),
            (&tar, "bag.tar", "tar -xf bag.tar"),
        ] {
            let packing = Packing::of(beginning).unwrap();
            assert_eq!(packing.command(Path::new(name)), command);
        }
        assert_eq!(Packing::of(mcap::MAGIC), None);
    }

    #[test]
    fn the_command_unpacks() {
        let folder = tempfile::tempdir().unwrap();
        let packed = folder.path().join("of one.mcap.zstd");
        let content = b"some text";
        fs::write(&packed, zstd::bulk::compress(content, 0).unwrap()).unwrap();
        let beginning = fs::read(&packed).unwrap();
        let command = Packing::of(&beginning).unwrap().command(&packed);
        let ran = Command::new("sh").args(["-c", &command]).output().unwrap();
        let unpacked = fs::read(folder.path().join("of one.mcap"));
        // 127: the machine has no such program.
        if ran.status.code() != Some(127) {
            assert_eq!(unpacked.unwrap(), content, "{ran:?}");
        }
    }
}
