//! The picture of an explanation: measured effort with the twin's effort before and after correction, the findings in
//! words, and the times of temporary effects.
//!
//! For each recording and joint there are the entities `<recording>/<joint>/effort` (series measured, twin,
//! corrected) and `<recording>/<joint>/residual` (before, after). Events are `<recording>/events/<number>`, with
//! their text in `<recording>/log`. The robot of the first recording is `robot/<link>`, moved by `transforms`. The
//! text is `explanation`. All use the importer's timelines, and `recording_time`, which starts at zero in each
//! recording, so that recordings can be overlaid. The uncorrected simulation under the same commands, if there is one, is
//! `uncorrected/robot/<link>`.

use std::path::Path;

use rerun::archetypes::{
    Scalars, SeriesLines, StateChange, StateConfiguration, TextDocument, TextLog,
};
use rerun::components::MediaType;
use rerun::{
    ApplicationId, EntityPath, Rgba32, StoreId, StoreKind, TextLogLevel, TimeColumn, TimePoint,
    Timeline,
};

use tauscope_archive::whole_file::Existing;
use tauscope_bus::{Header, MAX_JOINTS};
use tauscope_dynamics::Model;

use super::blueprint::explanation::messages;
use super::file::PictureFile;
use super::palette::{CORRECTED, EVENT, EXPECTED, MEASURED, QUIET};
use super::robot::Robot;
use super::store::{Store, entity, unserializable};
use super::tracks::{LOG_TIME, PUBLISH_TIME, STAMP, Times};
use crate::error::RecordError;

/// Parent entity of the uncorrected simulation.
pub(super) const GHOST: &str = "uncorrected";

/// Initial timeline of the picture: seconds from the start of each recording.
pub(super) const RECORDING_TIME: &str = "recording_time";

/// Content of the picture of an explanation.
#[derive(Debug, Clone, Default)]
pub struct Explanation {
    /// Name of the case.
    pub case: String,
    /// Unit of the efforts, `Nm` or `A`.
    pub effort_unit: String,
    /// Verdict and findings, in Markdown.
    pub text_markdown: String,
    /// The recordings, in the order of display.
    pub recordings: Vec<ExplainedRecording>,
    /// Effects that are temporary or begin at some time.
    pub events: Vec<ExplainedEvent>,
    /// The robot, if there is one.
    pub robot: Option<ExplainedRobot>,
}

/// The robot in the picture of an explanation.
#[derive(Debug, Clone)]
pub struct ExplainedRobot {
    /// Model of the robot; its joints are those of each recording.
    pub model: Model,
    /// The links with findings.
    pub found: Vec<String>,
    /// Motion of the uncorrected simulation in the first recording: for each joint, a position for each of its samples
    /// \[rad or m\]. Empty if it was not simulated.
    pub ghost: Vec<Vec<f64>>,
}

/// A recording in the picture of an explanation.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExplainedRecording {
    /// Its unique name.
    pub name: String,
    /// Whether it was held out from the fit.
    pub held_out: bool,
    /// Stamp of its first sample \[ns since the epoch\].
    pub start_ns: i64,
    /// Its joints, in the order of the plots.
    pub joints: Vec<ExplainedJoint>,
}

/// A joint's efforts in a recording, with the same number of samples; surplus samples of a series are not drawn.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExplainedJoint {
    /// Its name.
    pub name: String,
    /// Time since the recording's first sample \[s\].
    pub time_s: Vec<f64>,
    /// Position \[rad or m\].
    pub position: Vec<f64>,
    /// Measured effort \[effort unit\].
    pub measured: Vec<f64>,
    /// Effort of the twin before correction \[effort unit\].
    pub twin: Vec<f64>,
    /// Effort of the corrected twin \[effort unit\].
    pub corrected: Vec<f64>,
}

/// A finding with a time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExplainedEvent {
    /// The recording; all recordings if absent.
    pub recording: Option<String>,
    /// Beginning, relative to the recording's first sample \[s\].
    pub start_s: f64,
    /// End, relative to the recording's first sample; the end of the recording if absent \[s\].
    pub end_s: Option<f64>,
    /// Short label.
    pub label: String,
    /// Description in a sentence.
    pub sentence: String,
}

/// Writes the picture with its layout to a Rerun file, whose name ends with `.part` until it is complete.
///
/// # Errors
///
/// If the file cannot be written or Rerun cannot encode the data.
pub fn write_explanation(path: &Path, explanation: &Explanation) -> Result<(), RecordError> {
    // The caller has checked that the existing file may be replaced.
    let mut file = PictureFile::create(path, Existing::Replace)?;
    // The viewer stores one layout per application, so each case is an application.
    let application =
        ApplicationId::new_or_unknown(format!("tauscope explain {}", explanation.case));
    let store = Store {
        id: StoreId::random(StoreKind::Recording, application.clone()),
    };
    file.write(&store.announcement())?;
    let robot = explanation.draw_robot(&store, &mut file)?;
    for message in messages(explanation, robot.as_ref(), &application)? {
        file.write(&message)?;
    }
    let text = TextDocument::new(explanation.text_markdown.as_str())
        .with_media_type(MediaType::markdown());
    file.write(&store.always(&text_entity(), &text)?)?;
    for recording in &explanation.recordings {
        for joint in &recording.joints {
            joint.write(recording, &store, &mut file)?;
        }
        for (number, event) in events_of(explanation, recording) {
            event.write(number, recording, &store, &mut file)?;
        }
    }
    file.finish().map(drop)
}

impl Explanation {
    /// Draws the robot with the motion of the first recording.
    fn draw_robot(
        &self,
        store: &Store,
        file: &mut PictureFile,
    ) -> Result<Option<Robot>, RecordError> {
        let (Some(drawn), Some(recording)) = (&self.robot, self.recordings.first()) else {
            return Ok(None);
        };
        let dof = drawn.model.dof();
        if dof == 0 || dof > MAX_JOINTS || recording.joints.len() != dof {
            return Ok(None);
        }
        let times = || Times::since(RECORDING_TIME, recording.start_ns);
        let mut write = |message| file.write(&message);
        let mut robot = Robot::new(&drawn.model, "", times, store, &mut write)?;
        for link in &drawn.found {
            robot.paint(link, EVENT);
        }
        let joints = recording.joints.iter();
        let measured: Vec<&[f64]> = joints.map(|joint| &joint.position[..]).collect();
        recording.pose(&mut robot, &measured);
        if drawn.ghost.len() == dof {
            let mut ghost = robot.beside(GHOST, times, store, &mut write)?;
            ghost.paint_all(EXPECTED);
            let simulated: Vec<&[f64]> = drawn.ghost.iter().map(|joint| &joint[..]).collect();
            recording.pose(&mut ghost, &simulated);
            ghost.flush(store, &mut write)?;
        }
        robot.flush(store, &mut write)?;
        Ok(Some(robot))
    }
}

/// Entity of the text.
pub(super) fn text_entity() -> EntityPath {
    entity("explanation", &[])
}

/// Entity of a joint's efforts.
pub(super) fn effort_entity(recording: &str, joint: &str) -> EntityPath {
    entity("", &[recording, joint, "effort"])
}

/// Entity of a joint's residuals.
pub(super) fn residual_entity(recording: &str, joint: &str) -> EntityPath {
    entity("", &[recording, joint, "residual"])
}

/// Entity of an event.
pub(super) fn event_entity(recording: &str, number: usize) -> EntityPath {
    entity("", &[recording, "events", &number.to_string()])
}

/// Entity of a recording's event log.
pub(super) fn log_entity(recording: &str) -> EntityPath {
    entity("", &[recording, "log"])
}

/// Events of a recording with their numbers.
pub(super) fn events_of<'a>(
    explanation: &'a Explanation,
    recording: &'a ExplainedRecording,
) -> impl Iterator<Item = (usize, &'a ExplainedEvent)> {
    let here = |event: &ExplainedEvent| match &event.recording {
        Some(name) => *name == recording.name,
        None => true,
    };
    explanation
        .events
        .iter()
        .enumerate()
        .filter(move |(_, event)| here(event) && event.start_s.is_finite())
}

impl ExplainedRecording {
    /// Moves a robot by positions, joint by joint, at the times of the recording.
    fn pose(&self, robot: &mut Robot, joints: &[&[f64]]) {
        for (row, time_s) in self.joints[0].time_s.iter().enumerate() {
            let mut position = [0.0; MAX_JOINTS];
            for (to, joint) in position.iter_mut().zip(joints) {
                *to = joint.get(row).copied().unwrap_or(f64::NAN);
            }
            if !(time_s.is_finite() && position.iter().all(|q| q.is_finite())) {
                continue;
            }
            let stamp_ns = self.start_ns.saturating_add(nanos(*time_s));
            let header = Header {
                stamp_ns,
                received_ns: stamp_ns,
                ..Header::default()
            };
            robot.pose(&header, &position);
        }
    }

    /// Time of the last sample \[s\].
    fn end_s(&self) -> f64 {
        let times = self.joints.iter().flat_map(|joint| &joint.time_s);
        times.copied().filter(|t| t.is_finite()).fold(0.0, f64::max)
    }
}

impl ExplainedJoint {
    /// Symmetric range of a residual plot \[effort unit\], at least a twentieth of the effort, so that noise is not
    /// magnified.
    pub(super) fn residual_range(&self) -> Option<f64> {
        let residuals = |twin: &[f64]| -> f64 {
            let residuals = self.measured.iter().zip(twin).map(|(m, e)| (m - e).abs());
            residuals.filter(|r| r.is_finite()).fold(0.0, f64::max)
        };
        let efforts = self.measured.iter().map(|m| m.abs());
        let effort = efforts.filter(|m| m.is_finite()).fold(0.0, f64::max);
        let residual = residuals(&self.twin).max(residuals(&self.corrected));
        let half = (1.08 * residual).max(0.05 * effort);
        (half > 0.0).then_some(half)
    }

    fn write(
        &self,
        recording: &ExplainedRecording,
        store: &Store,
        file: &mut PictureFile,
    ) -> Result<(), RecordError> {
        let series = self.measured.iter().zip(&self.twin).zip(&self.corrected);
        let rows: Vec<(i64, [f64; 3])> = self
            .time_s
            .iter()
            .zip(series)
            .filter(|(t, _)| t.is_finite())
            .map(|(t, ((measured, twin), corrected))| (nanos(*t), [*measured, *twin, *corrected]))
            .collect();
        let times_ns: Vec<i64> = rows.iter().map(|(t_ns, _)| *t_ns).collect();
        let efforts: Vec<f64> = rows.iter().flat_map(|(_, efforts)| *efforts).collect();
        let residuals: Vec<f64> = rows
            .iter()
            .flat_map(|(_, [measured, twin, corrected])| [measured - twin, measured - corrected])
            .collect();
        let effort_series: &[Series] = &[
            ("measured", MEASURED, 4.0),
            ("twin", EXPECTED, 1.5),
            ("corrected", CORRECTED, 1.5),
        ];
        let residual_series: &[Series] = &[("before", EXPECTED, 1.5), ("after", CORRECTED, 1.5)];
        let effort = effort_entity(&recording.name, &self.name);
        let residual = residual_entity(&recording.name, &self.name);
        for (entity, series, values) in [
            (effort, effort_series, efforts),
            (residual, residual_series, residuals),
        ] {
            file.write(&store.always(&entity, &lines(series))?)?;
            if times_ns.is_empty() {
                continue;
            }
            let columns = Scalars::new(values)
                .columns(std::iter::repeat_n(series.len(), times_ns.len()))
                .map_err(unserializable(&entity))?;
            file.write(&store.columns(&entity, times(recording, &times_ns), columns)?)?;
        }
        Ok(())
    }
}

/// Name, colour and width of a line.
type Series = (&'static str, Rgba32, f32);

fn lines(series: &[Series]) -> SeriesLines {
    SeriesLines::new()
        .with_names(series.iter().map(|(name, ..)| *name))
        .with_colors(series.iter().map(|(_, colour, _)| *colour))
        .with_widths(series.iter().map(|(.., width)| *width))
}

impl ExplainedEvent {
    /// Writes the event as a band, and as a text at its beginning.
    fn write(
        &self,
        number: usize,
        recording: &ExplainedRecording,
        store: &Store,
        file: &mut PictureFile,
    ) -> Result<(), RecordError> {
        const QUIETLY: &str = "-";
        let entity = event_entity(&recording.name, number);
        let looks = StateConfiguration::new()
            .with_values([QUIETLY, &self.label])
            .with_labels(["", &self.label])
            .with_colors([QUIET, EVENT]);
        file.write(&store.always(&entity, &looks)?)?;
        let end_s = recording.end_s();
        let start_s = self.start_s.clamp(0.0, end_s);
        let stop_s = self.end_s.filter(|t| t.is_finite()).unwrap_or(end_s);
        let mut states = vec![(start_s, self.label.as_str())];
        if start_s > 0.0 {
            states.insert(0, (0.0, QUIETLY));
        }
        if stop_s < end_s {
            states.push((stop_s.max(start_s), QUIETLY));
        }
        let times_ns: Vec<i64> = states.iter().map(|(t, _)| nanos(*t)).collect();
        let columns = StateChange::new()
            .with_state(states.into_iter().map(|(_, state)| state))
            .columns_of_unit_batches()
            .map_err(unserializable(&entity))?;
        file.write(&store.columns(&entity, times(recording, &times_ns), columns)?)?;
        let words = format!("{}, {start_s:.2} s: {}", recording.name, self.sentence);
        let told = TextLog::new(words).with_level(TextLogLevel::INFO);
        let when = time_point(recording, nanos(start_s));
        file.write(&store.at(when, &log_entity(&recording.name), &told)?)
    }
}

fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

fn times(recording: &ExplainedRecording, times_ns: &[i64]) -> [TimeColumn; 4] {
    let stamp = |name| {
        let stamps = times_ns
            .iter()
            .map(|t| recording.start_ns.saturating_add(*t));
        TimeColumn::new_timestamp_nanos_since_epoch(name, stamps)
    };
    [
        stamp(LOG_TIME),
        stamp(PUBLISH_TIME),
        stamp(STAMP),
        TimeColumn::new_duration_nanos(RECORDING_TIME, times_ns.iter().copied()),
    ]
}

fn time_point(recording: &ExplainedRecording, t_ns: i64) -> TimePoint {
    let stamp_ns = recording.start_ns.saturating_add(t_ns);
    [LOG_TIME, PUBLISH_TIME, STAMP]
        .into_iter()
        .fold(TimePoint::default(), |point, name| {
            point.with(Timeline::new_timestamp(name), stamp_ns)
        })
        .with(Timeline::new_duration(RECORDING_TIME), t_ns)
}
