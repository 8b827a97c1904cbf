//! Which column is what in a table that was opened by its name alone: told by a file beside it, or by the header of a
//! recorder that is known.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};

use super::{Column, Columns, CsvMapping};
use crate::error::ArchiveError;

/// Ending of the file beside a table `NAME.csv` that holds its mapping: `NAME.columns.yaml`.
const BESIDE: &str = "columns.yaml";
/// A longer first line is no header \[bytes\].
/// Physical: ten times the header of a recorder that writes every field of a UR controller.
const LONGEST_HEADER: u64 = 1 << 17;

/// A recorder whose header is known.
struct Recorder {
    /// Who writes such tables.
    name: &'static str,
    delimiter: char,
    time: &'static str,
    time_unit_ns: u64,
    /// Name of the column of joint `{}`, counted from 0.
    position: &'static str,
    velocity: &'static str,
    effort: &'static str,
    joints: &'static [&'static str],
}

/// Those that are known.
const RECORDERS: [Recorder; 2] = [
    // UniversalRobots/RTDE_Python_Client_Library, rtde/csv_writer.py. `actual_current` is in A.
    Recorder {
        name: "the RTDE recorder of Universal Robots",
        delimiter: ' ',
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
        delimiter: ',',
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
    /// The mapping, if the first line names this recorder's columns.
    fn mapping(&self, first_line: &str) -> Option<CsvMapping> {
        let names: Vec<&str> = first_line.split(self.delimiter).map(str::trim).collect();
        let all = |pattern: &str| {
            let names =
                (0..self.joints.len()).map(|joint| pattern.replace("{}", &joint.to_string()));
            names.collect::<Vec<String>>()
        };
        let has = |wanted: &[String]| wanted.iter().all(|name| names.contains(&name.as_str()));
        let [position, velocity, effort] = [self.position, self.velocity, self.effort].map(all);
        if !names.contains(&self.time) || !has(&position) {
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
            time_unit_ns: self.time_unit_ns,
            velocity: has(&velocity).then(|| columns(velocity)),
            effort: has(&effort).then(|| columns(effort)),
            position: columns(position),
            joints: Some(self.joints.iter().map(|&joint| joint.to_owned()).collect()),
            header: true,
            skip_lines: 0,
            delimiter: self.delimiter,
        })
    }
}

/// The file beside the table at `path` that holds its mapping, there or not.
fn beside(path: &Path) -> PathBuf {
    path.with_extension(BESIDE)
}

/// The mapping of the table at `path`.
///
/// # Errors
/// If nothing tells it, or the file that should is wrong.
pub(crate) fn mapping_of(path: &Path) -> Result<CsvMapping, ArchiveError> {
    let refuse = |what: &str, reason: String| ArchiveError::CsvMapping {
        path: path.to_owned(),
        what: what.to_owned(),
        reason,
    };
    let beside = beside(path);
    if beside.exists() {
        let text = std::fs::read_to_string(&beside).map_err(ArchiveError::io(&beside))?;
        let mapping: Result<CsvMapping, _> = serde_saphyr::from_str(&text);
        return mapping.map_err(|error| {
            refuse(
                "the file of its columns",
                format!("{}: {error}", beside.display()),
            )
        });
    }
    let mut first_line = String::new();
    let file = File::open(path).map_err(ArchiveError::io(path))?;
    let read = BufReader::new(file.take(LONGEST_HEADER)).read_line(&mut first_line);
    let known = match read {
        Ok(_) => RECORDERS
            .iter()
            .find_map(|recorder| recorder.mapping(first_line.trim_end())),
        // Not even text, which whoever reads it says.
        Err(_) => None,
    };
    known.ok_or_else(|| {
        let recorders: Vec<&str> = RECORDERS.iter().map(|recorder| recorder.name).collect();
        refuse(
            "its columns",
            format!(
                "nothing says which column is what: write {}, for example `{{time: {{number: 1}}, position: {{first: 2}}, \
                 velocity: {{first: 8}}, effort: {{first: 14}}, joints: [joint1, ...]}}`; known without it are tables of {}",
                beside.display(),
                recorders.join(" and of ")
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

    use super::*;
    use crate::Recording;

    /// A row of a table in which joint `j` has position j, velocity 10 j and effort 100 j.
    fn table(recorder: &Recorder, times: [f64; 2]) -> String {
        let joints = 0..recorder.joints.len();
        let mut names = vec![recorder.time.to_owned()];
        for pattern in [recorder.position, recorder.velocity, recorder.effort] {
            names.extend(
                joints
                    .clone()
                    .map(|joint| pattern.replace("{}", &joint.to_string())),
            );
        }
        let delimiter = recorder.delimiter.to_string();
        let mut text = names.join(&delimiter);
        for time in times {
            let mut row = vec![time.to_string()];
            for scale in [1, 10, 100] {
                row.extend(joints.clone().map(|joint| (joint * scale).to_string()));
            }
            text.push('\n');
            text.push_str(&row.join(&delimiter));
        }
        text.push('\n');
        text
    }

    #[test]
    fn tables_of_known_recorders_open_by_their_name_alone() {
        let folder = tempfile::tempdir().unwrap();
        for recorder in &RECORDERS {
            let path = folder.path().join("log.csv");
            // Two rows, 2 ms apart.
            let unit_s = recorder.time_unit_ns as f64 * 1e-9;
            let from = 1.0 / unit_s;
            std::fs::write(&path, table(recorder, [from, from + 0.002 / unit_s])).unwrap();
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
