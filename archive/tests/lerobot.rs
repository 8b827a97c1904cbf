//! Episodes of LeRobot data sets, made by `data/lerobot_sets.py`. `tests/formats.rs` of the program compares the
//! results of the commands for an episode with those for MCAP.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::fs;
use std::path::Path;

use crate::sets::{copy, data, refusal, states};
use tauscope_archive::{Info, Recording, is_there, name_of, recordings_at, sources};

/// Replaces text in `meta/info.json`.
fn change_info(root: &Path, from: &str, to: &str) {
    let path = root.join("meta/info.json");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

/// Value that `lerobot_sets.py` writes into an element.
fn value(episode: usize, row: usize, element: usize) -> f64 {
    (0.1 * row as f64 + element as f64 + episode as f64).sin()
}

fn assert_close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-5, "{found} for {expected}");
}

#[test]
fn an_episode_of_version_2_has_positions_and_efforts() {
    for (episode, rows) in [(0, 20), (1, 12)] {
        let path = data().join(format!("aloha/episode_00000{episode}"));
        let states = states(&path);
        assert_eq!(states.len(), rows);
        for (row, state) in states.iter().enumerate() {
            assert_eq!(state.name[0], "left_waist");
            assert_eq!(state.name[13], "right_gripper");
            // The grid of 50 Hz, not the nearest `float32`.
            assert_eq!(state.header.stamp.ns(), row as i64 * 20_000_000);
            assert!(state.velocity.is_empty());
            for joint in 0..14 {
                assert_close(state.position[joint], value(episode, row, joint));
                assert_close(state.effort[joint], value(episode, row, 100 + joint));
            }
        }
        assert!(
            Recording::open(&path)
                .unwrap()
                .check_comparable(&[])
                .is_ok()
        );
    }
}

#[test]
fn episodes_of_version_3_lie_in_common_files() {
    for (episode, rows) in [(0, 15), (1, 9), (2, 12)] {
        let states = states(&data().join(format!("openarm/episode_{episode}")));
        assert_eq!(states.len(), rows);
        for (row, state) in states.iter().enumerate() {
            assert_eq!(state.name[6..], ["joint_7", "gripper"]);
            for joint in 0..8 {
                let element = |what: usize| 90.0 * value(episode, row, 3 * joint + what);
                assert!((state.position[joint] - element(0)).abs() < 1e-4);
                assert!((state.velocity[joint] - element(1)).abs() < 1e-4);
                assert!((state.effort[joint] - element(2)).abs() < 1e-4);
            }
        }
    }
}

#[test]
fn degrees_are_asked_for_and_put_in_rad() {
    let (_folder, root) = copy("openarm");
    let path = root.join("episode_000001");
    let refused = Recording::open(&path)
        .unwrap()
        .check_comparable(&[])
        .unwrap_err();
    let words = refused.to_string();
    assert!(
        words.contains("openarm.columns.yaml") && words.contains("`degrees: true`"),
        "{words}"
    );
    let beside = root.with_file_name("openarm.columns.yaml");
    fs::write(&beside, "degrees: true\n").unwrap();
    assert!(
        Recording::open(&path)
            .unwrap()
            .check_comparable(&[])
            .is_ok()
    );
    let state = &states(&path)[4];
    assert_close(state.position[2], 90.0_f64.to_radians() * value(1, 4, 6));
    assert_close(state.velocity[2], 90.0_f64.to_radians() * value(1, 4, 7));
    assert!((state.effort[2] - 90.0 * value(1, 4, 8)).abs() < 1e-4);
    fs::write(&beside, "degrees: false\n").unwrap();
    assert!(
        Recording::open(&path)
            .unwrap()
            .check_comparable(&[])
            .is_ok()
    );
}

#[test]
fn positions_alone_are_shown_and_said_to_be_too_little() {
    let path = data().join("so101");
    let recording = Recording::open(&path).unwrap();
    let info = Info::read(&recording).unwrap();
    let joints = info.topics[0].joints.as_ref().unwrap();
    assert_eq!(joints.names[0], "shoulder_pan");
    assert!(joints.position && !joints.velocity && !joints.effort);
    let said = recording.check_comparable(&[]).unwrap_err().to_string();
    for words in [
        "so101",
        "no efforts",
        "observation.state",
        "observation.effort",
        "so101.columns.yaml",
    ] {
        assert!(said.contains(words), "{said}");
    }
    assert!(info.to_string().contains("no efforts"), "{info}");
}

#[test]
fn joints_of_other_names_are_said_with_their_remedy() {
    let recording = Recording::open(data().join("aloha/episode_000000")).unwrap();
    let joints = ["left_waist", "elbow"].map(str::to_owned);
    let said = recording.check_comparable(&joints).unwrap_err().to_string();
    for words in [
        "names no elbow;",
        "left_waist, left_shoulder",
        "aloha.columns.yaml",
        "`joints: [",
    ] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn a_file_beside_the_set_names_joints_and_features() {
    let (_folder, root) = copy("aloha");
    let beside = root.with_file_name("aloha.columns.yaml");
    let joints: Vec<String> = (0..14).map(|n| format!("arm_{n}")).collect();
    let text = format!(
        "joints: [{}]\neffort: {{names: [action]}}\nvelocity: {{names: [observation.effort]}}\n",
        joints.join(", ")
    );
    fs::write(&beside, text).unwrap();
    let state = &states(&root.join("episode_000000"))[3];
    assert_eq!(state.name, joints);
    assert_close(state.velocity[5], value(0, 3, 105));
    assert_close(state.effort[5], value(0, 3, 205));

    // One arm of two.
    let of = |feature: &str| format!("[{feature}.right_waist, {feature}.right_elbow]");
    let (position, effort) = (of("observation.state"), of("observation.effort"));
    let text =
        format!("position: {{names: {position}}}\neffort: {{names: {effort}}}\njoints: [a, b]\n");
    fs::write(&beside, text).unwrap();
    let state = &states(&root.join("episode_000000"))[3];
    assert_eq!(state.name, ["a", "b"]);
    assert_close(state.position[1], value(0, 3, 9));
    assert_close(state.effort[1], value(0, 3, 109));

    for (text, words) in [
        (
            "joints: [a]\n",
            "joints: 1 for 14 joints, which the data set calls left_waist",
        ),
        (
            "effort: {names: [observation.current]}\n",
            "no feature \"observation.current\"",
        ),
        ("effort: {first: 3}\n", "give `names`"),
        ("effort: {names: [timestamp]}\n", "effort: 1 for 14 joints"),
        ("effrot: 3\n", "effrot"),
    ] {
        fs::write(&beside, text).unwrap();
        let said = refusal(&root.join("episode_000000"));
        assert!(
            said.contains("aloha.columns.yaml") && said.contains(words),
            "{said}"
        );
    }
}

#[test]
fn names_that_say_nothing_keep_the_order() {
    let (_folder, root) = copy("aloha");
    // The names of all features; then of none.
    change_info(&root, "left_", "motor_");
    change_info(&root, "\"motors\"", "\"else\"");
    assert_eq!(
        states(&root.join("episode_000000"))[0].name[1],
        "motor_shoulder"
    );
    change_info(&root, "\"shape\": [\n    14\n   ]", "\"shape\": [14]");
    change_info(&root, "motor_waist\",", "motor_waist\", \"one too many\",");
    let state = &states(&root.join("episode_000000"))[2];
    assert_eq!(state.name[13], "joint_13");
    assert_close(state.effort[13], value(0, 2, 113));
}

#[test]
fn rows_are_the_same_however_they_are_encoded() {
    let episode = |number| data().join(format!("encodings/episode_{number}"));
    for number in 0..5 {
        let states = states(&episode(number));
        assert_eq!(states.len(), 40, "{number}");
        for (row, state) in states.iter().enumerate() {
            let steps = [(row / 8) as f64 / 4.0, -((row / 5) as f64) / 8.0];
            assert_eq!(state.position, steps, "{number}, {row}");
            let [first, second] = state.effort[..] else {
                panic!("{number}, {row}: {:?}", state.effort);
            };
            assert_close(first, row as f64 / 2.0);
            assert_eq!(second.is_nan(), row % 3 == 0);
            if row % 3 != 0 {
                assert_close(second, row as f64 / 4.0);
            }
            assert_eq!(state.header.stamp.ns(), row as i64 * 20_000_000);
        }
    }
    for (number, words) in [(5, "compressed with Gzip"), (6, "BYTE_STREAM_SPLIT")] {
        let said = refusal(&episode(number));
        assert!(said.contains(words) && said.contains("pyarrow"), "{said}");
    }
}

#[test]
fn a_set_is_its_episodes() {
    let set = data().join("openarm");
    let all = recordings_at(&set).unwrap();
    let names = ["episode_000000", "episode_000001", "episode_000002"];
    assert_eq!(all, names.map(|name| set.join(name)));
    assert!(all.iter().all(|path| is_there(path)) && !all[0].exists());
    assert_eq!(name_of(&all[2]), "openarm_episode_000002");
    let said = refusal(&set);
    for words in [
        "3 episodes",
        "openarm/episode_000000",
        "openarm/episode_000002",
    ] {
        assert!(said.contains(words), "{said}");
    }
    // One of one may go by the name of the set.
    assert_eq!(states(&data().join("so101")).len(), 10);
    let one = data().join("so101");
    assert_eq!(recordings_at(&one).unwrap(), [one.as_path()]);
    assert_eq!(name_of(&one), "so101");
    // Whatever is none is itself.
    let other = data().join("nothing");
    assert_eq!(recordings_at(&other).unwrap(), [other.as_path()]);
    assert!(!is_there(&other));
}

#[test]
fn a_file_with_one_episode_is_that_episode() {
    let file = data().join("aloha/data/chunk-000/episode_000001.parquet");
    assert_eq!(states(&file).len(), 12);
    assert_eq!(
        states(&data().join("openarm/data/chunk-000/file-001.parquet")).len(),
        12
    );
    let said = refusal(&data().join("openarm/data/chunk-000/file-000.parquet"));
    assert!(
        said.contains("2 episodes") && said.contains("openarm/episode_000001"),
        "{said}"
    );
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("episode_000001.parquet");
    fs::copy(file, &alone).unwrap();
    let said = refusal(&alone);
    assert!(said.contains("meta/info.json"), "{said}");
}

#[test]
fn results_depend_on_the_rows_and_on_what_says_what_they_are() {
    let (_folder, root) = copy("openarm");
    let path = root.join("episode_000002");
    let found = sources(&path).unwrap();
    assert_eq!(found.episode, Some(2));
    let files = found.files;
    assert_eq!(
        files,
        [
            root.join("data/chunk-000/file-001.parquet"),
            root.join("meta/info.json")
        ]
    );
    let beside = root.with_file_name("openarm.columns.yaml");
    fs::write(&beside, "degrees: true\n").unwrap();
    assert!(sources(&path).unwrap().files.contains(&beside));
}
