//! Joint states of a bundled recording, written in other formats.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Builder, Int64Array, ListBuilder, RecordBatch};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression as Codec, ZstdLevel};
use parquet::file::properties::WriterProperties;
use tauscope_archive::ros::{DynamicJointState, InterfaceValue, JointState};
use tauscope_archive::{Compression, McapWriter, Recording};

use crate::common::bundled;

const STATES: &str = "/joint_states";

/// Joint states with their times of recording \[ns since the epoch\].
type States = Vec<(i64, JointState)>;

/// Function that writes joint states into a folder, under this name without its extension.
pub type Format = fn(&Path, &str) -> PathBuf;

/// Joint states of a bundled recording, named without its extension.
fn states(name: &str) -> States {
    let recording = Recording::open(bundled().join(format!("{name}.mcap"))).unwrap();
    let mut read = recording.joint_states(STATES).unwrap();
    let mut states = Vec::new();
    while let Some(state) = read.next_state() {
        let state = state.unwrap();
        states.push((state.log_time_ns, state.message.clone()));
    }
    states
}

/// `sensor_msgs/msg/JointState` in MCAP: the reference for the other formats.
pub fn mcap(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(format!("{name}.mcap"));
    let mut writer = McapWriter::create(&path, Compression::None, &BTreeMap::new()).unwrap();
    let topic = writer.add_topic::<JointState>(STATES).unwrap();
    for (at, state) in states(name) {
        writer.write(topic, at, at, &state).unwrap();
    }
    writer.finish().unwrap().path
}

/// `control_msgs/msg/DynamicJointState` in MCAP.
pub fn dynamic_joint_states(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(format!("{name}.mcap"));
    let mut writer = McapWriter::create(&path, Compression::None, &BTreeMap::new()).unwrap();
    let topic = writer.add_topic::<DynamicJointState>(STATES).unwrap();
    for (at, state) in states(name) {
        let quantities = [
            ("position", &state.position),
            ("velocity", &state.velocity),
            ("effort", &state.effort),
        ];
        let of_joint = |joint: usize| {
            let known = quantities
                .iter()
                .filter_map(|(name, values)| Some(((*name).to_owned(), *values.get(joint)?)));
            let (interface_names, values) = known.unzip();
            InterfaceValue {
                interface_names,
                values,
            }
        };
        let message = DynamicJointState {
            header: state.header.clone(),
            interface_values: (0..state.name.len()).map(of_joint).collect(),
            joint_names: state.name.clone(),
        };
        writer.write(topic, at, at, &message).unwrap();
    }
    writer.finish().unwrap().path
}

/// A LeRobot data set of version 2.1 with one episode, whose features are those of ALOHA and hold `float64`.
pub fn lerobot(folder: &Path, name: &str) -> PathBuf {
    let states = states(name);
    let root = folder.join(name);
    let file = "data/chunk-000/episode_000000.parquet";
    for folder in ["meta", "data/chunk-000"] {
        std::fs::create_dir_all(root.join(folder)).unwrap();
    }
    let joints = &states[0].1.name;
    let feature = serde_json::json!({"dtype": "float64", "shape": [joints.len()], "names": {"motors": joints}});
    let features = [
        "observation.state",
        "observation.velocity",
        "observation.effort",
    ];
    let info = serde_json::json!({
        "codebase_version": "v2.1",
        "total_episodes": 1,
        "fps": 100,
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "features": features.map(|name| (name, feature.clone())).into_iter().collect::<BTreeMap<_, _>>(),
    });
    std::fs::write(root.join("meta/info.json"), info.to_string()).unwrap();

    let start_ns = states[0].1.header.stamp.ns();
    let mut times = Float64Builder::new();
    let mut columns = features.map(|_| ListBuilder::new(Float64Builder::new()));
    for (_, state) in &states {
        times.append_value((state.header.stamp.ns() - start_ns) as f64 * 1e-9);
        let quantities = [&state.position, &state.velocity, &state.effort];
        for (column, values) in columns.iter_mut().zip(quantities) {
            column.values().append_slice(values);
            column.append(true);
        }
    }
    let episode = Int64Array::from(vec![0; states.len()]);
    let mut table: Vec<(&str, ArrayRef)> = vec![
        ("timestamp", Arc::new(times.finish())),
        ("episode_index", Arc::new(episode)),
    ];
    for (name, mut column) in features.into_iter().zip(columns) {
        table.push((name, Arc::new(column.finish())));
    }
    let batch = RecordBatch::try_from_iter(table).unwrap();
    let packed = WriterProperties::builder().set_compression(Codec::ZSTD(ZstdLevel::default()));
    let file = File::create(root.join(file)).unwrap();
    let mut writer = ArrowWriter::try_new(file, batch.schema(), Some(packed.build())).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    root
}

/// A bag of ROS 1 with one uncompressed chunk.
pub fn ros1_bag(folder: &Path, name: &str) -> PathBuf {
    let states = states(name);
    let path = folder.join(format!("{name}.bag"));
    let number = 0_u32.to_le_bytes();
    let connection = {
        let about = fields(&[
            ("topic", STATES.as_bytes()),
            ("type", b"sensor_msgs/JointState"),
            ("md5sum", b"3066dcd76a6cfaef579bd0f34173e9fd"),
            ("message_definition", b""),
        ]);
        let header = [
            ("op", &[0x07][..]),
            ("conn", &number),
            ("topic", STATES.as_bytes()),
        ];
        record(&header, &about)
    };
    let mut chunk = connection.clone();
    for (at, state) in &states {
        let header = [
            ("op", &[0x02][..]),
            ("conn", &number),
            ("time", &ros1_time(*at)),
        ];
        chunk.extend(record(&header, &ros1_joint_state(state)));
    }
    let size = u32::try_from(chunk.len()).unwrap().to_le_bytes();
    let header = [
        ("op", &[0x05][..]),
        ("compression", b"none"),
        ("size", &size),
    ];
    let chunk = record(&header, &chunk);

    let magic = b"#ROSBAG V2.0\n";
    let bag_header = |index_at: u64| {
        let one = 1_u32.to_le_bytes();
        let header = [
            ("op", &[0x03][..]),
            ("index_pos", &index_at.to_le_bytes()),
            ("conn_count", &one),
            ("chunk_count", &one),
        ];
        record(&header, &[b' '; 4000])
    };
    let chunk_at = (magic.len() + bag_header(0).len()) as u64;
    let index_at = chunk_at + chunk.len() as u64;
    let mut count = number.to_vec();
    count.extend(u32::try_from(states.len()).unwrap().to_le_bytes());
    let header = [
        ("op", &[0x06][..]),
        ("ver", &1_u32.to_le_bytes()),
        ("chunk_pos", &chunk_at.to_le_bytes()),
        ("start_time", &ros1_time(states[0].0)),
        ("end_time", &ros1_time(states[states.len() - 1].0)),
        ("count", &1_u32.to_le_bytes()),
    ];
    let chunk_info = record(&header, &count);
    let header = bag_header(index_at);
    let parts = [&magic[..], &header, &chunk, &connection, &chunk_info];
    std::fs::write(&path, parts.concat()).unwrap();
    path
}

fn prefixed(bytes: &[u8]) -> Vec<u8> {
    let len = u32::try_from(bytes.len()).unwrap();
    [&len.to_le_bytes(), bytes].concat()
}

fn fields(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let each = fields
        .iter()
        .map(|(name, value)| prefixed(&[name.as_bytes(), b"=", value].concat()));
    each.collect::<Vec<_>>().concat()
}

fn record(header: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    [prefixed(&fields(header)), prefixed(data)].concat()
}

fn ros1_time(ns: i64) -> [u8; 8] {
    let part = |ns: i64| u32::try_from(ns).unwrap().to_le_bytes();
    let parts = [part(ns / 1_000_000_000), part(ns % 1_000_000_000)];
    parts.concat().try_into().unwrap()
}

fn ros1_joint_state(state: &JointState) -> Vec<u8> {
    let count = |len: usize| u32::try_from(len).unwrap().to_le_bytes();
    let stamp = &state.header.stamp;
    let mut body = 0_u32.to_le_bytes().to_vec();
    body.extend(stamp.sec.to_le_bytes());
    body.extend(stamp.nanosec.to_le_bytes());
    body.extend(prefixed(state.header.frame_id.as_bytes()));
    body.extend(count(state.name.len()));
    for name in &state.name {
        body.extend(prefixed(name.as_bytes()));
    }
    for values in [&state.position, &state.velocity, &state.effort] {
        body.extend(count(values.len()));
        body.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    body
}
