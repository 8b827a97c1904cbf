//! A separate file around each alarm, including the samples before it.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::synthetic::{Instant, START_NS, STEP_NS, arm, cell, motion, streams};
use tauscope_archive::Recording;
use tauscope_bus::Sink;
use tauscope_record::{AroundAlarms, Config, Recorder};

/// Records the alarms of a motion with two pushes: at 3.0 to 4.2 s and at 7.0 to 7.8 s.
fn record(folder: &Path, around: AroundAlarms) -> Vec<PathBuf> {
    record_all(folder, around, &motion(12.0))
}

fn record_all(folder: &Path, around: AroundAlarms, instants: &[Instant]) -> Vec<PathBuf> {
    let config = Config {
        around_alarms: Some(AroundAlarms {
            mcap: Some(folder.join("alarm-{n}.mcap")),
            ..around
        }),
        ..Config::default()
    };
    let cells = [cell("demo", Some(arm(false)))];
    let streams = streams("demo", "");
    let mut recorder = Recorder::new(&config, &cells, &streams, &BTreeMap::new()).unwrap();
    for instant in instants {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Times of the first and the last joint state \[s since the start\], and whether none is missing in between.
fn span(file: &Path) -> (f64, f64, bool) {
    let recording = Recording::open(file).unwrap();
    assert!(recording.damage().is_empty(), "{}", file.display());
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut stamps = Vec::new();
    while let Some(state) = states.next_state() {
        let stamp = state.unwrap().message.header.stamp;
        stamps.push(i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec) - START_NS);
    }
    let dense = stamps.windows(2).all(|pair| pair[1] - pair[0] == STEP_NS);
    let seconds = |ns: &i64| *ns as f64 * 1e-9;
    let (first, last) = (stamps.first().unwrap(), stamps.last().unwrap());
    (seconds(first), seconds(last), dense)
}

#[test]
fn each_alarm_has_a_file_from_before_it_to_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let around = AroundAlarms {
        before_s: 1.0,
        after_s: 0.5,
        ..AroundAlarms::default()
    };
    let files = record(folder.path(), around);
    let names = ["alarm-001.mcap", "alarm-002.mcap"].map(|name| folder.path().join(name));
    assert_eq!(files, names);
    for (file, (onset_s, offset_s)) in files.iter().zip([(3.0, 4.2), (7.0, 7.8)]) {
        let (first_s, last_s, dense) = span(file);
        assert!(dense, "{}: a sample is missing", file.display());
        // The alarm rises and falls within some tenths of a second of the push.
        let begins = onset_s - 1.0..onset_s - 0.5;
        let ends = offset_s + 0.2..offset_s + 1.0;
        assert!(begins.contains(&first_s), "begins at {first_s} s");
        assert!(ends.contains(&last_s), "ends at {last_s} s");
    }
}

#[test]
fn a_clock_that_is_set_back_costs_no_file_and_no_sample() {
    let around = || AroundAlarms {
        before_s: 1.0,
        after_s: 0.5,
        ..AroundAlarms::default()
    };
    // Before the first alarm, in its recorded time before, during the alarm, and after it.
    for set_back_s in [1.5, 2.8, 3.5, 4.4] {
        let mut instants = motion(12.0);
        let first = (set_back_s * 1e9) as usize / STEP_NS as usize;
        for instant in &mut instants[first..] {
            for header in [
                &mut instant.state.header,
                &mut instant.twin.header,
                &mut instant.detection.header,
            ] {
                header.received_ns -= 3_600_000_000_000;
            }
            if let Some(health) = &mut instant.health {
                health.header.received_ns -= 3_600_000_000_000;
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let files = record_all(folder.path(), around(), &instants);
        let spans: Vec<_> = files.iter().map(|file| span(file)).collect();
        let folder = tempfile::tempdir().unwrap();
        let files = record(folder.path(), around());
        // A clock step within a file begins a new file.
        let mut expected = Vec::new();
        for (begin_s, end_s, _) in files.iter().map(|file| span(file)) {
            if (begin_s..end_s).contains(&set_back_s) {
                expected.extend([(begin_s, set_back_s), (set_back_s, end_s)]);
            } else {
                expected.push((begin_s, end_s));
            }
        }
        for (got, wanted) in spans.iter().zip(&expected) {
            let near = |a: f64, b: f64| (a - b).abs() < 0.05;
            let same = near(got.0, wanted.0) && near(got.1, wanted.1) && got.2;
            assert!(same, "{set_back_s} s: {got:?} in place of {wanted:?}");
        }
        assert_eq!(spans.len(), expected.len(), "{set_back_s} s");
    }
}

#[test]
fn alarms_whose_files_would_overlap_share_one() {
    let folder = tempfile::tempdir().unwrap();
    let around = AroundAlarms {
        before_s: 2.5,
        after_s: 1.0,
        ..AroundAlarms::default()
    };
    let files = record(folder.path(), around);
    assert_eq!(files.len(), 1, "{files:?}");
    let (first_s, last_s, dense) = span(&files[0]);
    assert!(
        first_s < 1.0 && last_s > 8.5 && dense,
        "{first_s} to {last_s} s"
    );
}

#[test]
fn what_came_before_is_bounded_in_memory() {
    let folder = tempfile::tempdir().unwrap();
    let around = AroundAlarms {
        before_s: 60.0,
        after_s: 0.5,
        at_most_mb: 1.0,
        ..AroundAlarms::default()
    };
    let files = record(folder.path(), around);
    // 1 MB is some two seconds of three streams at 250 Hz.
    let (first_s, _, dense) = span(&files[0]);
    assert!(
        first_s > 0.1 && first_s < 3.0 && dense,
        "begins at {first_s} s"
    );
}

#[test]
fn the_same_samples_give_the_same_files() {
    let bytes = || {
        let folder = tempfile::tempdir().unwrap();
        let files = record(folder.path(), AroundAlarms::default());
        files
            .iter()
            .map(|file| std::fs::read(file).unwrap())
            .collect::<Vec<_>>()
    };
    assert!(bytes() == bytes());
}
