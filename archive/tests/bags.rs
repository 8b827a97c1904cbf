//! rosbag2 bags: folders, split files, SQLite.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Copied, PERIOD_NS, START_NS, read_all, shared, state, write};
use rusqlite::Connection;
use tauscope_archive::ros::{self, JointState, Message};
use tauscope_archive::{
    ArchiveError, Compression, Damage, DamageKind, Info, McapWriter, Recording, RecordingKind,
};

/// Schema and topics of a rosbag2 database.
pub const TABLES: &str = "
    CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
        serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
        timestamp INTEGER NOT NULL, data BLOB NOT NULL);
    INSERT INTO topics VALUES (7, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr', ''),
        (9, '/other', 'std_msgs/msg/String', 'cdr', '');
";
const INDEX: &str = "CREATE INDEX timestamp_idx ON messages (timestamp ASC);";

/// Writes joint states `range`, the odd ones before the even ones, each followed by another message.
fn database(path: &Path, range: std::ops::Range<i64>, tables: &str) {
    let connection = Connection::open(path).unwrap();
    connection.execute_batch(tables).unwrap();
    let mut insert = connection
        .prepare("INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)")
        .unwrap();
    let (odd, even): (Vec<_>, Vec<_>) = range.partition(|i| i % 2 == 1);
    connection.execute_batch("BEGIN").unwrap();
    for i in odd.into_iter().chain(even) {
        let mut body = Vec::new();
        ros::encode(&state(i), &mut body).unwrap();
        let ns = START_NS + i * PERIOD_NS;
        insert.execute((7, ns, body)).unwrap();
        insert.execute((9, ns, vec![0_u8; 3000])).unwrap();
    }
    connection.execute_batch("COMMIT").unwrap();
}

/// A joint state as `ros2_control` publishes it, with a sensor after the joints; joint `b` has no effort.
fn dynamic(i: i64) -> ros::DynamicJointState {
    let state = state(i);
    let interfaces = |named: &[(&str, f64)]| ros::InterfaceValue {
        interface_names: named.iter().map(|(name, _)| (*name).to_owned()).collect(),
        values: named.iter().map(|(_, value)| *value).collect(),
    };
    ros::DynamicJointState {
        header: state.header,
        joint_names: ["a", "b", "ft"].map(str::to_owned).to_vec(),
        interface_values: vec![
            interfaces(&[("effort", state.effort[0]), ("position", state.position[0])]),
            interfaces(&[("position", state.position[1])]),
            interfaces(&[("force.x", 7.0)]),
        ],
    }
}

#[test]
fn dynamic_joint_states_read_as_joint_states_out_of_every_bag() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dynamic.mcap");
    let mut writer = McapWriter::create(&path, Compression::Zstd, &BTreeMap::new()).unwrap();
    let topic = writer
        .add_topic::<ros::DynamicJointState>("/joint_states")
        .unwrap();
    let sqlite = folder.path().join("dynamic.db3");
    let connection = Connection::open(&sqlite).unwrap();
    let type_name = ros::DynamicJointState::TYPE;
    let tables = TABLES.replace(JointState::TYPE, type_name);
    connection.execute_batch(&tables).unwrap();
    for i in 0..50 {
        let ns = START_NS + i * PERIOD_NS;
        writer.write(topic, ns, ns, &dynamic(i)).unwrap();
        let mut body = Vec::new();
        ros::encode(&dynamic(i), &mut body).unwrap();
        let insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (7, ?1, ?2)";
        connection.execute(insert, (ns, body)).unwrap();
    }
    let mcap = writer.finish().unwrap().path;
    for path in [mcap, sqlite] {
        let recording = Recording::open(&path).unwrap();
        assert_eq!(joint_states_of(&recording).len(), 50);
        let info = Info::read(&recording).unwrap();
        let info = info.topics[0].joints.as_ref().unwrap();
        assert_eq!(info.names, ["a", "b"]);
        assert!(info.position && info.effort && !info.velocity);
        assert!(info.joints[1].lacks_effort);
    }
    // A topic of another type is rejected, with the types that are accepted.
    let other = write(&folder.path().join("other.mcap"), Compression::None, 20);
    let Err(error) = Recording::open(other).unwrap().joint_states("/contact") else {
        panic!("a flag is no joint state");
    };
    assert!(error.to_string().contains(type_name), "{error}");
}

fn joint_states_of(recording: &Recording) -> Vec<i64> {
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut times = Vec::new();
    while let Some(read) = states.next_state() {
        let read = read.unwrap();
        let i = times.len() as i64;
        assert_eq!(read.message.position, state(i).position);
        times.push(read.log_time_ns);
    }
    times
}

#[test]
fn rows_come_by_time_with_an_index_and_without() {
    let folder = tempfile::tempdir().unwrap();
    for (name, tables) in [
        ("index.db3", format!("{TABLES}{INDEX}")),
        ("plain.db3", TABLES.to_owned()),
    ] {
        let path = folder.path().join(name);
        // More than one page of 4 MiB.
        database(&path, 0..3000, &tables);
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.kind(), RecordingKind::Sqlite);
        assert_eq!(recording.topics()[0].message_count, 3000);
        assert_eq!(recording.topics()[0].type_hash, None);
        let times = joint_states_of(&recording);
        assert_eq!(times.len(), 3000);
        assert!(times.is_sorted());
        let (all, damaged) = read_all(&recording);
        assert_eq!((all.len(), damaged), (6000, 0));
        assert!(all.is_sorted_by_key(|message| message.log_time_ns));
    }
}

#[test]
fn a_torn_database_is_read_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.db3");
    database(&path, 0..3000, &format!("{TABLES}{INDEX}"));
    let bytes = fs::read(&path).unwrap();
    let mut read = Vec::new();
    for tenth in 1..10 {
        fs::write(&path, &bytes[..bytes.len() * tenth / 10]).unwrap();
        // SQLite refuses some at once; that is an error, and none that panics.
        let Ok(recording) = Recording::open(&path) else {
            continue;
        };
        let [damage] = recording.damage() else {
            panic!("{:?}", recording.damage());
        };
        assert!(matches!(damage.kind, DamageKind::Database { .. }));
        let (messages, _) = read_all(&recording);
        assert_eq!(messages.len() as u64, recording.message_count());
        read.push(messages.len());
    }
    assert!(read.is_sorted());
    assert!(read.last().is_some_and(|&count| count > 3000), "{read:?}");
}

#[test]
fn what_is_no_bag_of_ros_is_unreadable() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.db3");
    Connection::open(&path)
        .unwrap()
        .execute_batch("CREATE TABLE other(id INTEGER)")
        .unwrap();
    assert!(matches!(
        Recording::open(&path),
        Err(ArchiveError::Unreadable { .. })
    ));
    for (name, content, says) in [
        ("empty.mcap", &b""[..], "the file is empty"),
        (
            "ros1.bag",
            b"#ROSBAG V2.0\n....",
            "a header of 774778414 bytes",
        ),
        ("a.csv", b"1,2,3,4,5,6,7,8,9", "a.columns.yaml"),
        ("a.txt", b"some other text here", "no MCAP file"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let error = Recording::open(&path).err().unwrap().to_string();
        assert!(error.contains(says), "{error}");
    }
}

pub fn metadata(files: &[&str], mode: &str, format: &str) -> String {
    let files: Vec<_> = files.iter().map(|file| format!("    - {file}\n")).collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
         compression_mode: \"{mode}\"\n  compression_format: \"{format}\"\n  \
         relative_file_paths:\n{}",
        files.concat()
    )
}

/// Three MCAP files that follow each other, as rosbag2 splits them.
pub fn split_bag(folder: &Path) -> (PathBuf, Vec<Copied>) {
    let bag = folder.join("bag");
    let mut all = Vec::new();
    for part in 0..3 {
        let path = bag.join(format!("bag_{part}.mcap"));
        let count = 20 + 10 * part;
        write(&path, Compression::Zstd, count);
        all.extend(read_all(&Recording::open(&path).unwrap()).0);
    }
    all.sort_by_key(|message| message.log_time_ns);
    (bag, all)
}

#[test]
fn files_of_a_bag_are_read_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, all) = split_bag(folder.path());
    let files = ["bag_0.mcap", "bag/bag_1.mcap", "bag_2.mcap"];
    fs::write(bag.join("metadata.yaml"), metadata(&files, "", "")).unwrap();
    let recording = Recording::open(&bag).unwrap();
    assert_eq!(recording.kind(), RecordingKind::Rosbag2);
    assert!(recording.damage().is_empty());
    assert_eq!(recording.message_count(), all.len() as u64);
    assert_eq!(recording.topics().len(), 2);
    let (read, _) = read_all(&recording);
    // They overlap here, so only the times are in one order.
    let times = |messages: &[Copied]| -> Vec<i64> {
        messages.iter().map(|message| message.log_time_ns).collect()
    };
    assert_eq!(times(&read), times(&all));
    // One topic only.
    let contacts = crate::common::drain(recording.messages(&["/contact"]).unwrap()).0;
    assert!(contacts.iter().all(|message| message.topic == "/contact"));
    assert_eq!(contacts.len(), 2 + 3 + 4);
}

#[test]
fn a_bag_whose_recorder_was_killed() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, all) = split_bag(folder.path());
    let last = bag.join("bag_2.mcap");
    let bytes = fs::read(&last).unwrap();
    fs::write(&last, &bytes[..bytes.len() / 3]).unwrap();
    let recording = Recording::open(&bag).unwrap();
    let losses: Vec<_> = recording.damage().iter().map(Damage::loses_data).collect();
    // No metadata.yaml, which loses nothing, and a torn file.
    assert_eq!(losses, [false, true]);
    let (read, _) = read_all(&recording);
    assert!(read.len() > 50 && read.len() < all.len());
    assert_eq!(read.len() as u64, recording.message_count());
}

#[test]
fn a_real_sqlite_bag() {
    let Some(path) = shared(
        "a_real_sqlite_bag",
        "recordings/ur10-bag/ur10_exciting_trajectory.db3",
    ) else {
        return;
    };
    let recording = Recording::open(path).unwrap();
    assert_eq!(recording.topics()[0].message_count, 3441);
    assert_eq!(recording.start_ns(), Some(1));
    assert_eq!(recording.end_ns(), Some(27_520_000_000));
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut count = 0;
    while let Some(state) = states.next_state() {
        let state = state.unwrap().message;
        assert_eq!(state.name.len(), 6);
        assert_eq!(state.effort.len(), 6);
        count += 1;
    }
    assert_eq!(count, 3441);
}
