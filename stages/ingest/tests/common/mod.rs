//! Shared helpers for the tests of the sources.
#![allow(
    dead_code,
    clippy::unwrap_used,
    reason = "each test file uses its own part, and a test may fail here"
)]

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use tauscope_archive::{Compression, McapWriter, ros};
use tauscope_bus::{Emit, LinkError, Progress, Sample, Source};
use tauscope_ingest::{FileConfig, Setup, Topics};

/// Buffer of emitted samples.
pub struct Collect<T>(pub Vec<T>);

impl<T: Sample> Emit<T> for Collect<T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut slot = T::default();
        write(&mut slot);
        self.0.push(slot);
        Ok(())
    }
}

/// Makes a step of a live source, and waits after one without data, in place of an event loop.
pub fn step<T: Sample>(source: &mut impl Source<T>, out: &mut Collect<T>) {
    let progress = source.step(out).unwrap();
    if matches!(progress, Progress::Idle | Progress::Until(_)) {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
}

/// Returns all samples of a source that ends.
pub fn drain<T: Sample>(source: &mut impl Source<T>) -> Vec<T> {
    let mut out = Collect(Vec::new());
    while source.step(&mut out).unwrap() != Progress::End {}
    out.0
}

/// A cell with these joints.
pub fn cell(joints: &str) -> Setup {
    Setup {
        cell: "demo".to_owned(),
        joint_names: joints.split_whitespace().map(str::to_owned).collect(),
        effort_limits: Vec::new(),
        tool: None,
        has_tool_link: false,
    }
}

/// Returns the settings of the recording at `path`, with the default topics.
pub fn file(path: &Path) -> FileConfig {
    FileConfig {
        path: path.to_owned(),
        topics: Topics::default(),
    }
}

/// Returns a joint state without velocities; an empty slice leaves its field empty.
pub fn state(stamp_ns: i64, names: &str, position: &[f64], effort: &[f64]) -> ros::JointState {
    ros::JointState {
        header: ros::Header::new(stamp_ns, ""),
        name: names.split_whitespace().map(str::to_owned).collect(),
        position: position.to_vec(),
        velocity: Vec::new(),
        effort: effort.to_vec(),
    }
}

/// Writes messages, each with its topic and log time, in this order.
pub fn write_bag(path: &Path, messages: &[(&str, i64, ros::JointState)]) {
    let mut writer = McapWriter::create(path, Compression::Zstd, &BTreeMap::default()).unwrap();
    let mut topics = BTreeMap::new();
    for (topic, log_time_ns, message) in messages {
        let topic = *topics
            .entry(*topic)
            .or_insert_with(|| writer.add_topic(topic).unwrap());
        writer
            .write(topic, *log_time_ns, *log_time_ns, message)
            .unwrap();
    }
    writer.finish().unwrap();
}

/// A file of `../shared`; `None`, with a visible line, where that folder is absent.
pub fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    if shared.is_dir() {
        return Some(shared.join(path));
    }
    // Not `eprintln!`, whose output the test harness captures.
    let _ = writeln!(std::io::stderr(), "SKIPPED {test}: ../shared is absent");
    None
}
