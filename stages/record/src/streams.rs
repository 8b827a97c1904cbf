//! Input streams of a recorder and their topics.

use std::collections::BTreeMap;

use tauscope_bus::{MAX_JOINTS, SampleKind, SampleRef};
use tauscope_dynamics::Model;

use crate::error::RecordError;

/// Properties of a cell that a recorder needs.
#[derive(Debug, Clone)]
pub struct CellInfo {
    /// Its name.
    pub name: String,
    /// Its joints, in URDF order.
    pub joint_names: Vec<String>,
    /// Its robot, if there is one, for the picture.
    pub model: Option<Model>,
    /// Unit of its efforts, `Nm` or `A`.
    pub effort_unit: String,
}

impl CellInfo {
    /// Name of the robot's root link, whose frame is the world frame.
    pub(crate) fn root(&self) -> &str {
        self.model.as_ref().map_or("world", root)
    }
}

/// Name of the link whose frame is the world frame.
pub(crate) fn root(model: &Model) -> &str {
    let root = model.links().iter().find(|link| link.parent.is_none());
    root.map_or("world", |link| &link.name)
}

/// A stream that a recorder listens to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamInfo {
    /// The stage it comes from.
    pub stage: String,
    /// The cell it belongs to.
    pub cell: String,
    /// Sample type; health reports of the stage may be mixed in.
    pub kind: SampleKind,
    /// The detector that emits it, if known.
    pub detector: Option<String>,
    /// Unit of its scores; empty if there are none or the unit is unknown.
    pub score_unit: String,
}

/// A stream with its place among the others.
#[derive(Debug)]
pub(crate) struct Stream {
    pub stage: String,
    pub cell: usize,
    pub kind: SampleKind,
    /// Unique label within the cell: the detector, or else the stage.
    pub label: String,
    /// Unit of a detector's scores; empty if there are none or the unit is unknown.
    pub score_unit: String,
    /// Topic of the effort, the twin's effort or the detections; see [`Streams`].
    pub topic: String,
}

/// All streams, by name, with their topics.
///
/// The topics are those of `docs/archive.md`. With more than one cell, each begins with `/<cell>`. If a cell has
/// several streams of one kind, the stage's name is appended (`/residual/<stage>`). For detectors the label is
/// appended: the name of the detector, or of the stage if two stages run the same detector.
#[derive(Debug)]
pub(crate) struct Streams {
    pub cells: Vec<CellInfo>,
    pub all: Vec<Stream>,
    by_stage: BTreeMap<String, usize>,
}

impl Streams {
    pub fn new(cells: &[CellInfo], streams: &[StreamInfo]) -> Result<Self, RecordError> {
        let mut by_name = BTreeMap::new();
        for (index, cell) in cells.iter().enumerate() {
            if by_name.insert(cell.name.as_str(), index).is_some() {
                return Err(RecordError::DuplicateCell {
                    cell: cell.name.clone(),
                });
            }
            let joints = cell.joint_names.len();
            let model = cell.model.as_ref().map_or(joints, Model::dof);
            if model != joints {
                return Err(RecordError::ModelJoints {
                    cell: cell.name.clone(),
                    joints,
                    model,
                });
            }
        }
        let mut result = Self {
            cells: cells.to_vec(),
            all: Vec::new(),
            by_stage: BTreeMap::new(),
        };
        for (index, stream) in streams.iter().enumerate() {
            let Some(&cell) = by_name.get(stream.cell.as_str()) else {
                return Err(RecordError::UnknownCell {
                    stage: stream.stage.clone(),
                    cell: stream.cell.clone(),
                    known: list(by_name.keys().copied()),
                });
            };
            if result
                .by_stage
                .insert(stream.stage.clone(), index)
                .is_some()
            {
                return Err(RecordError::DuplicateStream {
                    stage: stream.stage.clone(),
                });
            }
            let rivals = |same: &dyn Fn(&StreamInfo) -> bool| {
                let others = streams
                    .iter()
                    .filter(|s| s.cell == stream.cell && s.kind == stream.kind);
                others.filter(|s| same(s)).count() > 1
            };
            let label = match &stream.detector {
                Some(detector) if !rivals(&|s| s.detector == stream.detector) => detector,
                _ => &stream.stage,
            };
            let base = match stream.kind {
                SampleKind::JointState => "joint_states",
                SampleKind::TwinState => "twin/joint_states",
                SampleKind::Detection => "detections",
                SampleKind::Health => "diagnostics",
            };
            // All detectors of a cell report on one topic.
            let suffix = match stream.kind {
                SampleKind::JointState | SampleKind::TwinState if rivals(&|_| true) => {
                    format!("/{}", stream.stage)
                }
                _ => String::new(),
            };
            let topic = format!("{}/{base}{suffix}", result.prefix(cell));
            let label = label.clone();
            let (stage, kind) = (stream.stage.clone(), stream.kind);
            result.all.push(Stream {
                stage,
                cell,
                kind,
                label,
                score_unit: stream.score_unit.clone(),
                topic,
            });
        }
        Ok(result)
    }

    /// Prefix of a cell's topics: empty, or `/<cell>` if there are several cells.
    pub fn prefix(&self, cell: usize) -> String {
        if self.cells.len() > 1 {
            format!("/{}", self.cells[cell].name)
        } else {
            String::new()
        }
    }

    /// Topic of the residual of a twin's stream.
    pub fn residual_topic(&self, stream: &Stream) -> String {
        let prefix = self.prefix(stream.cell);
        let suffix = stream.topic[prefix.len()..].trim_start_matches("/twin/joint_states");
        format!("{prefix}/residual{suffix}")
    }

    /// Topic of the force that a detector estimates: `/external_wrench` for the cell's first detector, with the label
    /// appended for the others.
    pub fn wrench_topic(&self, stream: &Stream) -> String {
        let mut of_cell = self
            .all
            .iter()
            .filter(|s| s.cell == stream.cell && s.kind == stream.kind);
        let base = format!("{}/external_wrench", self.prefix(stream.cell));
        match of_cell.next() {
            Some(first) if first.stage != stream.stage => format!("{base}/{}", stream.label),
            _ => base,
        }
    }

    /// Returns the index of the stream that a sample of the stage `from` belongs to.
    ///
    /// # Errors
    /// If the stream was not announced, or was announced with another type.
    pub fn find(&self, from: &str, sample: &SampleRef<'_>) -> Result<usize, RecordError> {
        let Some(&index) = self.by_stage.get(from) else {
            return Err(RecordError::UnknownStream {
                stage: from.to_owned(),
                known: list(self.by_stage.keys().map(String::as_str)),
            });
        };
        let stream = &self.all[index];
        let kind = sample.kind();
        if kind == SampleKind::Health {
            return Ok(index);
        }
        if kind != stream.kind {
            let (expected, found) = (stream.kind, kind);
            return Err(RecordError::WrongKind {
                stage: from.to_owned(),
                expected,
                found,
            });
        }
        let cell = &self.cells[stream.cell];
        let (expected, found) = (cell.joint_names.len(), sample.header().joint_count as usize);
        let carries_joints = kind != SampleKind::Detection;
        if carries_joints && (found != expected || found > MAX_JOINTS) {
            let (stage, cell) = (from.to_owned(), cell.name.clone());
            return Err(RecordError::JointCount {
                stage,
                cell,
                expected,
                found,
            });
        }
        Ok(index)
    }
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.map(|name| format!("`{name}`")).collect();
    if names.is_empty() {
        "nothing".to_owned()
    } else {
        names.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use tauscope_bus::{Detection, JointState};

    use super::*;

    fn cell(name: &str) -> CellInfo {
        CellInfo {
            name: name.to_owned(),
            joint_names: vec!["a".to_owned(), "b".to_owned()],
            model: None,
            effort_unit: "Nm".to_owned(),
        }
    }

    fn stream(stage: &str, cell: &str, kind: SampleKind, detector: Option<&str>) -> StreamInfo {
        let detector = detector.map(str::to_owned);
        StreamInfo {
            stage: stage.to_owned(),
            cell: cell.to_owned(),
            kind,
            detector,
            score_unit: String::new(),
        }
    }

    #[test]
    fn topics_are_plain_for_one_cell_and_prefixed_for_two() {
        let one = Streams::new(
            &[cell("x")],
            &[stream("t", "x", SampleKind::TwinState, None)],
        );
        let one = one.unwrap();
        assert_eq!(one.all[0].topic, "/twin/joint_states");
        assert_eq!(one.residual_topic(&one.all[0]), "/residual");
        let two = Streams::new(
            &[cell("x"), cell("y")],
            &[
                stream("t", "x", SampleKind::TwinState, None),
                stream("u", "y", SampleKind::TwinState, None),
                stream("v", "y", SampleKind::TwinState, None),
            ],
        )
        .unwrap();
        assert_eq!(two.all[0].topic, "/x/twin/joint_states");
        assert_eq!(two.all[2].topic, "/y/twin/joint_states/v");
        assert_eq!(two.residual_topic(&two.all[2]), "/y/residual/v");
    }

    #[test]
    fn detectors_go_by_name_unless_two_stages_run_the_same() {
        let streams = Streams::new(
            &[cell("x")],
            &[
                stream("a", "x", SampleKind::Detection, Some("twin_regression")),
                stream("b", "x", SampleKind::Detection, Some("momentum_observer")),
                stream("c", "x", SampleKind::Detection, Some("momentum_observer")),
                stream("d", "x", SampleKind::Detection, None),
            ],
        )
        .unwrap();
        let labels: Vec<_> = streams.all.iter().map(|s| s.label.as_str()).collect();
        assert_eq!(labels, ["twin_regression", "b", "c", "d"]);
        assert!(streams.all.iter().all(|s| s.topic == "/detections"));
        assert_eq!(streams.wrench_topic(&streams.all[0]), "/external_wrench");
        assert_eq!(streams.wrench_topic(&streams.all[2]), "/external_wrench/c");
    }

    #[test]
    fn what_was_not_announced_is_told_with_what_was() {
        let streams = Streams::new(
            &[cell("x")],
            &[stream("ingest", "x", SampleKind::JointState, None)],
        )
        .unwrap();
        let mut sample = JointState::default();
        sample.header.joint_count = 2;
        assert_eq!(
            streams
                .find("ingest", &SampleRef::JointState(&sample))
                .unwrap(),
            0
        );
        let text = |from: &str, sample: SampleRef<'_>| {
            let error = streams.find(from, &sample).unwrap_err();
            error.to_string()
        };
        assert_eq!(
            text("inget", SampleRef::JointState(&sample)),
            "a sample came from stage `inget`, but the recorder listens only to: `ingest`"
        );
        assert_eq!(
            text("ingest", SampleRef::Detection(&Detection::default())),
            "stage `ingest` sent a tauscope/Detection/4, expected a tauscope/JointState/2"
        );
        sample.header.joint_count = 3;
        assert_eq!(
            text("ingest", SampleRef::JointState(&sample)),
            "stage `ingest` sent 3 joints, its cell `x` has 2"
        );
    }
}
