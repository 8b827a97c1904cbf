//! Files are named, split and kept according to the settings, and each file is self-contained.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::synthetic::{arm, cell, motion, streams};
use tauscope_archive::Recording;
use tauscope_archive::ros::{Float64, JointState, Message};
use tauscope_bus::{SampleRef, Sink};
use tauscope_record::{
    AroundAlarms, Config, Existing, Keep, RecordError, Recorder, RerunConfig, Split,
};

fn recorder(config: &Config) -> Result<Recorder, RecordError> {
    let cells = [cell("demo", Some(arm(false)))];
    Recorder::new(config, &cells, &streams("demo", ""), &BTreeMap::new())
}

fn record(config: &Config, seconds: f64) -> Recorder {
    let mut recorder = recorder(config).unwrap();
    for instant in &motion(seconds) {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
    recorder
}

fn count<M: Message>(path: &Path, topic: &str) -> usize {
    let recording = Recording::open(path).unwrap();
    assert!(recording.damage().is_empty(), "{}", path.display());
    recording.topic_of::<M>(topic).unwrap();
    let mut messages = recording.messages(&[topic]).unwrap();
    let mut count = 0;
    while let Some(message) = messages.next_message() {
        message.unwrap();
        count += 1;
    }
    count
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn files_are_split_by_time_and_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config {
        mcap: Some(folder.path().join("{cell}-{date}-{time}.mcap")),
        split: Some(Split {
            after_s: Some(2.0),
            after_mb: None,
        }),
        ..Config::default()
    };
    let recorder = record(&config, 5.0);
    let names: Vec<_> = files(folder.path());
    let expected = ["08-53-20", "08-53-22", "08-53-24"]
        .map(|time| folder.path().join(format!("demo-2025-10-09-{time}.mcap")));
    assert_eq!(names, expected);
    let states = names
        .iter()
        .map(|file| count::<JointState>(file, "/joint_states"));
    assert_eq!(states.sum::<usize>(), motion(5.0).len());
    // The threshold never changes, but each file must contain it.
    for file in &names {
        let threshold = "/detections/twin_regression/threshold";
        assert_eq!(count::<Float64>(file, threshold), 1, "{}", file.display());
    }
    assert_eq!(recorder.completed_files(), (&expected[2..], 3));
}

#[test]
fn reports_of_stages_that_are_ahead_split_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config {
        mcap: Some(folder.path().join("a-{n}.mcap")),
        split: Some(Split {
            after_s: Some(2.0),
            after_mb: None,
        }),
        ..Config::default()
    };
    let mut recorder = recorder(&config).unwrap();
    let motion = motion(5.0);
    // The source has read the whole file before the recorder receives its first sample.
    for health in motion.iter().filter_map(|instant| instant.health.as_ref()) {
        let sample = SampleRef::Health(health);
        recorder.accept("twin", sample).unwrap();
    }
    for instant in &motion {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
    let states: Vec<usize> = files(folder.path())
        .iter()
        .map(|file| count::<JointState>(file, "/joint_states"))
        .collect();
    assert_eq!(states.len(), 3, "{states:?}");
    assert_eq!(states[0], motion.len() * 2 / 5);
}

#[test]
fn files_are_split_by_size_and_numbered_together() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config {
        mcap: Some(folder.path().join("a-{n}.mcap")),
        rerun: Some(RerunConfig {
            file: Some(folder.path().join("a-{n}.rrd")),
            connect: None,
        }),
        split: Some(Split {
            after_s: None,
            after_mb: Some(0.2),
        }),
        ..Config::default()
    };
    record(&config, 5.0);
    let names = files(folder.path());
    assert!(names.len() >= 4, "{names:?}");
    for (n, pair) in names.chunks(2).enumerate() {
        let of = |kind: &str| folder.path().join(format!("a-{:03}.{kind}", n + 1));
        assert_eq!(pair, [of("mcap"), of("rrd")]);
        let megabytes = pair[0].metadata().unwrap().len() as f64 * 1e-6;
        assert!(megabytes < 0.3, "{megabytes} MB");
    }
}

#[test]
fn a_file_that_is_there_is_kept_and_the_new_one_gets_another_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, "somebody's only copy").unwrap();
    let config = Config {
        mcap: Some(path.clone()),
        ..Config::default()
    };
    let recorder = record(&config, 1.0);
    assert_eq!(std::fs::read(&path).unwrap(), b"somebody's only copy");
    let other = folder.path().join("a.1.mcap");
    assert_eq!(recorder.completed_files().0, [other.as_path()]);
    assert_eq!(count::<JointState>(&other, "/joint_states"), 250);

    let replacing = Config {
        existing: Existing::Replace,
        ..config
    };
    record(&replacing, 1.0);
    assert_eq!(count::<JointState>(&path, "/joint_states"), 250);
}

#[test]
fn nothing_is_begun_for_a_name_that_waits_for_a_sample_that_never_comes() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config {
        mcap: Some(folder.path().join("{time}.mcap")),
        ..Config::default()
    };
    record(&config, 0.0);
    assert!(files(folder.path()).is_empty());
}

#[test]
fn names_that_cannot_be_are_refused() {
    let refused = |name: &str, split: Option<Split>| {
        let config = Config {
            mcap: Some(name.into()),
            split,
            ..Config::default()
        };
        recorder(&config).err().unwrap().to_string()
    };
    assert!(refused("{day}.mcap", None).contains("`{day}` is no field of a file name"));
    assert!(refused("a.mcap", Some(Split::default())).contains("put `{n}` or `{time}` into it"));
    let cells = [cell("x", None), cell("y", None)];
    let config = Config {
        mcap: Some("{cell}.mcap".into()),
        ..Config::default()
    };
    let several = Recorder::new(&config, &cells, &[], &BTreeMap::new());
    assert!(matches!(
        several.err(),
        Some(RecordError::SeveralCells { cells: 2 })
    ));
}

#[test]
fn a_clock_that_is_set_back_begins_another_file_and_a_stream_that_is_late_does_not() {
    const HOUR_NS: i64 = 3_600_000_000_000;
    let record = |late: bool| {
        let folder = tempfile::tempdir().unwrap();
        let config = Config {
            mcap: Some(folder.path().join("a-{n}.mcap")),
            ..Config::default()
        };
        let mut recorder = recorder(&config).unwrap();
        for (at, mut instant) in motion(2.0).into_iter().enumerate() {
            let headers = [
                &mut instant.state.header,
                &mut instant.twin.header,
                &mut instant.detection.header,
            ];
            let is_back = at >= 250;
            for header in headers.into_iter().skip(if late { 2 } else { 0 }) {
                header.received_ns -= if is_back || late { HOUR_NS } else { 0 };
            }
            if let Some(health) = instant.health.as_mut().filter(|_| is_back && !late) {
                health.header.received_ns -= HOUR_NS;
            }
            instant.feed(&mut recorder, "");
        }
        recorder.finish().unwrap();
        let spans = files(folder.path()).into_iter().map(|file| {
            let recording = Recording::open(&file).unwrap();
            let times = recording.start_ns().zip(recording.end_ns());
            let span_ns = times.map(|(start, end)| end - start);
            (
                span_ns.unwrap(),
                count::<JointState>(&file, "/joint_states"),
            )
        });
        spans.collect::<Vec<_>>()
    };
    let spans = record(false);
    let counts: Vec<usize> = spans.iter().map(|(_, count)| *count).collect();
    assert_eq!(counts, [250, 250]);
    assert!(spans.iter().all(|(ns, _)| *ns < 2_000_000_000), "{spans:?}");
    // After a network failure, samples of another host are old.
    assert_eq!(record(true).len(), 1);
}

/// Writes an unfinished file as a killed recorder leaves it.
fn torn_copy(path: &Path, seconds: f64) {
    let folder = tempfile::tempdir().unwrap();
    let whole = Config {
        mcap: Some(folder.path().join("a.mcap")),
        ..Config::default()
    };
    record(&whole, seconds);
    let bytes = std::fs::read(folder.path().join("a.mcap")).unwrap();
    std::fs::write(path, &bytes[..bytes.len() * 2 / 3]).unwrap();
}

#[test]
fn what_earlier_recorders_left_is_repaired_by_the_next_and_what_lives_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let at = |file: &str| folder.path().join(file);
    torn_copy(&at("a.mcap.part"), 3.0);
    torn_copy(&at("a.7.mcap.part"), 3.0);
    torn_copy(&at("b.mcap.part"), 3.0);
    std::fs::write(at("a.8.mcap.part"), "nothing of ours").unwrap();
    let config = Config {
        mcap: Some(at("a.mcap")),
        ..Config::default()
    };
    let mut recorder = recorder(&config).unwrap();
    recorder.repair_leftovers(&config);
    for instant in &motion(1.0) {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
    let expected = [
        "a.1.mcap",
        "a.7.mcap",
        "a.8.mcap.part",
        "a.mcap",
        "b.mcap.part",
    ];
    assert_eq!(files(folder.path()), expected.map(at));
    for repaired in ["a.1.mcap", "a.7.mcap"] {
        let states = count::<JointState>(&at(repaired), "/joint_states");
        assert!((300..750).contains(&states), "{repaired}: {states}");
    }
    assert_eq!(count::<JointState>(&at("a.mcap"), "/joint_states"), 250);
}

#[test]
fn what_was_left_around_alarms_and_of_pictures_is_repaired_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = |file: &str| folder.path().join(file);
    let pictured = |name: &str| {
        Some(RerunConfig {
            file: Some(at(name)),
            connect: None,
        })
    };
    let whole = Config {
        rerun: pictured("whole.rrd"),
        ..Config::default()
    };
    record(&whole, 6.0);
    let bytes = std::fs::read(at("whole.rrd")).unwrap();
    std::fs::write(at("a.rrd.part"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    std::fs::write(at("alarm-001.rrd.part"), &bytes[..bytes.len() / 2]).unwrap();
    std::fs::write(at("alarm-002.rrd.part"), "").unwrap();
    torn_copy(&at("alarm-001.mcap.part"), 3.0);
    std::fs::remove_file(at("whole.rrd")).unwrap();
    let config = Config {
        rerun: pictured("a.rrd"),
        around_alarms: Some(AroundAlarms {
            mcap: Some(at("alarm-{n}.mcap")),
            rerun: Some(at("alarm-{n}.rrd")),
            ..AroundAlarms::default()
        }),
        ..Config::default()
    };
    let mut recorder = recorder(&config).unwrap();
    recorder.repair_leftovers(&config);
    recorder.finish().unwrap();
    let expected = ["a.1.rrd", "a.rrd", "alarm-001.mcap", "alarm-001.rrd"];
    assert_eq!(files(folder.path()), expected.map(at));
    assert!(count::<JointState>(&at("alarm-001.mcap"), "/joint_states") > 300);
    for (name, share) in [("a.1.rrd", 0.6), ("alarm-001.rrd", 0.4)] {
        let repaired = at(name).metadata().unwrap().len() as f64;
        assert!(repaired > share * bytes.len() as f64, "{name}: {repaired}");
        let reader = std::io::BufReader::new(std::fs::File::open(at(name)).unwrap());
        let messages = rerun::external::re_log_encoding::DecoderApp::decode_eager(reader).unwrap();
        assert!(messages.map(Result::unwrap).count() > 10, "{name}");
    }
}

#[test]
fn only_so_much_is_kept_the_oldest_goes_first() {
    let folder = tempfile::tempdir().unwrap();
    let notes = folder.path().join("a-note.mcap");
    std::fs::write(&notes, vec![0; 2_000_000]).unwrap();
    let config = Config {
        mcap: Some(folder.path().join("a-{time}.mcap")),
        split: Some(Split {
            after_s: Some(1.0),
            after_mb: None,
        }),
        keep: Some(Keep {
            at_most_mb: Some(0.5),
            at_most_days: None,
        }),
        ..Config::default()
    };
    record(&config, 8.0);
    let left = files(folder.path());
    let bytes: u64 = left
        .iter()
        .filter(|file| **file != notes)
        .map(|file| file.metadata().unwrap().len())
        .sum();
    assert!(left.contains(&notes), "not of its names");
    assert!(bytes < 500_000 && left.len() < 8, "{left:?}");
    let newest = folder.path().join("a-08-53-27.mcap");
    assert!(left.contains(&newest), "{left:?}");
}

#[test]
fn recordings_are_not_old_because_nothing_was_recorded_since() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let days = |days: u64| std::time::Duration::from_hours(24 * days);
    for (name, ago_days) in [
        ("a-001.mcap", 200),
        ("a-002.mcap", 110),
        ("a-003.mcap", 100),
    ] {
        let file = std::fs::File::create(at(name)).unwrap();
        let modified = std::time::SystemTime::now() - days(ago_days);
        file.set_modified(modified).unwrap();
    }
    let config = Config {
        mcap: Some(at("a-{n}.mcap")),
        keep: Some(Keep {
            at_most_mb: None,
            at_most_days: Some(30.0),
        }),
        ..Config::default()
    };
    let mut begun = recorder(&config).unwrap();
    assert!(at("a-002.mcap").exists() && at("a-003.mcap").exists());
    assert!(!at("a-001.mcap").exists());
    // They are removed once there is a newer file.
    for instant in &motion(1.0) {
        instant.feed(&mut begun, "");
    }
    begun.finish().unwrap();
    let left = files(folder.path());
    let days_old = |file: &PathBuf| file.metadata().unwrap().modified().unwrap().elapsed();
    assert!(
        left.len() == 1 && days_old(&left[0]).unwrap() < days(1),
        "{left:?}"
    );
}

#[test]
fn a_disk_without_room_pauses_the_recording_and_what_it_loses_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config {
        mcap: Some(folder.path().join("a.mcap")),
        // Larger than any disk.
        min_free_mb: 1e15,
        ..Config::default()
    };
    let recorder = record(&config, 1.0);
    let samples = 250 * 3;
    assert!(
        (samples..samples + 3).contains(&recorder.dropped()),
        "{}",
        recorder.dropped()
    );
    assert_eq!(files(folder.path()), Vec::<PathBuf>::new());
}

#[test]
fn a_kill_costs_no_more_than_a_tenth_of_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let config = Config {
        mcap: Some(folder.path().join("a.mcap")),
        ..Config::default()
    };
    let mut recorder = recorder(&config).unwrap();
    let motion = motion(3.0);
    for instant in &motion {
        instant.feed(&mut recorder, "");
    }
    // A killed process leaves the data that was passed to the operating system.
    let left = folder.path().join("left.mcap.part");
    std::fs::copy(folder.path().join("a.mcap.part"), &left).unwrap();
    let end_ns = Recording::open(&left).unwrap().end_ns().unwrap();
    let last_ns = motion.last().unwrap().state.header.received_ns;
    assert!(last_ns - end_ns <= 100_000_000, "{} ns", last_ns - end_ns);
}
