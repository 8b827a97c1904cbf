//! Detection of the columns of a table that is opened without a mapping: from a mapping file next to it, from the
//! header of a known recorder, or from a header of a known layout.

use std::path::{Path, PathBuf};

use super::error::shown;
use super::layout::Layout;
use super::records::Records;
use super::{Column, Columns, CsvMapping};
use crate::error::ArchiveError;

/// Extension of the mapping file of a table: `NAME.columns.yaml` next to `NAME.csv`.
const BESIDE: &str = "columns.yaml";
/// Maximum number of header cells in an error message.
/// Chosen: covers the header of a table of six joints, one time and three columns per joint.
const SHOWN_CELLS: usize = 20;

/// A program whose tables are recognised by their header.
struct Recorder {
    /// Name of the program in remarks.
    name: &'static str,
    time: &'static str,
    time_unit_ns: u64,
    /// Column name of a joint's position; `{}` stands for the joint's index from 0.
    position: &'static str,
    velocity: &'static str,
    effort: &'static str,
    joints: &'static [&'static str],
}

/// The known recorders.
const RECORDERS: [Recorder; 2] = [
    // UniversalRobots/RTDE_Python_Client_Library, rtde/csv_writer.py. `actual_current` is in A.
    Recorder {
        name: "the RTDE recorder of Universal Robots",
        time: "timestamp",
        time_unit_ns: 1_000_000_000,
        position: "actual_q_{}",
        velocity: "actual_qd_{}",
        effort: "actual_current_{}",
        joints: &[
            "shoulder_pan_joint",
            "shoulder_lift_joint",
            "elbow_joint",
            "wrist_1_joint",
            "wrist_2_joint",
            "wrist_3_joint",
        ],
    },
    // frankaemika/libfranka, src/log.cpp, `logToCSV`: time in ms.
    Recorder {
        name: "libfranka's logToCSV",
        time: "time",
        time_unit_ns: 1_000_000,
        position: "state.q[{}]",
        velocity: "state.dq[{}]",
        effort: "state.tau_J[{}]",
        joints: &[
            "panda_joint1",
            "panda_joint2",
            "panda_joint3",
            "panda_joint4",
            "panda_joint5",
            "panda_joint6",
            "panda_joint7",
        ],
    },
];

impl Recorder {
    /// Returns the mapping, if the header names this recorder's columns.
    fn mapping(&self, header: &[String]) -> Option<CsvMapping> {
        let all = |pattern: &str| {
            let names =
                (0..self.joints.len()).map(|joint| pattern.replace("{}", &joint.to_string()));
            names.collect::<Vec<String>>()
        };
        let has = |wanted: &[String]| wanted.iter().all(|name| header.contains(name));
        let [position, velocity, effort] = [self.position, self.velocity, self.effort].map(all);
        if !header.iter().any(|name| name == self.time) || !has(&position) {
            return None;
        }
        let columns = |names: Vec<String>| Columns {
            names: Some(names),
            ..Columns::default()
        };
        Some(CsvMapping {
            time: Column {
                name: Some(self.time.to_owned()),
                number: None,
            },
            time_unit_ns: Some(self.time_unit_ns),
            velocity: has(&velocity).then(|| columns(velocity)),
            effort: has(&effort).then(|| columns(effort)),
            position: columns(position),
            joints: Some(self.joints.iter().map(|&joint| joint.to_owned()).collect()),
            header: true,
            skip_lines: 0,
            delimiter: None,
        })
    }
}

/// Returns the path of the mapping file of the table at `path`, whether or not the file exists.
fn beside(path: &Path) -> PathBuf {
    path.with_extension(BESIDE)
}

/// Returns the mapping of the table at `path`, and a sentence on how it was recognised unless a file declares it.
///
/// # Errors
/// [`ArchiveError::CsvMapping`] if there is neither a file nor a recognised header, or the file is wrong;
/// [`ArchiveError::Io`].
pub(crate) fn mapping_of(path: &Path) -> Result<(CsvMapping, Option<String>), ArchiveError> {
    let refuse = |what: &str, reason: String| ArchiveError::CsvMapping {
        path: path.to_owned(),
        what: what.to_owned(),
        reason,
    };
    let beside = beside(path);
    if beside.exists() {
        let text = std::fs::read_to_string(&beside).map_err(ArchiveError::io(&beside))?;
        let mapping: Result<CsvMapping, _> = serde_saphyr::from_str(&text);
        let refuse = |error| {
            let reason = format!("{}: {error}", beside.display());
            refuse("the file of its columns", reason)
        };
        return Ok((mapping.map_err(refuse)?, None));
    }
    let mut records = Records::open(path, None, 0)?;
    let header = if records.read()? {
        records.cells()
    } else {
        Vec::new()
    };
    for recorder in &RECORDERS {
        if let Some(mapping) = recorder.mapping(&header) {
            let name = recorder.name;
            let remark = format!("The columns are recognised by their header as those of {name}.");
            return Ok((mapping, Some(remark)));
        }
    }
    let reason = match Layout::of(&header) {
        Layout::Known(mapping, remark) => return Ok((*mapping, Some(remark))),
        Layout::Nearly { reason, columns } => format!(
            "the header is not recognised: {reason}. It names {}. Write {} with the text below, corrected where it is \
             wrong:\n\n{columns}",
            names(&header),
            beside.display()
        ),
        Layout::Unknown => format!(
            "the first line ({}) does not identify the columns. Write {}, for example `{{time: {{number: 1}}, \
             position: {{first: 2}}, velocity: {{first: 8}}, effort: {{first: 14}}, joints: [joint1, ...]}}`. \
             Recognised without it are headers such as time, NAME.position, NAME.velocity, NAME.effort, and tables of {}",
            names(&header),
            beside.display(),
            RECORDERS
                .each_ref()
                .map(|recorder| recorder.name)
                .join(" and of ")
        ),
    };
    Err(refuse("its columns", reason))
}

/// Header cells as an error shows them.
fn names(header: &[String]) -> String {
    let cells = header.iter().take(SHOWN_CELLS);
    let mut names: Vec<_> = cells.map(|cell| shown(cell.as_bytes())).collect();
    if let Some(more @ 1..) = header.len().checked_sub(SHOWN_CELLS) {
        names.push(format!("and {more} more"));
    }
    names.join(", ")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use super::*;
    use crate::Recording;

    /// A row of a table in which joint `j` has position j, velocity 10 j and effort 100 j.
    fn table(recorder: &Recorder, delimiter: &str, times: [f64; 2]) -> String {
        let joints = 0..recorder.joints.len();
        let mut names = vec![recorder.time.to_owned()];
        for pattern in [recorder.position, recorder.velocity, recorder.effort] {
            names.extend(
                joints
                    .clone()
                    .map(|joint| pattern.replace("{}", &joint.to_string())),
            );
        }
        let mut text = names.join(delimiter);
        for time in times {
            let mut row = vec![time.to_string()];
            for scale in [1, 10, 100] {
                row.extend(joints.clone().map(|joint| (joint * scale).to_string()));
            }
            text.push('\n');
            text.push_str(&row.join(delimiter));
        }
        text.push('\n');
        text
    }

    #[test]
    fn tables_of_known_recorders_open_by_their_name_alone() {
        let folder = tempfile::tempdir().unwrap();
        for (recorder, delimiter) in RECORDERS.iter().zip([" ", ","]) {
            let path = folder.path().join("log.csv");
            // Two rows, 2 ms apart.
            let unit_s = recorder.time_unit_ns as f64 * 1e-9;
            let from = 1.0 / unit_s;
            let times = [from, from + 0.002 / unit_s];
            std::fs::write(&path, table(recorder, delimiter, times)).unwrap();
            let recording = Recording::open(&path).unwrap();
            assert_eq!(recording.message_count(), 2, "{}", recorder.name);
            let span_ns = recording.end_ns().unwrap() - recording.start_ns().unwrap();
            assert_eq!(span_ns, 2_000_000, "{}", recorder.name);
            let mut states = recording.joint_states("/joint_states").unwrap();
            let state = states.next_state().unwrap().unwrap();
            assert_eq!(state.message.name, recorder.joints);
            let (velocity, effort) = (state.message.velocity[3], state.message.effort[2]);
            assert!((velocity - 30.0).abs() < 1e-12 && (effort - 200.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_file_beside_a_table_names_its_columns() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        std::fs::write(&path, "0.0,0.5\n0.1,0.6\n").unwrap();
        let error = Recording::open(&path).err().unwrap().to_string();
        assert!(error.contains("log.columns.yaml"), "{error}");
        let beside = folder.path().join("log.columns.yaml");
        std::fs::write(
            &beside,
            "{time: {number: 1}, position: {first: 2}, joints: [elbow]}",
        )
        .unwrap();
        assert_eq!(Recording::open(&path).unwrap().message_count(), 2);
        std::fs::write(&beside, "{time: {nummer: 1}}").unwrap();
        let error = Recording::open(&path).err().unwrap().to_string();
        assert!(
            error.contains("log.columns.yaml") && error.contains("nummer"),
            "{error}"
        );
    }
}
