//! Bags of ROS 1, as the PyPI package `rosbags` writes them; see `data/ros1_bags.py`.

#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::{Path, PathBuf};

use crate::common::{PERIOD_NS, START_NS, read_all, state};
use tauscope_archive::ros::{Bool, JointState};
use tauscope_archive::{ArchiveError, DamageKind, Info, Recording, RecordingKind};

const COUNT: i64 = 50;

fn golden(name: &str) -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    tests.join(name)
}

/// The bag without compression, changed.
fn changed(folder: &Path, change: impl FnOnce(&mut Vec<u8>)) -> PathBuf {
    let mut bytes = std::fs::read(golden("none.bag")).unwrap();
    change(&mut bytes);
    let path = folder.join("changed.bag");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Returns the offset of the `n`-th occurrence of `what`, counted from 0.
fn find(bytes: &[u8], what: &[u8], n: usize) -> usize {
    let mut places = (0..bytes.len()).filter(|&at| bytes[at..].starts_with(what));
    places.nth(n).unwrap()
}

/// Positions of joint `a`, and how often something could not be read.
fn positions(recording: &Recording) -> (Vec<f64>, usize) {
    let mut states = recording.joint_states("/joint_states").unwrap();
    let (mut positions, mut lost) = (Vec::new(), 0);
    while let Some(read) = states.next_state() {
        match read {
            Ok(read) => positions.push(read.message.position[0]),
            Err(error) => {
                let undecodable = matches!(error, ArchiveError::Decode { .. });
                assert!(undecodable || error.damage().is_some(), "{error}");
                lost += 1;
            }
        }
    }
    (positions, lost)
}

#[test]
fn joint_states_and_flags_come_out_of_every_compression_in_order_of_time() {
    for name in ["none.bag", "bz2.bag", "lz4.bag"] {
        let recording = Recording::open(golden(name)).unwrap();
        assert_eq!(recording.kind(), RecordingKind::Ros1Bag);
        assert_eq!(recording.damage(), []);
        assert_eq!(recording.start_ns(), Some(START_NS + 5));
        assert_eq!(recording.message_count(), 50 + 5 + 10);
        let mut states = recording.joint_states("/joint_states").unwrap();
        for i in 0..COUNT {
            let read = states.next_state().unwrap().unwrap();
            let JointState {
                header,
                name,
                position,
                velocity,
                effort,
            } = read.message;
            let expected = state(i);
            assert_eq!(read.log_time_ns, START_NS + i * PERIOD_NS + 5);
            assert_eq!((header, name), (&expected.header, &expected.name));
            assert_eq!(
                (position, velocity),
                (&expected.position, &expected.velocity)
            );
            assert_eq!(effort[..1], expected.effort[..1]);
            assert!(effort[1].is_nan());
        }
        assert!(states.next_state().is_none());
        recording.topic_of::<Bool>("/contact").unwrap();
        let mut flags = recording.messages(&["/contact"]).unwrap();
        let mut told = Vec::new();
        while let Some(flag) = flags.next_message() {
            told.push(flag.unwrap().decode::<Bool>().unwrap().data);
        }
        assert_eq!(told, [true, false, true, false, true]);
        // Messages that are not converted are returned unchanged.
        let (all, lost) = read_all(&recording);
        assert_eq!((all.len(), lost), (65, 0));
        let text = all
            .iter()
            .find(|message| message.topic == "/other")
            .unwrap();
        assert_eq!(text.body, b"\x06\0\0\0text 0");
    }
}

#[test]
fn chunks_outside_the_time_that_is_asked_for_are_not_read() {
    for name in ["none.bag", "lz4.bag"] {
        let recording = Recording::open(golden(name)).unwrap();
        let read = |within_ns| {
            let topics = ["/joint_states"];
            let mut messages = recording.messages_within(&topics, within_ns).unwrap();
            let mut times = Vec::new();
            while let Some(message) = messages.next_message() {
                times.push(message.unwrap().log_time_ns);
            }
            (times, messages.chunks_read())
        };
        let at = |i: i64| START_NS + i * PERIOD_NS + 5;
        let (all, chunks) = read(i64::MIN..=i64::MAX);
        assert_eq!((all.len(), chunks), (50, recording.chunks()), "{name}");
        let (some, fewer) = read(at(10)..=at(12));
        assert_eq!(some, [at(10), at(11), at(12)]);
        assert!(0 < fewer && fewer < chunks, "{name}: {fewer} of {chunks}");
        assert_eq!(read(at(60)..=at(70)), (Vec::new(), 0));
    }
}

#[test]
fn info_tells_what_is_in_a_bag() {
    let recording = Recording::open(golden("lz4.bag")).unwrap();
    let info = Info::read(&recording).unwrap();
    let states = info
        .topics
        .iter()
        .find(|topic| topic.topic.name == "/joint_states");
    let joints = states.unwrap().joints.as_ref().unwrap();
    assert_eq!(joints.names, ["a", "b"]);
    assert!(joints.position && joints.effort && !joints.velocity);
}

#[test]
fn a_bag_that_was_not_closed_is_read_without_its_index() {
    let folder = tempfile::tempdir().unwrap();
    let index_pos = b"index_pos=";
    let path = changed(folder.path(), |bytes| {
        let at = find(bytes, index_pos, 0) + index_pos.len();
        let index = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        bytes[at..at + 8].fill(0);
        bytes.truncate(index);
    });
    let recording = Recording::open(&path).unwrap();
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert!(!damage.loses_data(), "{damage}");
    assert!(damage.to_string().contains("did not close"), "{damage}");
    assert_eq!(recording.message_count(), 65);
    assert_eq!(positions(&recording).0.len(), 50);
}

#[test]
fn a_torn_bag_gives_what_lies_before_the_tear_wherever_it_is() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["none.bag", "bz2.bag", "lz4.bag"] {
        let whole = std::fs::read(golden(name)).unwrap();
        let mut last = 0;
        for len in (20..whole.len()).step_by(61) {
            let path = folder.path().join("torn.bag");
            std::fs::write(&path, &whole[..len]).unwrap();
            let recording = match Recording::open(&path) {
                Ok(recording) => recording,
                Err(error) => {
                    assert!(len < 4200, "{len}: {error}");
                    assert!(
                        error.to_string().contains("ends within its header"),
                        "{error}"
                    );
                    continue;
                }
            };
            assert!(!recording.damage().is_empty(), "{name} cut to {len}");
            let (all, lost) = read_all(&recording);
            assert_eq!(all.len() as u64, recording.message_count());
            assert_eq!(lost, 0, "{name} cut to {len}");
            // bzip2 gives a block whole or not at all, and lz4 a block too.
            assert!(
                all.len() >= last,
                "{name} cut to {len}: {} after {last}",
                all.len()
            );
            last = all.len();
        }
        assert_eq!(last, 65, "{name}");
    }
}

#[test]
fn declared_sizes_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let size = b"size=";
    // Every chunk says that it unpacks to 4 GiB.
    let path = changed(folder.path(), |bytes| {
        for n in 0..3 {
            let at = find(bytes, size, n) + size.len();
            bytes[at..at + 4].fill(0xff);
        }
    });
    let recording = Recording::open(&path).unwrap();
    let (left, lost) = positions(&recording);
    assert!(
        left.len() < 50 && lost == 3,
        "{} states, {lost} losses",
        left.len()
    );
    let mut messages = recording.all_messages().unwrap();
    let error = std::iter::from_fn(|| messages.next_message().map(|read| read.map(|_| ())))
        .find_map(Result::err)
        .unwrap();
    assert!(
        error.to_string().contains("4294967295 bytes, the limit is"),
        "{error}"
    );
    let chunk =
        |error: &ArchiveError| matches!(&error.damage().unwrap().kind, DamageKind::Chunk { .. });
    assert!(chunk(&error));

    // A joint state with four thousand million names.
    let path = changed(folder.path(), |bytes| {
        let at = find(bytes, b"\x04\0\0\0base\x02\0\0\0", 0) + 8;
        bytes[at..at + 4].fill(0xff);
    });
    let recording = Recording::open(&path).unwrap();
    let (left, lost) = positions(&recording);
    assert_eq!((left.len(), lost), (49, 1));

    // The header of the bag's first chunk claims more than there is.
    let path = changed(folder.path(), |bytes| {
        let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let header_len = u32_at(13);
        let chunk = 13 + 4 + header_len + 4 + u32_at(17 + header_len);
        bytes[chunk..chunk + 4].fill(0xff);
        let at = find(bytes, b"index_pos=", 0) + 10;
        bytes[at..at + 8].fill(0);
    });
    let recording = Recording::open(&path).unwrap();
    let told = recording.damage()[0].to_string();
    assert!(told.contains("a header of 4294967295 bytes"), "{told}");
    let error = recording.joint_states("/joint_states").err().unwrap();
    assert!(
        error.to_string().contains("the recording is empty"),
        "{error}"
    );
}

#[test]
fn what_unpacks_to_more_than_it_says_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["bz2.bag", "lz4.bag"] {
        let mut bytes = std::fs::read(golden(name)).unwrap();
        let at = find(&bytes, b"size=", 0) + 5;
        bytes[at..at + 4].copy_from_slice(&100_u32.to_le_bytes());
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let recording = Recording::open(&path).unwrap();
        let (left, lost) = positions(&recording);
        assert!(!left.is_empty() && lost == 1, "{name}: {lost}");
    }
}

#[test]
fn no_changed_byte_makes_the_reader_panic() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(golden("none.bag")).unwrap();
    let path = folder.path().join("changed.bag");
    for at in (0..whole.len()).filter(|at| !(200..4100).contains(at)) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        std::fs::write(&path, bytes).unwrap();
        if let Ok(recording) = Recording::open(&path) {
            let mut messages = recording.all_messages().unwrap();
            while messages.next_message().is_some() {}
        }
    }
}

#[test]
fn another_version_or_definition_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |bytes| bytes[9] = b'1');
    let error = Recording::open(&path).err().unwrap().to_string();
    assert!(error.contains("only version 2.0 can be read"), "{error}");

    let md5sum = b"3066dcd76a6cfaef579bd0f34173e9fd";
    let path = changed(folder.path(), |bytes| {
        // In its chunk and in the index.
        for _ in 0..2 {
            let at = find(bytes, md5sum, 0);
            bytes[at] = b'0';
        }
    });
    let recording = Recording::open(&path).unwrap();
    let error = recording.joint_states("/joint_states").err().unwrap();
    assert!(
        error
            .to_string()
            .contains("of another definition, md5sum 0066"),
        "{error}"
    );
}
