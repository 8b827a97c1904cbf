//! LeRobot data sets that are broken or incomplete: what is wrong is named, with its place.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::fs;

use crate::sets::{copy, data, refusal, states};
use tauscope_archive::{ArchiveError, Info, Recording};

#[test]
fn what_is_missing_is_named() {
    let (_folder, root) = copy("aloha");
    let said = refusal(&root.join("episode_000007"));
    assert!(
        said.contains("no episode 7") && said.contains("episode_000001"),
        "{said}"
    );
    fs::remove_file(root.join("data/chunk-000/episode_000001.parquet")).unwrap();
    let said = refusal(&root.join("episode_000001"));
    assert!(
        said.contains("chunk-000/episode_000001.parquet") && said.contains("download"),
        "{said}"
    );
    fs::remove_file(root.join("meta/info.json")).unwrap();
    let said = refusal(&root);
    assert!(said.contains("no meta/info.json"), "{said}");

    let (_folder, root) = copy("openarm");
    fs::remove_dir_all(root.join("meta/episodes")).unwrap();
    let said = refusal(&root.join("episode_000000"));
    assert!(
        said.contains("meta/episodes") && said.contains("download"),
        "{said}"
    );
    fs::write(root.join("meta/info.json"), "{}").unwrap();
    assert!(refusal(&root.join("episode_000000")).contains("version unknown"));
    fs::write(root.join("meta/info.json"), "[1").unwrap();
    assert!(refusal(&root).contains("no description of a LeRobot data set"));
}

#[test]
fn another_episode_in_the_file_of_one_is_noticed() {
    let (_folder, root) = copy("aloha");
    let chunk = root.join("data/chunk-000");
    fs::copy(
        chunk.join("episode_000001.parquet"),
        chunk.join("episode_000000.parquet"),
    )
    .unwrap();
    let said = refusal(&root.join("episode_000000"));
    assert!(
        said.contains("episode_index 0") && said.contains("the first has 1"),
        "{said}"
    );
}

#[test]
fn torn_and_changed_tables_are_refused_and_never_a_panic() {
    let (_folder, root) = copy("aloha");
    let file = root.join("data/chunk-000/episode_000001.parquet");
    let whole = fs::read(&file).unwrap();
    let path = root.join("episode_000001");
    for length in (0..whole.len()).step_by(97) {
        fs::write(&file, &whole[..length]).unwrap();
        let said = refusal(&path);
        assert!(said.contains("episode_000001.parquet"), "{said}");
    }
    let mut refused = 0;
    for at in (0..whole.len()).step_by(7) {
        let mut changed = whole.clone();
        changed[at] ^= 0x55;
        fs::write(&file, &changed).unwrap();
        match Recording::open(&path) {
            Ok(recording) => drop(Info::read(&recording).unwrap()),
            Err(ArchiveError::Parquet(_) | ArchiveError::Lerobot(_)) => refused += 1,
            Err(other) => panic!("at {at}: {other}"),
        }
    }
    assert!(refused > 30, "{refused}");
}
#[test]
fn times_are_checked_and_kept_where_they_are_off_the_grid() {
    let episode = |number| data().join(format!("times/episode_{number}"));
    let said = refusal(&episode(0));
    assert!(
        said.contains("row 2 (timestamp): NaN is not a valid time"),
        "{said}"
    );
    let said = refusal(&episode(1));
    assert!(
        said.contains("row 2 (timestamp)") && said.contains("backwards"),
        "{said}"
    );
    let states = states(&episode(2));
    let stamps: Vec<i64> = states.iter().map(|state| state.header.stamp.ns()).collect();
    assert_eq!([stamps[0], stamps[2]], [0, 40_000_000]);
    assert!((stamps[1] - 25_000_000).abs() < 10 && (stamps[3] - 65_000_100).abs() < 10);
    assert!(states[1].position[1].is_nan());
    let info = Info::read(&Recording::open(episode(2)).unwrap()).unwrap();
    assert_eq!(info.topics[0].joints.as_ref().unwrap().nan_messages, 4);
}

#[test]
fn a_clone_without_its_contents_is_told() {
    let (_folder, root) = copy("aloha");
    let file = root.join("data/chunk-000/episode_000001.parquet");
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 5280\n";
    fs::write(file, pointer).unwrap();
    let said = refusal(&root.join("episode_000001"));
    assert!(
        said.contains("Git LFS") && said.contains("git lfs pull"),
        "{said}"
    );
}
