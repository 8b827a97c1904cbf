//! Recordings as sources.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "what is copied comes out as it went in"
)]

use std::path::Path;

use crate::common::{Collect, cell, drain, file, shared, state, write_bag};
use tauscope_bus::{JointState, Progress, Source, flags};
use tauscope_ingest::{Config, CsvConfig, FileConfig, Rate, RecordedSource, Setup, Topics, open};

const MS: i64 = 1_000_000;

fn bag(folder: &Path, messages: &[(&str, i64, tauscope_archive::ros::JointState)]) -> FileConfig {
    let path = folder.join("a.mcap");
    write_bag(&path, messages);
    file(&path)
}

fn read(file: &FileConfig, setup: &Setup) -> (Vec<JointState>, RecordedSource) {
    let mut source = RecordedSource::open_file(file, &Config::default(), setup).unwrap();
    let samples = drain(&mut source);
    (samples, source)
}

fn error(file: &FileConfig, setup: &Setup) -> String {
    let error = RecordedSource::open_file(file, &Config::default(), setup).unwrap_err();
    assert!(error.is_input(), "{error}");
    error.to_string()
}

#[test]
fn a_bag_comes_out_in_the_cells_order_with_its_commands() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = Vec::new();
    for i in 0..100_i64 {
        let (ns, q) = (1_000_000 * MS + i * 10 * MS, i as f64);
        // The command of an instant follows its state in the file, as many drivers write it.
        messages.push((
            "/joint_states",
            ns + MS,
            state(ns, "b a", &[2.0 * q, q], &[20.0, 10.0]),
        ));
        messages.push((
            "/commands",
            ns + 2 * MS,
            state(ns, "a b", &[q + 0.5, 2.0 * q + 0.5], &[]),
        ));
        messages.push(("/twin", ns + 3 * MS, state(ns, "a b", &[], &[q, -q])));
    }
    let mut file = bag(folder.path(), &messages);
    file.topics.command = Some("/commands".to_owned());
    file.topics.twin = Some("/twin".to_owned());
    let (samples, source) = read(&file, &cell("a b"));
    assert_eq!(samples.len(), 100);
    assert_eq!(source.dropped(), 0);
    assert_eq!(source.fraction_done(), Some(1.0));
    for (i, sample) in samples.iter().enumerate() {
        let q = i as f64;
        assert!(
            sample
                .header
                .has(flags::COMMAND | flags::REFERENCE | flags::EFFORT_MEASURED)
        );
        assert!(!sample.header.has(flags::VELOCITY_MEASURED));
        assert_eq!(sample.header.received_ns - sample.header.stamp_ns, MS);
        assert_eq!(sample.position[..2], [q, 2.0 * q]);
        assert_eq!(sample.effort[..2], [10.0, 20.0]);
        assert_eq!(sample.command_position[..2], [q + 0.5, 2.0 * q + 0.5]);
        assert_eq!(sample.reference_effort[..2], [q, -q]);
    }
    // 1 and 2 rad in 10 ms.
    let last = samples[99];
    assert!((last.velocity[0] - 100.0).abs() < 1e-6 && (last.velocity[1] - 200.0).abs() < 1e-6);
    assert!((last.command_velocity[0] - 100.0).abs() < 1e-6);
}

#[test]
fn what_is_wrong_with_a_whole_recording_shows_when_it_is_opened() {
    let folder = tempfile::tempdir().unwrap();
    let ok = |i: i64| {
        (
            "/joint_states",
            i,
            state(i, "a b", &[1.0, 2.0], &[1.0, f64::NAN]),
        )
    };
    let bag = bag(folder.path(), &(1..2000).map(ok).collect::<Vec<_>>());
    let said = error(&bag, &cell("a b"));
    assert!(
        said.ends_with("a.mcap: effort of joint `b` is NaN throughout (1999 messages)"),
        "{said}"
    );
    let said = error(&bag, &cell("a x y"));
    assert!(
        said.contains("no joint state names x, y. The messages name a, b"),
        "{said}"
    );
    let other = FileConfig {
        topics: Topics {
            state: "/other".to_owned(),
            ..Topics::default()
        },
        ..bag.clone()
    };
    let said = error(&other, &cell("a"));
    assert!(
        said.contains("no topic \"/other\"; it has /joint_states"),
        "{said}"
    );
    let other = FileConfig {
        topics: Topics {
            command: Some("/commands".to_owned()),
            ..Topics::default()
        },
        ..bag.clone()
    };
    assert!(error(&other, &cell("a")).contains("no topic \"/commands\""));
    let absent = FileConfig {
        path: folder.path().join("b.mcap"),
        ..bag
    };
    assert!(error(&absent, &cell("a")).contains("b.mcap"));
}

#[test]
fn nan_is_dropped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let messages: Vec<_> = (1..=100)
        .map(|i| {
            let effort = if i % 10 == 0 { f64::NAN } else { 1.0 };
            (
                "/joint_states",
                i,
                state(i, "a b", &[1.0, 2.0], &[1.0, effort]),
            )
        })
        .collect();
    let (samples, source) = read(&bag(folder.path(), &messages), &cell("a b"));
    assert_eq!((samples.len(), source.dropped()), (90, 10));
}

#[test]
fn a_torn_recording_is_read_to_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let messages: Vec<_> = (0..1000)
        .map(|i| {
            let ns = 1_000_000 * MS + i * 10 * MS;
            (
                "/joint_states",
                ns,
                state(ns, "a", &[i as f64], &[(i as f64).sin()]),
            )
        })
        .collect();
    let file = bag(folder.path(), &messages);
    let bytes = std::fs::read(&file.path).unwrap();
    std::fs::write(&file.path, &bytes[..bytes.len() / 2]).unwrap();
    let (samples, source) = read(&file, &cell("a"));
    assert!((100..900).contains(&samples.len()), "{}", samples.len());
    assert!(source.dropped() >= 1);
    assert_eq!(source.damage().len(), 1);
    let whole = samples
        .iter()
        .enumerate()
        .all(|(i, s)| (s.position[0] - i as f64).abs() < 1e-12);
    assert!(whole);
}

#[test]
fn a_source_is_paced_as_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let messages: Vec<_> = (1..=20)
        .map(|i| {
            (
                "/joint_states",
                i * 10 * MS,
                state(i * 10 * MS, "a", &[0.0], &[]),
            )
        })
        .collect();
    let file = bag(folder.path(), &messages);
    for (rate, least_ms) in [
        (Rate::Fast, 0),
        (Rate::Factor(2.0), 94),
        (Rate::Realtime, 189),
    ] {
        let config = Config {
            file: Some(file.clone()),
            rate,
            ..Config::default()
        };
        let mut source = open(&config, &cell("a"), None).unwrap();
        let begin = std::time::Instant::now();
        let mut out = Collect(Vec::new());
        while source.step(&mut out).unwrap() != Progress::End {}
        assert_eq!(out.0.len(), 20);
        assert!(
            begin.elapsed().as_millis() >= least_ms,
            "{rate:?}: {:?}",
            begin.elapsed()
        );
    }
}

#[test]
fn a_table_is_read_by_its_mapping() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let rows = (0..50).map(|i| format!("{},{i},{},0.5,0.25\n", 0.01 * f64::from(i), 2 * i));
    std::fs::write(&path, rows.collect::<String>()).unwrap();
    let columns = "{time: {number: 1}, position: {first: 2}, effort: {first: 4}, joints: [b, a]}";
    let csv = CsvConfig {
        path,
        columns: serde_saphyr::from_str(columns).unwrap(),
    };
    let mut source = RecordedSource::open_csv(&csv, &Config::default(), &cell("a b")).unwrap();
    let samples = drain(&mut source);
    assert_eq!(samples.len(), 50);
    assert_eq!(samples[7].position[..2], [14.0, 7.0]);
    assert_eq!(samples[7].effort[..2], [0.25, 0.5]);
}

const UR: &str = "shoulder_pan_joint shoulder_lift_joint elbow_joint wrist_1_joint wrist_2_joint \
                  wrist_3_joint";
const FRANKA: &str = "panda_joint1 panda_joint2 panda_joint3 panda_joint4 panda_joint5 \
                      panda_joint6 panda_joint7";

/// Reads a file of `../shared/recordings`; returns its samples and the source.
fn read_shared(test: &str, path: &str, joints: &str) -> Option<(Vec<JointState>, RecordedSource)> {
    let path = shared(test, &format!("recordings/{path}"))?;
    Some(read(&file(&path), &cell(joints)))
}

fn assert_in_order(samples: &[JointState]) {
    assert!(
        samples
            .windows(2)
            .all(|pair| pair[0].header.stamp_ns < pair[1].header.stamp_ns)
    );
}

#[test]
fn a_real_ur10e_in_ampere() {
    let path = "ur10e/20_02_05-20sec_8harm.mcap";
    let Some((samples, source)) = read_shared("a_real_ur10e_in_ampere", path, UR) else {
        return;
    };
    assert!(samples.len() > 1500, "{}", samples.len());
    assert_eq!(source.dropped(), 0);
    assert_in_order(&samples);
    assert!(samples.iter().all(|s| {
        s.header
            .has(flags::VELOCITY_MEASURED | flags::EFFORT_MEASURED)
    }));
    // The values must equal those of the table that its authors published.
    let Some(path) = shared("", "recordings/ur10e/csv/20_02_05-20sec_8harm.csv") else {
        return;
    };
    let columns =
        "{time: {number: 1}, position: {first: 2}, velocity: {first: 8}, effort: {first: 14}}";
    let csv = CsvConfig {
        path,
        columns: serde_saphyr::from_str(columns).unwrap(),
    };
    let mut source = RecordedSource::open_csv(&csv, &Config::default(), &cell(UR)).unwrap();
    let rows = drain(&mut source);
    assert_eq!(rows.len(), samples.len());
    for (row, sample) in rows.iter().zip(&samples) {
        assert_eq!(row.position, sample.position);
        assert_eq!(row.effort, sample.effort);
    }
}

#[test]
fn a_real_panda_with_repeated_rows() {
    let test = "a_real_panda_with_repeated_rows";
    let Some(folder) = shared(test, "recordings/franka-touch") else {
        return;
    };
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "mcap") {
            continue;
        }
        let (samples, source) = read(&file(&path), &cell(FRANKA));
        assert!(samples.len() > 1000, "{path:?}: {}", samples.len());
        assert_eq!(source.dropped(), 0, "{path:?}");
        assert_in_order(&samples);
        count += 1;
    }
    assert!(count > 1);
}

#[test]
fn a_real_sqlite_bag() {
    let Some((samples, source)) = read_shared("a_real_sqlite_bag", "ur10-bag", UR) else {
        return;
    };
    assert!((3300..3500).contains(&samples.len()), "{}", samples.len());
    assert_eq!(source.dropped(), 0);
    assert_in_order(&samples);
}
