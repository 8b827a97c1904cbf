//! Tables whose columns, delimiters, units and time are recognised.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::fs;

use proptest::prelude::*;
use tauscope_archive::{ArchiveError, Recording};

/// Opens a table with the text `columns` next to it, or by its name alone.
fn open(text: &[u8], columns: Option<&str>) -> Result<Opened, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    fs::write(&path, text).unwrap();
    if let Some(columns) = columns {
        fs::write(folder.path().join("a.columns.yaml"), columns).unwrap();
    }
    let error = |error: ArchiveError| error.to_string();
    let recording = Recording::open(&path).map_err(error)?;
    let mut opened = Opened {
        remarks: recording.remarks().to_vec(),
        joints: Vec::new(),
        rows: Vec::new(),
    };
    let mut states = recording.joint_states("/joint_states").map_err(error)?;
    while let Some(state) = states.next_state() {
        let state = state.unwrap().message;
        opened.joints.clone_from(&state.name);
        let quantities = [&state.position, &state.velocity, &state.effort];
        let values = quantities.into_iter().flatten().copied().collect();
        opened.rows.push((state.header.stamp.ns(), values));
    }
    Ok(opened)
}

struct Opened {
    remarks: Vec<String>,
    joints: Vec<String>,
    /// Time \[ns\]; positions, velocities and efforts.
    rows: Vec<(i64, Vec<f64>)>,
}

impl Opened {
    fn says(&self, words: &str) {
        let is_said = self.remarks.iter().any(|remark| remark.contains(words));
        assert!(is_said, "{words}: {:?}", self.remarks);
    }

    fn span_ns(&self) -> i64 {
        self.rows.last().unwrap().0 - self.rows[0].0
    }
}

fn by_name(text: &str) -> Opened {
    open(text.as_bytes(), None).unwrap()
}

fn refusal(text: &str) -> String {
    open(text.as_bytes(), None).map(|_| ()).unwrap_err()
}

#[test]
fn columns_of_a_joint_are_recognised_in_any_order() {
    let opened = by_name(
        "b.effort,time,a.position,note,a.effort,b.position,a.velocity,b.velocity,a.commanded_position\n\
         6,0.5,1,x,5,2,3,4,9\n6,0.6,1,y,5,2,3,4,9\n",
    );
    assert_eq!(opened.joints, ["a", "b"]);
    assert_eq!(
        opened.rows[0],
        (500_000_000, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    );
    assert_eq!(
        opened.remarks,
        [
            "The columns are recognised by their header as NAME.position, NAME.velocity and NAME.effort of 2 joints."
        ]
    );
}

#[test]
fn similar_layouts_are_recognised() {
    for (header, joints) in [
        ("time,a.position,b.position", ["a", "b"]),
        ("t,joint_1_pos,joint_2_pos", ["joint_1", "joint_2"]),
        ("timestamp,position_a_2,position_b_2", ["a_2", "b_2"]),
        (
            "__time,/joint_states/a/position,/joint_states/b/position",
            ["a", "b"],
        ),
        ("\u{feff}\"time\",\"a.position\",\"b.position\"", ["a", "b"]),
        ("# time,A.Position,B.Position", ["A", "B"]),
        ("time (s),a.position [rad],b.position [rad]", ["a", "b"]),
        ("time_s,a_position_rad,b_position_rad", ["a", "b"]),
        ("time,a.position,b.position,tool.torque", ["a", "b"]),
    ] {
        let rest = ",3".repeat(header.split(',').count() - 3);
        let opened = by_name(&format!("{header}\n0,1,2{rest}\n0.1,1,2{rest}\n"));
        assert_eq!(opened.joints, joints, "{header}");
        assert_eq!(opened.rows[1], (100_000_000, vec![1.0, 2.0]), "{header}");
    }
}

#[test]
fn a_header_that_is_nearly_known_is_described_by_a_columns_file() {
    let text = "time,q_1,q_2,q_des_1,q_des_2,tau_1,tau_2\n0,1,2,3,4,5,6\n0.1,1,2,3,4,5,6\n";
    let said = refusal(text);
    assert!(said.contains("It names time, q_1, q_2, q_des_1"), "{said}");
    assert!(said.contains("does not name the joints"), "{said}");
    // The text is a columns file that works.
    let (_, columns) = said.split_once("\n\n").unwrap();
    let opened = open(text.as_bytes(), Some(columns)).unwrap();
    assert_eq!(opened.joints, ["joint1", "joint2"]);
    assert_eq!(opened.rows[0].1, [1.0, 2.0, 5.0, 6.0]);
    let text = "Zeit,\"Position, J1 [rad]\",\"Torque, J1 [Nm]\"\n0,1,2\n0.1,1,2\n";
    let said = refusal(text);
    assert!(said.contains("no column is called time"), "{said}");
    let (_, columns) = said.split_once("\n\n").unwrap();
    let opened = open(text.as_bytes(), Some(columns)).unwrap();
    assert_eq!(opened.rows[0].1, [1.0, 2.0]);
    for (header, words) in [
        (
            "time,a.position,b.position,a.effort",
            "the effort of b is missing",
        ),
        (
            "time,/x/a/position,/y/a/position,n",
            "several columns hold the position of a",
        ),
        (
            "i,a.position,b.position,c.position",
            "no column is called time",
        ),
        ("1,2,3,4", "the first line (1, 2, 3, 4) does not identify"),
    ] {
        let said = refusal(&format!("{header}\n0,1,2,3\n"));
        assert!(
            said.contains(words) && said.contains("a.columns.yaml"),
            "{said}"
        );
    }
}

#[test]
fn quoted_header_cells_hold_commas() {
    let columns = "{header: true, time: {name: 't [s]'}, position: {names: ['Position, J1 [rad]']}, \
                   effort: {names: ['Torque, J1 [Nm]']}, joints: [pan]}";
    let text = b"t [s],\"Position, J1 [rad]\",\"Torque, J1 [Nm]\"\r\n0.5,\"1\",2\r\n1.5,3,4\r\n";
    let opened = open(text, Some(columns)).unwrap();
    assert_eq!(opened.rows[1], (1_500_000_000, vec![3.0, 4.0]));
}

#[test]
fn degrees_are_converted_where_all_say_so() {
    let half_turn = std::f64::consts::PI;
    for header in [
        "time;a.position [deg];b.position (deg);a.velocity [deg/s];b.velocity [°/s]",
        "time;a_position_deg;b_position_deg;a_velocity_deg_s;b_velocity_deg_s",
    ] {
        let opened = by_name(&format!("{header}\n0;180;0;0;180\n0,1;180;0;0;180\n"));
        assert_eq!(opened.rows[0].1, [half_turn, 0.0, 0.0, half_turn]);
        opened.says("Positions are in degrees, as the header says, and are converted to rad.");
        opened.says("Velocities are headed [deg/s] and are converted to rad/s.");
    }
    // A slide next to joints that turn.
    let opened = by_name("t,a.position [deg],z.position [m]\n0,180,2\n1e-3,180,2\n");
    assert_eq!(opened.rows[0].1, [half_turn, 2.0]);
    // A velocity without a unit next to degrees may be in either.
    let opened = by_name("t,a.position [deg],a.velocity\n0,180,2\n1e-3,180,2\n");
    assert_eq!(opened.rows[0].1, [half_turn]);
    opened.says("The velocities are left out");
    let opened = by_name(
        "t,a.position [turns],a.effort [mNm],b.position [turns],b.effort [mNm]\n0,1,5,1,5\n1e-3,1,5,1,5\n",
    );
    assert!((opened.rows[0].1[2] - 0.005).abs() < 1e-12);
    opened.says("Positions are headed [turns], an unknown unit, and are not converted.");
    opened.says("Efforts are headed [mN m] and are converted to N m.");
}

#[test]
fn units_that_contradict_each_other_are_refused() {
    for (header, words) in [
        (
            "t,a.position [deg],b.position [rad]",
            "[deg] for some columns and [rad] for others",
        ),
        (
            "t,a.position [deg],b.position",
            "no unit for \"b.position\"",
        ),
        ("t,a.position,a.velocity [deg/s]", "no unit for positions"),
        (
            "t [rad],a.position,b.position",
            "[rad] is not a unit of this quantity",
        ),
        (
            "t,a.position [Nm],b.position",
            "[N m] is not a unit of this quantity",
        ),
    ] {
        let said = refusal(&format!("{header}\n0,1,2\n"));
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn the_header_names_the_unit_of_time() {
    for (header, unit_ns, remark) in [
        ("t [s]", 1_000_000_000, None),
        (
            "time_ms",
            1_000_000,
            Some("Time is in ms, as the header says."),
        ),
        ("time [ms]", 1_000_000, Some("in ms")),
        ("t_us", 1_000, Some("in us")),
        ("Time (µs)", 1_000, Some("in us")),
        ("timestamp_ns", 1, Some("in ns")),
        ("stamp_ns", 1, Some("in ns")),
    ] {
        let opened = by_name(&format!("{header}\ta.position\n100\t1\n200\t1\n"));
        assert_eq!(opened.span_ns(), 100 * unit_ns, "{header}");
        match remark {
            Some(remark) => opened.says(remark),
            None => assert_eq!(opened.remarks.len(), 1),
        }
    }
    // Nanoseconds since 1970 are exact, as the program's own tables have them.
    let opened = by_name("stamp_ns,a.position\n1767225600000000001,1\n1767225600000000003,1\n");
    assert_eq!(opened.rows[0].0, 1_767_225_600_000_000_001);
}

#[test]
fn dates_are_times() {
    for dates in [
        ["2026-01-01T00:00:00Z", "2026-01-01T00:00:00.250Z"],
        ["2026-01-01 00:00:00", "2026-01-01 00:00:00.250"],
        [
            "2026-01-01 01:00:00+01:00",
            "2026-01-01 01:00:00.250000+01:00",
        ],
        ["2025-12-31T19:00:00-0500", "2025-12-31T19:00:00.25-0500"],
    ] {
        let opened = by_name(&format!(
            "time,a.position\n{},1\n{},1\n",
            dates[0], dates[1]
        ));
        assert_eq!(opened.rows[0].0, 1_767_225_600_000_000_000, "{dates:?}");
        assert_eq!(opened.span_ns(), 250_000_000);
        opened.says("Time is read as ISO 8601 dates");
    }
    let said = refusal("time,a.position\n2026-01-01T00:00:00Z,1\n2026-01-01T25:00:00Z,1\n");
    assert!(
        said.contains(":3: column 1 (time): \"2026-01-01T25:00:00Z\" is not a date"),
        "{said}"
    );
    let said = refusal("time,a.position\n2026-01-01T00:00:01Z,1\n2026-01-01T00:00:00Z,1\n");
    assert!(
        said.contains(":3: ") && said.contains("time runs backwards"),
        "{said}"
    );
}

/// A table whose joint swings with 0.5 rad at 1 rad/s, with a row each `step_s` and times in units of `unit_s` from
/// `start_s` on.
fn swinging(start_s: f64, step_s: f64, unit_s: f64) -> String {
    let rows = (0..3000).map(|row| {
        let t = f64::from(row) * step_s;
        let q = 0.5 * (2.0 * t).sin();
        format!("{:.3},{q}\n", (start_s + t) / unit_s)
    });
    "time,a.position\n".to_owned() + &rows.collect::<String>()
}

#[test]
fn the_motion_tells_the_unit_of_time() {
    let epoch_s = 1_767_225_600.0;
    for (start_s, step_s, unit_s, remark) in [
        (0.0, 0.002, 1.0, None),
        (epoch_s, 0.01, 1.0, None),
        (
            0.0,
            0.002,
            1e-3,
            Some("Time is in ms: as seconds the arm would move at most"),
        ),
        (40.0, 0.1, 1e-3, Some("Time is in ms: as seconds the arm")),
        (0.0, 0.01, 1e-6, Some("Time is in us: as seconds the arm")),
        (0.0, 0.0005, 1e-6, Some("Time is in us: as seconds the arm")),
        (0.0, 0.0001, 1e-6, Some("Time is in us: as seconds the arm")),
        (0.0, 0.008, 1e-9, Some("Time is in ns: as seconds, ")),
        // Since the machine was switched on.
        (1e6, 0.01, 1e-6, Some("Time is in us: as seconds, ")),
        (1e6, 0.001, 1e-9, Some("Time is in ns: as seconds, ")),
        (epoch_s, 0.01, 1e-3, Some("Time is in ms: as seconds, ")),
        (epoch_s, 0.004, 1e-6, Some("Time is in us: as seconds, ")),
        (epoch_s, 0.002, 1e-9, Some("Time is in ns: as seconds, ")),
        (epoch_s, 1.0, 1e-3, Some("Time is in ms: as seconds, ")),
        // Seconds, but few: that is reported.
        (
            0.0,
            1.0,
            1.0,
            Some("The time has no unit and is read as seconds: its rows are 1 s apart."),
        ),
    ] {
        let opened = by_name(&swinging(start_s, step_s, unit_s));
        let span_s = opened.span_ns() as f64 * 1e-9;
        let error = (span_s - 2999.0 * step_s).abs();
        assert!(
            error < 1e-3,
            "{start_s} {step_s} {unit_s}: {span_s} s, {:?}",
            opened.remarks
        );
        match remark {
            Some(remark) => opened.says(remark),
            None => assert_eq!(opened.remarks.len(), 1, "{:?}", opened.remarks),
        }
    }
}

#[test]
fn broken_positions_do_not_hide_the_unit_of_time() {
    let table = swinging(0.0, 0.002, 1e-3) + "6000,1e300\n6002,nan\n6004,0.1\n";
    let opened = by_name(&table);
    assert_eq!(opened.span_ns(), 6_004_000_000);
    opened.says("Time is in ms: as seconds the arm would move at most 0.001 rad/s.");
}

#[test]
fn held_poses_and_coarse_stamps_stay_in_seconds() {
    // One row for each pose.
    let poses = (0..200).map(|row| format!("{row},{}\n", f64::from(row % 7) * 0.3));
    let opened = by_name(&("time,a.position\n".to_owned() + &poses.collect::<String>()));
    assert_eq!(opened.span_ns(), 199_000_000_000);
    // Whole seconds with a hundred rows each.
    let rows = (0..3000).map(|row| format!("{},{}\n", row / 100, (f64::from(row) * 0.01).sin()));
    let opened = by_name(&("time,a.position\n".to_owned() + &rows.collect::<String>()));
    assert_eq!(opened.span_ns(), 29_000_000_000);
    // An arm at rest.
    let opened = by_name("time,a.position\n0,1\n10,1\n20,1\n");
    assert_eq!(opened.span_ns(), 20_000_000_000);
    opened.says("its rows are 10 s apart");
}

#[test]
fn a_columns_file_has_the_last_word_on_the_unit_of_time() {
    let columns =
        "{header: true, time: {number: 1}, time_unit_ns: 1000, position: {first: 2}, joints: [a]}";
    let table = swinging(0.0, 0.01, 1e-3).replace("time,", "time [ms],");
    let opened = open(table.as_bytes(), Some(columns)).unwrap();
    assert_eq!(opened.span_ns(), 29_990_000);
    assert!(opened.remarks.is_empty(), "{:?}", opened.remarks);
}

#[test]
fn a_comma_among_decimal_points_is_no_number() {
    let said = refusal("time;a.position\n0.5;1\n0.6;1,234\n");
    assert!(
        said.contains(":3: ") && said.contains("\"1,234\" is not a number"),
        "{said}"
    );
}

#[test]
fn decimal_commas_are_reported() {
    let opened = by_name("time;a.position\n0,5;-1,5e-1\n0,6;+,25\n");
    assert_eq!(
        opened.rows,
        [(500_000_000, vec![-0.15]), (600_000_000, vec![0.25])]
    );
    opened.says("Numbers are read with decimal commas.");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// A table with decimal commas has the same numbers as one with points, for any delimiter.
    #[test]
    fn decimal_commas_are_read_as_points(
        numbers in prop::collection::vec((0.001..0.1_f64, -1e9..1e9_f64, prop::num::f64::NORMAL), 1..20),
        tabs: bool,
    ) {
        let table = |delimiter: &str, comma: bool| {
            let mut time = 0.25;
            let mut text = ["time", "a.position", "a.velocity\n"].join(delimiter);
            for (step, position, velocity) in &numbers {
                time += step;
                let cells = [format!("{time:?}"), format!("{position:?}"), format!("{velocity:e}\n")];
                let cells = cells.map(|cell| if comma { cell.replace('.', ",") } else { cell });
                text += &cells.join(delimiter);
            }
            text
        };
        let points = by_name(&table(",", false));
        let commas = by_name(&table(if tabs { "\t" } else { ";" }, true));
        prop_assert_eq!(points.rows, commas.rows);
    }
}
