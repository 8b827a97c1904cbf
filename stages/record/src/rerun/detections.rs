//! Entities of a detector's stream: score and threshold, its state as a band, events in words, the colour of the
//! touched link, and the force. Arrow and colour show the estimate so far: force and link of the sample with the
//! largest score. At the end of the contact they agree with the text.
//!
//! If the detector reports them, there are also the frequency content of the force, with the state as background, and
//! the directions of force and motion. See figures 1 and 2 of Salt Ducaju et al., "Fast Contact Detection and
//! Classification for Kinesthetic Teaching in Robots using only Embedded Sensors", 2022.

use rerun::archetypes::{StateConfiguration, TextLog};
use rerun::{EntityPath, Rgba32, TextLogLevel};
use tauscope_bus::{Contact, Detection, EventKind, Name, flags};

use super::palette::{CONTACT, LINK, MOTION, RISE, STATES};
use super::robot::Robot;
use super::store::{Out, Store, entity};
use super::tracks::{Arrow, ArrowTrack, BandTrack, RowTrack, ScalarTrack, StateTrack};
use crate::contacts::Told;
use crate::error::RecordError;
use crate::streams::{Stream, Streams};
use crate::words::{Severity, headline, loaded_joints, over};

/// Scale of force arrows \[m/N\]: a metre for 100 N, so that a push by hand is as long as a forearm.
/// Layout: by eye; no number depends on it.
const M_PER_N: f64 = 0.01;
/// Length of a direction arrow \[m\].
/// Layout: by eye; no number depends on it.
const DIRECTION_M: f64 = 0.3;

/// Repetition period of an unchanged state, for viewers that connect later \[ns\].
/// Resolution: size of the stream, against the waiting time of such a viewer.
const STATE_PERIOD_NS: u64 = 1_000_000_000;

/// The tracks of one detector.
#[derive(Debug)]
pub(super) struct DetectionTracks {
    score: ScalarTrack,
    threshold: ScalarTrack,
    state: StateTrack,
    events: RowTrack,
    events_entity: EntityPath,
    force: ArrowTrack,
    directions: ArrowTrack,
    /// Frequency content; present from the first sample that has it.
    content: Option<Content>,
    /// State and stamp of the last state row \[ns\].
    told: Option<(Name, i64)>,
    /// End point of the force arrow, which moves with the touched link \[m\].
    arrow_m: Option<[f64; 3]>,
    newest_threshold: Option<f64>,
}

/// The frequency content of the force, with the states as background.
#[derive(Debug)]
struct Content {
    norms: ScalarTrack,
    bands: BandTrack,
}

impl Content {
    fn new(stream: &Stream, store: &Store, out: &mut Out<'_>) -> Result<Self, RecordError> {
        let bands = content_entity(stream).join(&EntityPath::from_single_string("bands"));
        Ok(Self {
            norms: ScalarTrack::new(norms_entity(stream), &["x", "y", "z"], store, out)?,
            bands: BandTrack::new(bands, "state", store, out)?,
        })
    }

    fn push(&mut self, detection: &Detection) {
        self.norms.push(&detection.header, &detection.content_n);
        let state = detection.state.as_str();
        let known = STATES.iter().find(|(value, ..)| *value == state);
        let colour = known.map_or(LINK, |(.., colour)| *colour);
        self.bands.push(&detection.header, colour);
    }

    fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        self.bands.flush(store, out)?;
        self.norms.flush(store, out)
    }
}

/// Entity of a detector's score.
pub(super) fn score_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "score"])
}

/// Entity of a detector's threshold.
pub(super) fn threshold_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "threshold"])
}

/// Parent entity of the force's frequency content and of the states behind it.
pub(super) fn content_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "content"])
}

/// Entity of the content by direction. The viewer draws in the order of names, so it is in front of the bands.
pub(super) fn norms_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "content", "norms"])
}

/// Entity of a detector's state.
pub(super) fn state_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "state"])
}

/// Entity of a detector's event log.
pub(super) fn events_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "events"])
}

impl DetectionTracks {
    pub fn new(
        streams: &Streams,
        stream: &Stream,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        let states = StateConfiguration::new()
            .with_values(STATES.map(|(value, _, _)| value))
            .with_labels(STATES.map(|(_, label, _)| label))
            .with_colors(STATES.map(|(_, _, color)| color));
        out(store.always(&state_entity(stream), &states)?)?;
        let wrench = format!("{}/external_wrench", streams.prefix(stream.cell));
        let (force, directions) = (
            entity(&wrench, &[&stream.label]),
            entity(&wrench, &[&stream.label, "directions"]),
        );
        let cell = &streams.cells[stream.cell];
        let prefix = streams.prefix(stream.cell);
        Robot::prepare_arrows(cell, &prefix, &force, &[CONTACT], store, out)?;
        Robot::prepare_arrows(cell, &prefix, &directions, &[RISE, MOTION], store, out)?;
        Ok(Self {
            score: ScalarTrack::new(score_entity(stream), &["score"], store, out)?,
            threshold: ScalarTrack::new(threshold_entity(stream), &["threshold"], store, out)?,
            state: StateTrack::new(state_entity(stream)),
            events: RowTrack::default(),
            events_entity: events_entity(stream),
            force: ArrowTrack::new(force),
            directions: ArrowTrack::new(directions),
            content: None,
            newest_threshold: None,
            told: None,
            arrow_m: None,
        })
    }

    /// The latest threshold.
    pub fn newest_threshold(&self) -> Option<f64> {
        self.newest_threshold
    }

    /// Whether the detector reports the frequency content of the force.
    pub fn has_content(&self) -> bool {
        self.content.is_some()
    }

    /// Adds a detection of the stream number `index`; the recording began at `start_ns`.
    pub fn accept(
        &mut self,
        (detection, told): (&Detection, &Told<'_>),
        (index, stream): (usize, &Stream),
        start_ns: i64,
        joints: &[String],
        robot: Option<&mut Robot>,
        store: &Store,
    ) -> Result<(), RecordError> {
        let header = &detection.header;
        if header.has(flags::READY) {
            self.score.push(header, &[detection.score]);
        }
        self.threshold.push(header, &[detection.threshold]);
        self.newest_threshold = Some(detection.threshold);
        let as_told = |(state, told_ns): (Name, i64)| {
            state == detection.state && header.stamp_ns.abs_diff(told_ns) < STATE_PERIOD_NS
        };
        if !self.told.is_some_and(as_told) {
            self.told = Some((detection.state, header.stamp_ns));
            self.state.push(header, detection.state.as_str());
        }
        let seconds = (header.stamp_ns - start_ns) as f64 * 1e-9;
        if let Some(ended) = &told.ended {
            self.tell_end(ended, seconds, detection, joints, store)?;
        }
        if let Some(open) = told.open.filter(|_| detection.event() == EventKind::Onset) {
            self.tell_onset(open, seconds, detection, joints, store)?;
        }
        self.draw_arrows(detection, told.open);
        if header.has(flags::CONTENT) {
            if self.content.is_none() {
                let mut keep = |message| {
                    self.events.push_message(message);
                    Ok(())
                };
                self.content = Some(Content::new(stream, store, &mut keep)?);
            }
            if let Some(content) = &mut self.content {
                content.push(detection);
            }
        }
        if let Some(robot) = robot {
            robot.touch(header, index, told.open.map(|open| open.link.as_str()));
        }
        Ok(())
    }

    fn draw_arrows(&mut self, detection: &Detection, open: Option<&Contact>) {
        let header = &detection.header;
        let point_m = detection.point_m;
        // The force arrow ends at the point of application; the direction arrows begin there.
        let force = open.and_then(|open| Some((open, open.peak()?)));
        self.arrow_m = force.map(|(open, peak)| {
            let is_there = header.has(flags::FORCE) && detection.link == open.link;
            let now_m = is_there.then_some(point_m);
            now_m.or(self.arrow_m).unwrap_or(peak.point_m)
        });
        let force = force.zip(self.arrow_m).map(|((open, peak), end_m)| {
            let vector_m = peak.force_n.map(|newton| newton * M_PER_N);
            [Arrow {
                origin_m: std::array::from_fn(|i| end_m[i] - vector_m[i]),
                vector_m,
                label: open.to_string(),
            }]
        });
        self.force.push(header, force);
        let both = header.has(flags::FORCE | flags::DIRECTIONS);
        let directions = both.then(|| {
            let named = [
                (detection.rise_direction, "force rose"),
                (detection.motion_direction, "tool moved"),
            ];
            named.map(|(direction, label)| Arrow {
                origin_m: point_m,
                vector_m: direction.map(|share| share * DIRECTION_M),
                label: label.to_owned(),
            })
        });
        self.directions.push(header, directions);
    }

    fn tell_onset(
        &mut self,
        open: &Contact,
        seconds: f64,
        detection: &Detection,
        joints: &[String],
        store: &Store,
    ) -> Result<(), RecordError> {
        let mut text = format!("{seconds:.2} s: {}", headline(detection));
        // A watch reports a change of the arm only when its estimate is final.
        if open.size.is_none() {
            let force = open.peak().map(|peak| format!(": {:.0} N", peak.norm_n()));
            text += &format!(" (first guess{})", force.unwrap_or_default());
        }
        let level = match Severity::of(detection) {
            Severity::Collision => TextLogLevel::ERROR,
            _ => TextLogLevel::WARN,
        };
        let text = text + &seen_by(open, joints);
        self.add_text(text, level, CONTACT, detection, store)
    }

    fn tell_end(
        &mut self,
        ended: &Contact,
        seconds: f64,
        detection: &Detection,
        joints: &[String],
        store: &Store,
    ) -> Result<(), RecordError> {
        let text = format!("{seconds:.2} s: {}{}", over(ended), seen_by(ended, joints));
        self.add_text(text, TextLogLevel::INFO, LINK, detection, store)
    }

    fn add_text(
        &mut self,
        text: String,
        level: &str,
        colour: Rgba32,
        detection: &Detection,
        store: &Store,
    ) -> Result<(), RecordError> {
        let text = TextLog::new(text).with_level(level).with_color(colour);
        self.events
            .push(store, &detection.header, &self.events_entity, &text)
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        self.score.flush(store, out)?;
        self.threshold.flush(store, out)?;
        self.state.flush(store, out)?;
        self.force.flush(store, out)?;
        self.directions.flush(store, out)?;
        // The rows of events also include the styles of the content.
        self.events.flush(out)?;
        match &mut self.content {
            Some(content) => content.flush(store, out),
            None => Ok(()),
        }
    }
}

/// The joints that detected a contact, as the end of a sentence.
fn seen_by(contact: &Contact, joints: &[String]) -> String {
    let joints = loaded_joints(contact.joints, joints);
    if joints.is_empty() {
        return String::new();
    }
    format!(", seen by {}", joints.join(", "))
}
