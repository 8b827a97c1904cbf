//! The bundled recordings as a labelled set, and damaged copies of them.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use tauscope_archive::ros::JointState;
use tauscope_archive::{Compression, McapWriter, Recording};

use crate::common::{Out, bundled, write};

const STATES: &str = "/joint_states";

/// Files of a labelled set; recordings without a folder are the bundled ones.
pub struct Set {
    pub robot: PathBuf,
    pub labels: Option<PathBuf>,
    pub train: Vec<PathBuf>,
    pub validation: Vec<PathBuf>,
    pub test: PathBuf,
    /// Further lines of the file.
    pub more: &'static str,
}

impl Default for Set {
    fn default() -> Self {
        let train = ["demo_train_points.mcap", "demo_train_sweep.mcap"];
        Self {
            robot: bundled().join("demo_arm.urdf"),
            train: train.map(|name| bundled().join(name)).to_vec(),
            labels: Some(bundled().join("labels.json")),
            validation: vec![bundled().join("demo_validation.mcap")],
            test: bundled().join("demo.mcap"),
            more: "",
        }
    }
}

impl Set {
    /// Writes its `set.yaml` into `folder`.
    pub fn write(&self, folder: &Path) -> PathBuf {
        let labels = self.labels.as_ref();
        let labels = labels.map_or_else(String::new, |l| format!("labels: {}\n", l.display()));
        let list = |paths: &[PathBuf]| {
            let each = paths.iter().map(|path| path.display().to_string());
            each.collect::<Vec<_>>().join(", ")
        };
        let text = format!(
            "set: hands\nrobot: {robot}\n{labels}topics: {{state: /joint_states, contact: /contact}}\n\
             train: [{train}]\nvalidation: [{validation}]\ntest: [{test}]\n{more}\n",
            more = self.more,
            robot = self.robot.display(),
            train = list(&self.train),
            validation = list(&self.validation),
            test = self.test.display(),
        );
        write(&folder.join("set.yaml"), &text)
    }
}

/// `tauscope evaluate`.
pub fn evaluate(set: &Path, out: &Path, more: &[&str]) -> Out {
    let named = [
        "evaluate".as_ref(),
        "--force".as_ref(),
        set.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ];
    Out::answer(named.into_iter().chain(more.iter().map(OsStr::new)))
}

/// Copies a bundled recording with its joint states changed by `change`; those for which it returns `false` are
/// removed.
pub fn changed(
    folder: &Path,
    name: &str,
    mut change: impl FnMut(usize, &mut JointState) -> bool,
) -> PathBuf {
    let recording = Recording::open(bundled().join(name)).unwrap();
    let path = folder.join(name);
    let mut writer = McapWriter::create(&path, Compression::None, &BTreeMap::new()).unwrap();
    let topic = writer.add_topic::<JointState>(STATES).unwrap();
    let mut states = recording.joint_states(STATES).unwrap();
    let mut row = 0;
    while let Some(state) = states.next_state() {
        let state = state.unwrap();
        let mut message = state.message.clone();
        if change(row, &mut message) {
            let at = state.log_time_ns;
            writer.write(topic, at, at, &message).unwrap();
        }
        row += 1;
    }
    writer.finish().unwrap();
    path
}
