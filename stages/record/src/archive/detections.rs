//! A detector's stream in the archive.

use tauscope_archive::ros::{self, DiagnosticArray, Float64, Level, Wrench, WrenchStamped};
use tauscope_archive::{TopicWriter, WriteError};
use tauscope_bus::{Detection, EventKind, Name, flags};

use super::File;
use super::joints::status;
use crate::streams::{Stream, Streams};
use crate::words::{Severity, headline, loaded_joints};

/// The topics of a detector.
pub(super) struct DetectionTopics {
    events: TopicWriter<DiagnosticArray>,
    score: TopicWriter<Float64>,
    threshold: TopicWriter<Float64>,
    wrench: Option<TopicWriter<WrenchStamped>>,
    wrench_name: String,
    frame: String,
    /// State and alarm that were written last.
    previous: Option<(Name, bool)>,
    threshold_before: Option<f64>,
}

impl DetectionTopics {
    pub fn new(
        file: &mut File,
        streams: &Streams,
        stream: &Stream,
        events: TopicWriter<DiagnosticArray>,
    ) -> Result<Self, WriteError> {
        let base = format!("{}/{}", stream.topic, stream.label);
        Ok(Self {
            events,
            score: file.add(&format!("{base}/score"))?,
            threshold: file.add(&format!("{base}/threshold"))?,
            wrench: None,
            wrench_name: streams.wrench_topic(stream),
            frame: streams.cells[stream.cell].root().to_owned(),
            previous: None,
            threshold_before: None,
        })
    }

    pub fn write(
        &mut self,
        file: &mut File,
        streams: &Streams,
        stream: &Stream,
        detection: &Detection,
    ) -> Result<(), WriteError> {
        let header = &detection.header;
        if header.has(flags::READY) {
            file.write(
                self.score,
                header,
                &Float64 {
                    data: detection.score,
                },
            )?;
        }
        if self.threshold_before != Some(detection.threshold) {
            self.threshold_before = Some(detection.threshold);
            file.write(
                self.threshold,
                header,
                &Float64 {
                    data: detection.threshold,
                },
            )?;
        }
        if header.has(flags::FORCE) {
            let message = WrenchStamped {
                header: ros::Header::new(header.stamp_ns, &self.frame),
                wrench: Wrench {
                    force: detection.force_n.into(),
                    torque: cross(detection.point_m, detection.force_n).into(),
                },
            };
            file.write_late(
                &mut self.wrench,
                || self.wrench_name.clone(),
                header,
                &message,
            )?;
        }
        let now = Some((detection.state, detection.alarm()));
        if now != self.previous || detection.event() != EventKind::None {
            self.previous = now;
            let cell = &streams.cells[stream.cell];
            let array = DiagnosticArray {
                header: ros::Header::new(header.stamp_ns, ""),
                status: vec![event(detection, stream, &cell.name, &cell.joint_names)],
            };
            file.write(self.events, header, &array)?;
        }
        Ok(())
    }
}

/// What began, ended or changed.
fn event(
    detection: &Detection,
    stream: &Stream,
    cell: &str,
    joints: &[String],
) -> ros::DiagnosticStatus {
    let level = match Severity::of(detection) {
        Severity::Ok => Level::Ok,
        Severity::Contact => Level::Warn,
        Severity::Collision => Level::Error,
        Severity::NotReady => Level::Stale,
    };
    let kind = match detection.event() {
        EventKind::Onset => "onset",
        EventKind::Offset => "offset",
        EventKind::None => "state",
    };
    let mut values = vec![
        ("event", kind.to_owned()),
        ("detector", detection.detector.to_string()),
        ("state", detection.state.to_string()),
        ("score", detection.score.to_string()),
        ("threshold", detection.threshold.to_string()),
    ];
    if detection.alarm() {
        values.push(("t_contact", seconds(detection.contact_ns)));
        values.push(("joints", loaded_joints(detection, joints).join(" ")));
        if !detection.link.as_str().is_empty() {
            values.push(("link", detection.link.to_string()));
        }
        if detection.header.has(flags::CHANGE) {
            values.push(("size", detection.size.to_string()));
        }
    }
    if detection.header.has(flags::FORCE) {
        values.push(("force_n", triple(detection.force_n)));
        values.push(("point_m", triple(detection.point_m)));
    }
    status(level, &stream.label, headline(detection), cell, values)
}

/// Seconds since the epoch, with all nanoseconds.
fn seconds(ns: i64) -> String {
    let time = ros::Time::from_ns(ns);
    format!("{}.{:09}", time.sec, time.nanosec)
}

fn triple([x, y, z]: [f64; 3]) -> String {
    format!("{x} {y} {z}")
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
