//! Small recordings made on the spot.
#![allow(dead_code, reason = "not every test file uses every helper")]
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use tauscope_archive::ros::{Bool, Header, JointState};
use tauscope_archive::{Compression, McapWriter, Messages, Recording};

/// Start time of the recordings \[ns since the epoch\].
pub const START_NS: i64 = 1_700_000_000_000_000_000;
/// Time from one joint state to the next \[ns\].
pub const PERIOD_NS: i64 = 10_000_000;

/// The `i`-th joint state of a recording.
pub fn state(i: i64) -> JointState {
    let x = i as f64;
    JointState {
        header: Header::new(START_NS + i * PERIOD_NS, "base"),
        name: vec!["a".into(), "b".into()],
        position: vec![x, -x],
        velocity: vec![],
        effort: vec![0.5 * x, f64::NAN],
    }
}

/// Writes `count` joint states at 100 Hz, and a contact flag with every tenth.
pub fn write(path: &Path, compression: Compression, count: i64) -> PathBuf {
    let provenance = BTreeMap::from([("version".to_owned(), "1".to_owned())]);
    let mut writer = McapWriter::create(path, compression, &provenance).unwrap();
    let states = writer.add_topic::<JointState>("/joint_states").unwrap();
    let contacts = writer.add_topic::<Bool>("/contact").unwrap();
    for i in 0..count {
        let ns = START_NS + i * PERIOD_NS;
        writer.write(states, ns + 5, ns, &state(i)).unwrap();
        if i % 10 == 0 {
            let data = i % 20 == 0;
            writer.write(contacts, ns + 6, ns, &Bool { data }).unwrap();
        }
    }
    writer.finish().unwrap().path
}

/// Writes bodies as they are to `/joint_states`. `kind` is the name of the schema, its encoding and the encoding of
/// the messages; without a name there is no schema.
pub fn mcap_of(path: &Path, kind: [&str; 3], bodies: &[Vec<u8>]) {
    let [name, schema, encoding] = kind;
    let mut writer = mcap::Writer::new(fs::File::create(path).unwrap()).unwrap();
    let schema = match name {
        "" => 0,
        name => writer.add_schema(name, schema, b"a text").unwrap(),
    };
    let none = BTreeMap::new();
    let channel = writer.add_channel(schema, "/joint_states", encoding, &none);
    let channel_id = channel.unwrap();
    for (i, body) in (0..).zip(bodies) {
        let ns = (START_NS + i * PERIOD_NS) as u64;
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: 0,
            log_time: ns,
            publish_time: ns,
        };
        writer.write_to_known_channel(&header, body).unwrap();
    }
    writer.finish().unwrap();
}

/// A message with its bytes copied.
#[derive(Debug, Clone, PartialEq)]
pub struct Copied {
    pub topic: String,
    pub log_time_ns: i64,
    pub publish_time_ns: i64,
    pub sequence: u32,
    pub body: Vec<u8>,
}

/// All that can be read, and how often something could not.
pub fn read_all(recording: &Recording) -> (Vec<Copied>, usize) {
    drain(recording.all_messages().unwrap())
}

pub fn drain(mut messages: Messages) -> (Vec<Copied>, usize) {
    let mut copies = Vec::new();
    let mut damaged = 0;
    while let Some(message) = messages.next_message() {
        match message {
            Ok(message) => copies.push(Copied {
                topic: message.topic.name.clone(),
                log_time_ns: message.log_time_ns,
                publish_time_ns: message.publish_time_ns,
                sequence: message.sequence,
                body: message.body.to_vec(),
            }),
            Err(error) => {
                assert!(error.damage().is_some(), "{error}");
                damaged += 1;
            }
        }
    }
    (copies, damaged)
}

/// Returns `../shared/<path>` next to the workspace. Without that folder, prints a visible line and returns `None`.
pub fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if shared.is_dir() {
        return Some(shared.join(path));
    }
    // Not `eprintln!`, which the test harness hides.
    let _ = writeln!(std::io::stderr(), "SKIPPED {test}: ../shared is absent");
    None
}
