//! Parquet tables that declare more than they hold: refused with a reason, and without the memory that they ask for.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::fs;
use std::path::Path;

use tauscope_archive::Recording;

/// More memory than a page and its unpacked bytes may not be needed \[kB\].
const MOST_KB: u64 = 200_000;

/// Thrift's compact protocol, as far as a footer and a page header need it.
#[derive(Default, Clone)]
struct Struct(Vec<u8>, i16);

impl Struct {
    fn head(&mut self, id: i16, kind: u8) {
        let step = u8::try_from(id - self.1).unwrap();
        self.0.push(step << 4 | kind);
        self.1 = id;
    }

    fn varint(&mut self, mut value: u64) {
        while value > 0x7f {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    /// An integer of 64 bits, which is read as any other.
    fn integer(mut self, id: i16, value: i64) -> Self {
        self.head(id, 6);
        self.varint(((value << 1) ^ (value >> 63)) as u64);
        self
    }

    fn text(mut self, id: i16, text: &str) -> Self {
        self.head(id, 8);
        self.varint(text.len() as u64);
        self.0.extend(text.as_bytes());
        self
    }

    fn inner(mut self, id: i16, inner: Self) -> Self {
        self.head(id, 12);
        self.0.extend(inner.end());
        self
    }

    /// A list that says it has `count` structs.
    fn list(mut self, id: i16, count: u64, structs: &[Self]) -> Self {
        self.head(id, 9);
        self.0.push(0xfc);
        self.varint(count);
        for inner in structs {
            self.0.extend(inner.clone().end());
        }
        self
    }

    fn end(mut self) -> Vec<u8> {
        self.0.push(0);
        self.0
    }
}

/// Numbers that a table declares, at the following indices.
type Declared = [i64; 6];
const ROWS: usize = 0;
const GROUPS: usize = 1;
/// 0 is none, 2 is Gzip, 6 is Zstandard.
const CODEC: usize = 2;
const UNPACKED: usize = 3;
const PACKED: usize = 4;
const VALUES: usize = 5;

/// Two numbers of eight bytes, as they are.
const SOUND: Declared = [2, 1, 0, 16, 16, 2];

fn but(mut declared: Declared, at: usize, value: i64) -> Declared {
    declared[at] = value;
    declared
}

/// A table with one page of one column, `episode_index`.
fn table(declared: &Declared, page: &[u8]) -> Vec<u8> {
    let data = Struct::default()
        .integer(1, declared[VALUES])
        .integer(2, 0)
        .integer(3, 3)
        .integer(4, 3);
    let header = Struct::default()
        .integer(1, 0)
        .integer(2, declared[UNPACKED])
        .integer(3, declared[PACKED])
        .inner(5, data);
    let mut bytes = b"PAR1".to_vec();
    let start = bytes.len() as i64;
    bytes.extend(header.end());
    bytes.extend(page);
    let length = bytes.len() as i64 - start;
    let root = Struct::default().text(4, "schema").integer(5, 1);
    let column = Struct::default().integer(1, 2).text(4, "episode_index");
    let metadata = Struct::default()
        .integer(1, 2)
        .integer(4, declared[CODEC])
        .integer(5, declared[VALUES])
        .integer(7, length)
        .integer(9, start);
    let chunk = Struct::default().inner(3, metadata);
    let group = Struct::default()
        .list(1, 1, &[chunk])
        .integer(3, declared[ROWS]);
    let footer = Struct::default()
        .list(2, 2, &[root, column])
        .integer(3, declared[ROWS])
        .list(4, declared[GROUPS] as u64, &[group])
        .end();
    bytes.extend(&footer);
    bytes.extend(u32::try_from(footer.len()).unwrap().to_le_bytes());
    bytes.extend(b"PAR1");
    bytes
}

/// Why the table cannot be read as the rows of an episode.
fn refusal(bytes: &[u8]) -> String {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/lerobot/times");
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    fs::create_dir_all(set.join("meta")).unwrap();
    fs::create_dir_all(set.join("data/chunk-000")).unwrap();
    fs::copy(data.join("meta/info.json"), set.join("meta/info.json")).unwrap();
    fs::write(set.join("data/chunk-000/episode_000000.parquet"), bytes).unwrap();
    let opened = Recording::open(set.join("episode_000000"));
    let said = opened.map(|_| ()).unwrap_err().to_string();
    let used = fs::read_to_string("/proc/self/status").unwrap();
    let used = used.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let used: u64 = used
        .unwrap()
        .trim()
        .strip_suffix(" kB")
        .unwrap()
        .parse()
        .unwrap();
    assert!(used < MOST_KB, "{used} kB for {said}");
    said
}

#[test]
fn what_a_table_declares_is_not_believed() {
    let zeros = [0; 16];
    // As it is, it has the episode 0, and no positions.
    let said = refusal(&table(&SOUND, &zeros));
    assert!(said.contains("no column \"observation.state\""), "{said}");
    for (at, value, words) in [
        (UNPACKED, 1 << 31, "at most 33554432"),
        (UNPACKED, -5, "sizes that do not fit"),
        (PACKED, 1 << 40, "sizes that do not fit"),
        (CODEC, 2, "compressed with Gzip"),
        (ROWS, 1 << 40, "more than 16 million rows"),
        (ROWS, -1, "not as the format says"),
        (ROWS, 1 << 20, "fewer rows than the footer says"),
        (ROWS, 1, "more rows than the footer says"),
        (GROUPS, 1 << 40, "not as the format says"),
        (VALUES, 1 << 60, "a page ends before its last number"),
        (VALUES, -1, "sizes that do not fit"),
    ] {
        let said = refusal(&table(&but(SOUND, at, value), &zeros));
        let is_named = said.contains("episode_000000.parquet");
        assert!(is_named && said.contains(words), "{at} {value}: {said}");
    }
}

#[test]
fn what_unpacks_to_more_than_it_says_is_refused() {
    let bomb = zstd::bulk::compress(&vec![0; 1 << 27], 1).unwrap();
    let declared = but(but(SOUND, CODEC, 6), PACKED, bomb.len() as i64);
    let said = refusal(&table(&declared, &bomb));
    assert!(said.contains("another length than it says"), "{said}");
}

#[test]
fn a_footer_longer_than_the_limit_is_not_read() {
    let mut long = table(&SOUND, &[0; 16]);
    let at = long.len() - 8;
    long[at..at + 4].copy_from_slice(&0x3fff_ffff_u32.to_le_bytes());
    let said = refusal(&long);
    let words = "the footer of the Parquet table is 1073741823 bytes";
    assert!(said.contains(words), "{said}");
}
