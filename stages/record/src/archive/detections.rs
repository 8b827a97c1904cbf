//! A detector's stream in the archive.

use tauscope_archive::ros::{self, DiagnosticArray, Float64, Level, Wrench, WrenchStamped};
use tauscope_archive::{TopicWriter, WriteError};
use tauscope_bus::{Contact, Detection, EventKind, Force, Name, flags};

use super::File;
use super::joints::status;
use crate::contacts::Told;
use crate::streams::{Stream, Streams};
use crate::words::{Severity, headline, loaded_joints, over};

/// The topics of a detector.
pub(super) struct DetectionTopics {
    events: TopicWriter<DiagnosticArray>,
    score: TopicWriter<Float64>,
    threshold: TopicWriter<Float64>,
    wrench: Option<TopicWriter<WrenchStamped>>,
    wrench_name: String,
    frame: String,
    /// State and alarm of the last message.
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
        (detection, told): (&Detection, &Told<'_>),
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
            let teller = Teller {
                detection,
                label: &stream.label,
                cell: &cell.name,
                joints: &cell.joint_names,
                muted: told.muted,
            };
            let ended = told.ended.as_ref().map(|ended| teller.end(ended));
            let now = (ended.is_none() || detection.event() == EventKind::Onset)
                .then(|| teller.now(told.open));
            let array = DiagnosticArray {
                header: ros::Header::new(header.stamp_ns, ""),
                status: ended.into_iter().chain(now).collect(),
            };
            file.write(self.events, header, &array)?;
        }
        Ok(())
    }
}

/// Formatter of status messages about events and states.
struct Teller<'a> {
    detection: &'a Detection,
    label: &'a str,
    cell: &'a str,
    joints: &'a [String],
    muted: bool,
}

type Values = Vec<(&'static str, String)>;

impl Teller<'_> {
    /// Status from now on; for the onset of a contact, its first estimate.
    fn now(&self, open: Option<&Contact>) -> ros::DiagnosticStatus {
        let level = match Severity::of(self.detection) {
            Severity::Ok => Level::Ok,
            Severity::Contact => Level::Warn,
            Severity::Collision => Level::Error,
            Severity::NotReady => Level::Stale,
        };
        let kind = match self.detection.event() {
            EventKind::Onset => "onset",
            EventKind::Offset => "offset",
            EventKind::None => "state",
        };
        let mut values = self.values(kind);
        let mut message = headline(self.detection);
        if let Some(open) = open.filter(|_| self.detection.alarm()) {
            // A watch reports a change of the arm only when its estimate is final.
            if open.size.is_none() {
                message += " (first guess)";
                values.push(("estimate", "provisional".to_owned()));
            }
            self.add_contact(open, "force_n", &mut values);
        }
        status(level, self.label, message, self.cell, values)
    }

    /// Status at the end of a contact, with its final estimate.
    fn end(&self, ended: &Contact) -> ros::DiagnosticStatus {
        let mut values = self.values("offset");
        values.push(("estimate", "final".to_owned()));
        self.add_contact(ended, "peak_force_n", &mut values);
        values.push(("duration_s", ended.duration_s().to_string()));
        let level = if self.detection.state.as_str() == "not_ready" {
            Level::Stale
        } else {
            Level::Ok
        };
        status(level, self.label, over(ended), self.cell, values)
    }

    fn values(&self, event: &str) -> Values {
        let detection = self.detection;
        let mut values = vec![
            ("event", event.to_owned()),
            ("detector", detection.detector.to_string()),
            ("state", detection.state.to_string()),
            ("score", detection.score.to_string()),
            ("threshold", detection.threshold.to_string()),
        ];
        if self.muted {
            values.push(("muted", "true".to_owned()));
        }
        values
    }

    fn add_contact(&self, contact: &Contact, force_key: &'static str, values: &mut Values) {
        values.push(("kind", contact.kind.to_string()));
        values.push(("t_contact_s", seconds(contact.contact_ns)));
        values.push((
            "joints",
            loaded_joints(contact.joints, self.joints).join(" "),
        ));
        if !contact.link.as_str().is_empty() {
            values.push(("link", contact.link.to_string()));
        }
        if !contact.other_link.as_str().is_empty() {
            values.push(("other_link", contact.other_link.to_string()));
        }
        if let Some(size) = contact.size {
            values.push(("size", size.to_string()));
        }
        if let Some(force) = contact.peak() {
            values.push((force_key, force.norm_n().to_string()));
            values.extend(places(force));
        }
    }
}

/// Direction and point of application of a force, one number per key.
fn places(force: &Force) -> impl Iterator<Item = (&'static str, String)> {
    let directions = ["direction_x", "direction_y", "direction_z"];
    let points = ["point_x_m", "point_y_m", "point_z_m"];
    let values = directions.into_iter().zip(force.direction());
    let values = values.chain(points.into_iter().zip(force.point_m));
    values.map(|(key, value)| (key, value.to_string()))
}

/// Seconds since the epoch, with nanosecond digits.
fn seconds(ns: i64) -> String {
    let time = ros::Time::from_ns(ns);
    format!("{}.{:09}", time.sec, time.nanosec)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
