//! Recordings of real arms, where they are at hand. Counts as the Python `mcap` reader gives them.

use std::path::{Path, PathBuf};

use tauscope_archive::Recording;

/// `../shared/<path>` beside the workspace, or `None` and a visible line.
fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    if shared.is_dir() {
        return Some(shared.join(path));
    }
    eprintln!("SKIPPED {test}: ../shared is absent");
    None
}

#[test]
fn franka_touch() {
    let Some(path) = shared("franka_touch", "recordings/franka-touch/a4.mcap") else {
        return;
    };
    let recording = Recording::open(path).unwrap();
    assert!(recording.damage().is_empty());
    assert_eq!(recording.start_ns(), Some(1_000_000_000_000));
    assert_eq!(recording.end_ns(), Some(1_015_800_018_361));
    let counts: Vec<_> = recording
        .topics()
        .iter()
        .map(|topic| (topic.name.as_str(), topic.message_count))
        .collect();
    assert_eq!(
        counts,
        [
            ("/joint_states", 3148),
            ("/external_torques", 3148),
            ("/contact", 3148)
        ]
    );

    let mut messages = recording.all_messages().unwrap();
    let mut read = vec![0; counts.len()];
    let mut last_ns = 0;
    while let Some(message) = messages.next_message() {
        let message = message.unwrap();
        assert!(message.log_time_ns >= last_ns);
        last_ns = message.log_time_ns;
        read[message.topic_index] += 1;
    }
    assert_eq!(read, [3148; 3]);

    // The torques topic leaves position and velocity empty.
    let mut torques = recording.joint_states("/external_torques").unwrap();
    let state = torques.next_state().unwrap().unwrap();
    assert_eq!(state.message.effort.len(), 7);
    assert!(state.message.position.is_empty());
}
