//! What a detector's stream draws: score and threshold, its state as a band, events in words, the
//! touched link's colour and the force.

use rerun::archetypes::{StateConfiguration, TextLog};
use rerun::{EntityPath, TextLogLevel};
use tauscope_bus::{Detection, EventKind, Name, flags};

use super::palette::{CONTACT, LINK, STATES};
use super::robot::Robot;
use super::store::{Out, Store, entity};
use super::tracks::{ForceTrack, RowTrack, ScalarTrack, StateTrack, norm};
use crate::error::RecordError;
use crate::streams::{Stream, Streams};
use crate::words::{Severity, headline, loaded_joints, over};

/// The arrow and the colour follow at most so often \[ns\]: a viewer shows no more.
const FORCE_PERIOD_NS: u64 = 20_000_000;

/// A state that stays is told again after this time \[ns\], for a viewer that came late.
const STATE_PERIOD_NS: u64 = 1_000_000_000;

/// The tracks of one detector.
#[derive(Debug)]
pub(super) struct DetectionTracks {
    score: ScalarTrack,
    threshold: ScalarTrack,
    state: StateTrack,
    events: RowTrack,
    events_entity: EntityPath,
    force: ForceTrack,
    /// State that was told last, and when.
    told: Option<(Name, i64)>,
    /// Stamp of the arrow that is shown now.
    shown_ns: Option<i64>,
}

/// Where a detector's score is drawn.
pub(super) fn score_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "score"])
}

/// Where its threshold is drawn.
pub(super) fn threshold_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "threshold"])
}

/// Where its state is drawn.
pub(super) fn state_entity(stream: &Stream) -> EntityPath {
    entity(&stream.topic, &[&stream.label, "state"])
}

/// Where its events are told.
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
        let wrench = entity(&wrench, &[&stream.label]);
        Robot::prepare_force(
            &streams.cells[stream.cell],
            &streams.prefix(stream.cell),
            &wrench,
            store,
            out,
        )?;
        Ok(Self {
            score: ScalarTrack::new(score_entity(stream), &["score"], store, out)?,
            threshold: ScalarTrack::new(threshold_entity(stream), &["threshold"], store, out)?,
            state: StateTrack::new(state_entity(stream)),
            events: RowTrack::default(),
            events_entity: events_entity(stream),
            force: ForceTrack::new(wrench),
            told: None,
            shown_ns: None,
        })
    }

    /// Takes a detection of the stream number `index`; the recording began at `start_ns`.
    pub fn accept(
        &mut self,
        detection: &Detection,
        index: usize,
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
        let before = self.told.map(|(state, _)| state).unwrap_or_default();
        let as_told = |(state, told_ns): (Name, i64)| {
            state == detection.state && header.stamp_ns.abs_diff(told_ns) < STATE_PERIOD_NS
        };
        if !self.told.is_some_and(as_told) {
            self.told = Some((detection.state, header.stamp_ns));
            self.state.push(header, detection.state.as_str());
        }
        if detection.event() != EventKind::None {
            self.tell(detection, &before, start_ns, joints, store)?;
        }
        self.draw_force(detection);
        if let Some(robot) = robot {
            let touched = detection.alarm().then_some(detection.link.as_str());
            robot.touch(header, index, touched);
        }
        Ok(())
    }

    fn draw_force(&mut self, detection: &Detection) {
        let header = &detection.header;
        let force = header
            .has(flags::FORCE)
            .then_some((detection.force_n, detection.point_m));
        match (force, self.shown_ns) {
            (None, None) => {}
            (None, Some(_)) => {
                self.force.push(header, None);
                self.shown_ns = None;
            }
            (Some(_), Some(shown)) if header.stamp_ns.abs_diff(shown) < FORCE_PERIOD_NS => {}
            (Some(_), _) => {
                self.force.push(header, force);
                self.shown_ns = Some(header.stamp_ns);
            }
        }
    }

    fn tell(
        &mut self,
        detection: &Detection,
        before: &Name,
        start_ns: i64,
        joints: &[String],
        store: &Store,
    ) -> Result<(), RecordError> {
        let header = &detection.header;
        let ended = detection.event() == EventKind::Offset;
        let what = if ended {
            over(before).to_owned()
        } else {
            headline(detection)
        };
        let mut parts = vec![format!(
            "{:.2} s: {what}",
            (header.stamp_ns - start_ns) as f64 * 1e-9
        )];
        let joints = loaded_joints(detection, joints);
        if !joints.is_empty() {
            parts.push(format!("seen by {}", joints.join(", ")));
        }
        if header.has(flags::FORCE) {
            parts.push(format!("{:.0} N", norm(detection.force_n)));
        }
        let level = match Severity::of(detection) {
            _ if ended => TextLogLevel::INFO,
            Severity::Collision => TextLogLevel::ERROR,
            _ => TextLogLevel::WARN,
        };
        let colour = if detection.alarm() { CONTACT } else { LINK };
        let text = TextLog::new(parts.join(", "))
            .with_level(level)
            .with_color(colour);
        self.events.push(store, header, &self.events_entity, &text)
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        self.score.flush(store, out)?;
        self.threshold.flush(store, out)?;
        self.state.flush(store, out)?;
        self.force.flush(store, out)?;
        self.events.flush(out)
    }
}
