//! The committed LeRobot data sets.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::fs;
use std::path::{Path, PathBuf};

use tauscope_archive::ros::JointState;
use tauscope_archive::{Recording, RecordingKind};

/// The committed data sets.
pub fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/lerobot")
}

/// A copy of a set, to be changed, in a folder of its own.
pub fn copy(set: &str) -> (tempfile::TempDir, PathBuf) {
    fn copy_all(from: &Path, to: &Path) {
        fs::create_dir_all(to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            let target = to.join(entry.file_name());
            if entry.path().is_dir() {
                copy_all(&entry.path(), &target);
            } else {
                fs::copy(entry.path(), target).unwrap();
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join(set);
    copy_all(&data().join(set), &root);
    (folder, root)
}

/// Why the recording cannot be opened.
pub fn refusal(path: &Path) -> String {
    match Recording::open(path) {
        Ok(_) => panic!("{} was opened", path.display()),
        Err(error) => error.to_string(),
    }
}

/// The joint states of an episode.
pub fn states(path: &Path) -> Vec<JointState> {
    let recording = Recording::open(path).unwrap();
    assert_eq!(recording.kind(), RecordingKind::Lerobot);
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut all = Vec::new();
    while let Some(state) = states.next_state() {
        all.push(state.unwrap().message.clone());
    }
    assert_eq!(all.len() as u64, recording.message_count());
    all
}
