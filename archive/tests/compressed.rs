//! Compressed files, and files with compressed messages.

#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::fs;
use std::path::Path;

use proptest::prelude::*;
use rusqlite::Connection;
use tauscope_archive::ros::{self, DecodeError};
use tauscope_archive::{ArchiveError, Compression, Info, Recording};

use crate::bags::{TABLES, metadata};
use crate::common::{PERIOD_NS, START_NS, mcap_of, read_all, state, write};

/// Joint state `i` as CDR, compressed.
fn compressed(i: i64) -> Vec<u8> {
    let mut body = Vec::new();
    ros::encode(&state(i), &mut body).unwrap();
    zstd::bulk::compress(&body, 0).unwrap()
}

fn sqlite_of(path: &Path, bodies: &[Vec<u8>]) {
    let connection = Connection::open(path).unwrap();
    connection.execute_batch(TABLES).unwrap();
    for (i, body) in (0..).zip(bodies) {
        let insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (7, ?1, ?2)";
        let ns: i64 = START_NS + i * PERIOD_NS;
        connection.execute(insert, (ns, body)).unwrap();
    }
}

fn mcap(path: &Path, bodies: &[Vec<u8>]) {
    mcap_of(
        path,
        ["sensor_msgs/msg/JointState", "ros2msg", "cdr"],
        bodies,
    );
}

fn assert_is_read(path: &Path, count: i64) {
    let recording = Recording::open(path).unwrap();
    assert_eq!(recording.damage(), []);
    let mut states = recording.joint_states("/joint_states").unwrap();
    for i in 0..count {
        let read = states.next_state().unwrap().unwrap();
        assert_eq!(read.message.position, state(i).position);
    }
    assert!(states.next_state().is_none());
}

#[test]
fn compressed_messages_are_read_from_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let bodies: Vec<_> = (0..10).map(compressed).collect();
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).unwrap();
    sqlite_of(&bag.join("bag_0.db3"), &bodies);
    assert_is_read(&bag.join("bag_0.db3"), 10);
    for mode in ["MESSAGE", "message", ""] {
        let text = metadata(&["bag_0.db3"], mode, "zstd");
        fs::write(bag.join("metadata.yaml"), text).unwrap();
        assert_is_read(&bag, 10);
    }
    let path = folder.path().join("a.mcap");
    mcap(&path, &bodies);
    assert_is_read(&path, 10);
}

#[test]
fn messages_that_cannot_be_decompressed_are_counted_with_their_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut bodies: Vec<_> = (0..10).map(compressed).collect();
    for body in &mut bodies[5..] {
        body.truncate(20);
    }
    // A frame of 65 MiB.
    bodies.push(zstd::bulk::compress(&vec![0; 65 << 20], 0).unwrap());
    mcap(&path, &bodies);
    let recording = Recording::open(&path).unwrap();
    let info = Info::read(&recording).unwrap();
    let [topic] = info.topics.as_slice() else {
        panic!("{:?}", info.topics);
    };
    assert_eq!(topic.undecodable, 6);
    let [reason] = topic.undecodable_reasons.as_slice() else {
        panic!("{:?}", topic.undecodable_reasons);
    };
    assert_eq!(reason.count, 6);
    assert_eq!(reason.first_log_time_ns, START_NS + 5 * PERIOD_NS);
    let text = info.to_string();
    assert!(
        text.contains("6 messages cannot be used: the message is compressed with Zstandard"),
        "{text}"
    );
    assert!(
        text.contains("record without message compression"),
        "{text}"
    );
    let mut states = recording.joint_states("/joint_states").unwrap();
    let last = std::iter::from_fn(|| states.next_state().map(Result::err)).last();
    let Some(Some(ArchiveError::Decode { source, .. })) = last else {
        panic!("{last:?}");
    };
    assert!(
        source.to_string().contains("longer than 64 MiB"),
        "{source}"
    );
}

#[test]
fn a_live_message_that_is_compressed_is_recognised() {
    let error = ros::decode::<ros::JointState>(&compressed(1)).unwrap_err();
    assert!(matches!(error, DecodeError::Encapsulation { .. }));
    assert!(error.to_string().contains("compressed with Zstandard"));
}

#[test]
fn compressed_files_are_refused_with_the_command_that_unpacks_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder.path().join("a.mcap"), Compression::None, 20);
    let content = fs::read(&path).unwrap();
    let packed = folder.path().join("b.mcap.zstd");
    fs::write(&packed, zstd::bulk::compress(&content, 0).unwrap()).unwrap();
    let error = Recording::open(&packed).err().unwrap();
    let ArchiveError::Compressed { command, .. } = &error else {
        panic!("{error}");
    };
    let name = packed.display();
    let unpacked = folder.path().join("b.mcap");
    assert_eq!(
        *command,
        format!("zstd -d {name} -o {}", unpacked.display())
    );
    assert_eq!(
        error.to_string(),
        format!("{name} is a Zstandard-compressed file. Unpack it first: `{command}`")
    );
}

/// Packs the bag's files, with and without `metadata.yaml`.
#[test]
fn a_bag_of_compressed_files_is_refused_until_they_are_unpacked() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    let files = ["bag_0.mcap.zstd", "bag_1.mcap.zstd"];
    for (i, file) in files.iter().enumerate() {
        let plain = write(&bag.join(format!("bag_{i}.mcap")), Compression::None, 20);
        let content = fs::read(&plain).unwrap();
        fs::write(bag.join(file), zstd::bulk::compress(&content, 0).unwrap()).unwrap();
        fs::rename(&plain, folder.path().join(format!("bag_{i}.mcap"))).unwrap();
    }
    for with_metadata in [false, true] {
        if with_metadata {
            fs::write(bag.join("metadata.yaml"), metadata(&files, "FILE", "zstd")).unwrap();
        }
        let error = Recording::open(&bag).err().unwrap().to_string();
        assert!(error.contains("bag_0.mcap.zstd is a Zstandard-compressed file"));
        assert!(error.contains("Unpack it first: `zstd -d "), "{error}");
        assert!(error.ends_with(", and likewise 1 other file of the bag"));
    }
    fs::copy(folder.path().join("bag_0.mcap"), bag.join("bag_0.mcap")).unwrap();
    let recording = Recording::open(&bag).unwrap();
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert!(damage.loses_data() && damage.to_string().contains("`zstd -d "));
    fs::copy(folder.path().join("bag_1.mcap"), bag.join("bag_1.mcap")).unwrap();
    let recording = Recording::open(&bag).unwrap();
    assert_eq!(
        (recording.damage(), read_all(&recording).0.len()),
        (&[][..], 44)
    );
}

/// First bytes of files that are opened in different ways.
const MAGICS: [&[u8]; 10] = [
    b"\x28\xb5\x2f\xfd",
    b"\x1f\x8b\x08",
    b"BZh9",
    b"\xfd7zXZ\0",
    b"\x04\x22\x4d\x18",
    b"PK\x03\x04",
    b"SQLite format 3\0",
    b"#ROSBAG V2.0\n",
    b"\x89MCAP0\r\n",
    b"<robot",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_bytes_behind_a_magic_make_it_panic(
        magic in 0..MAGICS.len(),
        rest in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, [MAGICS[magic], &rest].concat()).unwrap();
        if let Ok(recording) = Recording::open(&path) {
            let _ = Info::read(&recording);
        }
    }

    #[test]
    fn no_compressed_message_makes_it_panic(
        rests in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..100), 1..5),
        packed: bool,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let bodies: Vec<_> = rests.iter().map(|rest| {
            if packed {
                return zstd::bulk::compress(rest, 0).unwrap();
            }
            [b"\x28\xb5\x2f\xfd", rest.as_slice()].concat()
        }).collect();
        mcap(&path, &bodies);
        let info = Info::read(&Recording::open(&path).unwrap()).unwrap();
        prop_assert_eq!(info.topics[0].undecodable, rests.len() as u64);
    }
}
