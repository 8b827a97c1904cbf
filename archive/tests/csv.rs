//! Tables of numbers, good and bad.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::fs;

use crate::common::shared;
use tauscope_archive::{
    ArchiveError, Column, Columns, CsvMapping, DamageKind, Recording, RecordingKind,
};

fn number(number: usize) -> Column {
    Column {
        number: Some(number),
        name: None,
    }
}

fn first(first: usize) -> Columns {
    Columns {
        first: Some(first),
        ..Columns::default()
    }
}

/// Time, then positions, velocities and efforts, one for each of `joints` joints.
fn mapping(joints: usize) -> CsvMapping {
    CsvMapping {
        time: number(1),
        time_unit_ns: Some(1_000_000_000),
        position: first(2),
        velocity: Some(first(2 + joints)),
        effort: Some(first(2 + 2 * joints)),
        joints: Some((1..=joints).map(|i| format!("joint{i}")).collect()),
        header: false,
        skip_lines: 0,
        delimiter: None,
    }
}

fn open(text: &str, mapping: &CsvMapping) -> Result<Recording, ArchiveError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, text).unwrap();
    Recording::open_csv(path, mapping, &[])
}

fn error(text: &str, mapping: &CsvMapping) -> String {
    match open(text, mapping) {
        Ok(_) => panic!("{text:?} was read"),
        Err(error) => {
            let text = error.to_string();
            text.split_once("a.csv").unwrap().1.to_owned()
        }
    }
}

#[test]
fn rows_are_joint_states() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "0.5,1,2,3\r\n\r\n0.5,\"4\",5,nan\r\n1.25, 7 ,,9").unwrap();
    let recording = Recording::open_csv(&path, &mapping(1), &[]).unwrap();
    assert_eq!(recording.kind(), RecordingKind::Csv);
    assert_eq!(recording.start_ns(), Some(500_000_000));
    assert_eq!(recording.end_ns(), Some(1_250_000_000));
    assert_eq!(recording.topics()[0].message_count, 3);
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut rows = Vec::new();
    while let Some(state) = states.next_state() {
        let state = state.unwrap();
        assert_eq!(state.message.name, ["joint1"]);
        let m = state.message;
        assert_eq!(m.header.stamp.ns(), state.log_time_ns);
        rows.push((state.log_time_ns, m.position[0], m.velocity[0], m.effort[0]));
    }
    assert_eq!(rows[0], (500_000_000, 1.0, 2.0, 3.0));
    assert!((rows[1].1 - 4.0).abs() < 1e-12);
    // A missing value is NaN, which the reader drops and counts.
    assert!(rows[1].3.is_nan() && rows[2].2.is_nan());
    assert_eq!(rows.len(), 3);
}

#[test]
fn columns_are_found_by_name() {
    let names = |names: &[&str]| Columns {
        names: Some(names.iter().map(|&name| name.to_owned()).collect()),
        ..Columns::default()
    };
    let mapping = CsvMapping {
        time: Column {
            number: None,
            name: Some("t".to_owned()),
        },
        time_unit_ns: Some(1_000_000_000),
        position: names(&["q2", "q1"]),
        velocity: None,
        effort: Some(names(&["i2", "i1"])),
        joints: Some(vec!["two".to_owned(), "one".to_owned()]),
        header: true,
        skip_lines: 2,
        delimiter: None,
    };
    let text = "made by\na logger\nt; q1; q2; i1; \"i2\"\n0; 1; 2; 3; 4\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, text).unwrap();
    let recording = Recording::open_csv(&path, &mapping, &[]).unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    let state = states.next_state().unwrap().unwrap().message;
    assert_eq!(state.position, [2.0, 1.0]);
    assert_eq!(state.effort, [4.0, 3.0]);
    assert!(state.velocity.is_empty());

    let mut wrong = mapping.clone();
    wrong.position = names(&["q2", "q3"]);
    assert_eq!(
        error(text, &wrong),
        ": position: no column \"q3\"; there are t, q1, q2, i1, i2"
    );
    wrong.header = false;
    wrong.skip_lines = 3;
    assert_eq!(
        error(text, &wrong),
        ": time: column \"t\", but `header` is not true"
    );
    // Line numbers count what was skipped.
    assert_eq!(
        error(&text.replace("; 4", "; x"), &mapping),
        ":4: column 5 (effort of two): \"x\" is not a number"
    );
}

#[test]
fn a_mapping_that_does_not_fit_is_refused() {
    let mut wrong = mapping(2);
    assert_eq!(
        error("0,1,2,3\n", &wrong),
        ": velocity: column 5, but the table has 4 columns"
    );
    wrong.position = first(0);
    assert_eq!(
        error("0,1,2,3\n", &wrong),
        ": position: columns are counted from 1"
    );
    wrong.position = Columns {
        numbers: Some(vec![2]),
        ..Columns::default()
    };
    assert_eq!(
        error("0,1,2,3\n", &wrong),
        ": position: 1 columns for 2 joints"
    );
    let mut nameless = wrong.clone();
    nameless.joints = None;
    assert!(error("0,1,2,3\n", &nameless).starts_with(": joints: there are none"));
    wrong.position.first = Some(1);
    assert_eq!(
        error("0,1,2,3\n", &wrong),
        ": position: give `first`, `numbers` or `names`, one of them"
    );
}

#[test]
fn a_line_that_makes_no_sense_is_told_with_its_number() {
    let m = mapping(1);
    for (text, expected) in [
        (
            "0,1,2,3\n0.1,1,2\n0.2,1,2,3\n",
            ":2: 3 columns, the lines before have 4",
        ),
        (
            "0,1,2,3\n0.1,1,2,3,4\n",
            ":2: 5 columns, the lines before have 4",
        ),
        (
            "0,1,2,3\n0.1,1,2,0x7\n",
            ":2: column 4 (effort of joint1): \"0x7\" is not a number",
        ),
        (
            "1,1,2,3\n0.9,1,2,3\n",
            ":2: column 1 (time): 0.9 s comes after 1 s: time runs backwards",
        ),
        (
            "nan,1,2,3\n",
            ":1: column 1 (time): \"nan\" is not a time from 0 to 2.147483647e9 s",
        ),
    ] {
        assert_eq!(error(text, &m), expected);
    }
    // No line end, and so no end of memory either.
    let long = error(&"1".repeat(3 << 20), &m);
    assert_eq!(
        long,
        ":1: a line of more than 1048576 bytes: this is not a table"
    );
}

#[test]
fn a_last_line_without_an_end_is_a_torn_tail() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "0,1,2,3\n0.1,1,2,3\n0.2,1").unwrap();
    let recording = Recording::open_csv(&path, &mapping(1), &[]).unwrap();
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert_eq!((damage.at, &damage.kind), (3, &DamageKind::TornTail));
    assert_eq!(damage.readable_until_ns, Some(100_000_000));
    assert_eq!(crate::common::read_all(&recording).0.len(), 2);
}

#[test]
fn a_table_without_rows_is_empty() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "").unwrap();
    let recording = Recording::open_csv(&path, &mapping(1), &[]).unwrap();
    assert!(matches!(
        recording.joint_states("/joint_states"),
        Err(ArchiveError::Empty { .. })
    ));
}

#[test]
fn a_real_table() {
    let Some(path) = shared(
        "a_real_table",
        "recordings/ur10e/csv/20_02_05-20sec_8harm.csv",
    ) else {
        return;
    };
    let recording = Recording::open_csv(&path, &mapping(6), &[]).unwrap();
    assert_eq!(recording.topics()[0].message_count, 2506);
    // The MCAP file of that name was made from this table.
    let other = path.with_file_name("../20_02_05-20sec_8harm.mcap");
    let other = Recording::open(other).unwrap();
    assert_eq!(other.topics()[0].message_count, 2506);
    let mut a = recording.joint_states("/joint_states").unwrap();
    let mut b = other.joint_states("/joint_states").unwrap();
    while let Some(row) = a.next_state() {
        let row = row.unwrap().message;
        let message = b.next_state().unwrap().unwrap().message;
        assert_eq!(row.position, message.position);
        assert_eq!(row.velocity, message.velocity);
        assert_eq!(row.effort, message.effort);
    }
}

#[test]
fn a_real_broken_table_is_passed_on_as_it_is() {
    let test = "a_real_broken_table_is_passed_on_as_it_is";
    let Some(path) = shared(test, "recordings/ur10e/csv/dirty.csv") else {
        return;
    };
    // As it is meant: 19 columns. Line 3 holds -1.6e181 for a position, which is a number.
    let recording = Recording::open_csv(&path, &mapping(6), &[]).unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut positions = Vec::new();
    while let Some(state) = states.next_state() {
        positions.push(state.unwrap().message.position[1]);
    }
    assert_eq!(positions.len(), 1139);
    assert!(positions[2] < -1e180);
    // Read as a table with target currents and torques.
    let mut wide = mapping(6);
    wide.effort = Some(first(26));
    let error = Recording::open_csv(&path, &wide, &[]).err().unwrap();
    assert!(
        error.to_string().contains("the table has 19 columns"),
        "{error}"
    );
    // Time in the wrong column.
    let mut wrong = mapping(5);
    wrong.time = number(19);
    assert!(matches!(
        Recording::open_csv(&path, &wrong, &[]),
        Err(ArchiveError::Csv(_))
    ));
}

#[test]
fn a_number_that_cannot_be_is_passed_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, "0,1e170,2,3\n0.1,-1e7,inf,1e999\n").unwrap();
    let recording = Recording::open_csv(&path, &mapping(1), &[]).unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    assert_eq!(
        states.next_state().unwrap().unwrap().message.position,
        [1e170]
    );
    let state = states.next_state().unwrap().unwrap().message;
    assert_eq!(state.position, [-1e7]);
    assert_eq!(
        (state.velocity[0], state.effort[0]),
        (f64::INFINITY, f64::INFINITY)
    );
}

#[test]
fn lines_are_counted_by_any_line_end() {
    let m = mapping(1);
    for end in ["\n", "\r\n", "\r"] {
        for (text, line) in [
            ("0,1,2,3|0.1,1,2,x|", 2),
            ("0,1,2,3||  ||0.1,1,2,x", 5),
            ("0,1,2,\"3\"|0.1,1,2,x|0.2,1,2,3|", 2),
            ("|0,1,2,3|0.1,1,2,3|0.1,1,2|0.2,1,2,3|", 4),
        ] {
            let expected = format!(":{line}: ");
            let error = error(&text.replace('|', end), &m);
            assert!(error.starts_with(&expected), "{end:?} {text}: {error}");
        }
    }
    // A quoted cell of several lines, after a skipped one and a byte order mark.
    let mut noted = mapping(1);
    noted.effort = None;
    noted.skip_lines = 1;
    let error = error(
        "\u{feff}a log\r\n0,1,2,\"a note\r\nof two lines\"\r\n0.1,1,x,\"and\nanother\"\r\n",
        &noted,
    );
    assert!(error.starts_with(":4: column 3"), "{error}");
}

#[test]
fn a_quotation_mark_without_its_second_one_is_named() {
    let m = mapping(1);
    let rows = "0.2,1,2,3\n".repeat(5);
    for text in [
        format!("0,1,2,3\n0.1,\"1,2,3\n{rows}"),
        format!("0,1,2,3\n0.1,\"1,2,3\n{}", rows.trim_end()),
    ] {
        let expected =
            ":2: column 2: a cell begins with a quotation mark, and the second mark is missing";
        assert!(
            error(&text, &m).starts_with(expected),
            "{}",
            error(&text, &m)
        );
    }
    // Nor does it fill the memory.
    let long = format!("0,1,2,3\n0.1,\"1,2,3\n{}", "0.2,1,2,3\n".repeat(300_000));
    assert!(
        error(&long, &m).starts_with(":2: this line: a cell begins"),
        "{}",
        error(&long, &m)
    );
}

#[test]
fn a_clock_that_stands_still_is_refused() {
    assert_eq!(
        error("5,1,2,3\n5,1,2,3\n5,1,2,3\n", &mapping(1)),
        ":3: column 1 (time): all 3 rows have the time 5 s: the clock stands still"
    );
}
