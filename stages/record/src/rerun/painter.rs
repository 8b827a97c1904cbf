//! Conversion of samples to the messages of a Rerun store.

use rerun::archetypes::TextLog;
use rerun::{ApplicationId, EntityPath, StoreId, StoreKind, TextLogLevel};
use tauscope_bus::{Health, JointState, SampleKind, SampleRef, TwinState, flags};

use super::detections::DetectionTracks;
use super::robot::Robot;
use super::store::{Out, Store, entity};
use super::tracks::{RowTrack, ScalarTrack, Times};
use crate::contacts::Told;
use crate::error::RecordError;
use crate::streams::{Stream, Streams};

/// Entity name of the filtered expected effort, next to the residual.
pub(super) const FILTERED_EXPECTED: &str = "filtered_expected";

/// Batch limits for sending.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// Largest number of samples per batch.
    pub samples: usize,
    /// Largest time between the first and the last stamp of a batch \[ns\].
    pub span_ns: i64,
}

impl Pace {
    /// Few large batches, for small files that open fast.
    pub const FILE: Self = Self {
        samples: 8192,
        span_ns: 5_000_000_000,
    };
    /// Many small batches, for a live picture with 0.1 s delay.
    pub const LIVE: Self = Self {
        samples: 1000,
        span_ns: 100_000_000,
    };
}

/// Entity of the log of commands to a cell.
pub(super) fn commands_entity(streams: &Streams, cell: usize) -> EntityPath {
    entity(&format!("{}/commands", streams.prefix(cell)), &[])
}

/// Converter from samples to messages.
#[derive(Debug)]
pub(super) struct Painter {
    pub store: Store,
    pace: Pace,
    /// Number of gathered samples, and the stamp of the first \[ns\].
    gathered: usize,
    first_ns: i64,
    /// Stamp of the recording's first sample \[ns\].
    start_ns: Option<i64>,
    /// Robots by cell.
    robots: Vec<Option<Robot>>,
    /// Tracks by stream.
    tracks: Vec<Tracks>,
    /// Entity, and number of drops and restarts in the last health report, by stream.
    health: Vec<(EntityPath, u64)>,
    /// Entity of the command log, by cell.
    commands: Vec<EntityPath>,
    texts: RowTrack,
}

/// Tracks of a stream.
#[derive(Debug)]
enum Tracks {
    JointState {
        position: ScalarTrack,
        velocity: ScalarTrack,
        effort: ScalarTrack,
    },
    TwinState {
        expected: ScalarTrack,
        /// Expected effort behind the residual's low-pass. Unfiltered, the friction at reversals of a joint looks
        /// like noise.
        filtered_expected: ScalarTrack,
        residual: ScalarTrack,
        draws_robot: bool,
    },
    Detection(Box<DetectionTracks>),
    Health,
}

impl Painter {
    /// Creates a painter, and sends the messages that must precede all others.
    pub fn new(streams: &Streams, pace: Pace, out: &mut Out<'_>) -> Result<Self, RecordError> {
        let cells: Vec<_> = streams
            .cells
            .iter()
            .map(|cell| cell.name.as_str())
            .collect();
        // The viewer stores one layout per application, so each set of cells is an application.
        let application = ApplicationId::new_or_unknown(format!("tauscope {}", cells.join(" ")));
        let store = Store {
            id: StoreId::random(StoreKind::Recording, application),
        };
        out(store.announcement())?;
        let mut robots = Vec::new();
        for (index, cell) in streams.cells.iter().enumerate() {
            robots.push(match &cell.model {
                Some(model) => Some(Robot::new(
                    model,
                    &streams.prefix(index),
                    Times::default,
                    &store,
                    out,
                )?),
                None => None,
            });
        }
        let mut tracks = Vec::new();
        let mut health = Vec::new();
        for stream in &streams.all {
            tracks.push(Tracks::new(streams, stream, &store, out)?);
            let topic = format!("{}/diagnostics", streams.prefix(stream.cell));
            health.push((entity(&topic, &[&stream.stage]), 0));
        }
        let cells = 0..streams.cells.len();
        let commands = cells.map(|cell| commands_entity(streams, cell)).collect();
        let texts = RowTrack::default();
        Ok(Self {
            store,
            pace,
            gathered: 0,
            first_ns: 0,
            start_ns: None,
            robots,
            tracks,
            health,
            commands,
            texts,
        })
    }

    /// The robot of a cell.
    pub fn robot(&self, cell: usize) -> Option<&Robot> {
        self.robots[cell].as_ref()
    }

    /// Whether the detector of a stream has reported the frequency content of the force.
    pub fn has_content(&self, stream: usize) -> bool {
        matches!(&self.tracks[stream], Tracks::Detection(tracks) if tracks.has_content())
    }

    /// The latest threshold of the detector of a stream.
    pub fn threshold(&self, stream: usize) -> Option<f64> {
        match &self.tracks[stream] {
            Tracks::Detection(tracks) => tracks.newest_threshold(),
            _ => None,
        }
    }

    /// Adds a sample of the stream number `index`, with its contact.
    pub fn accept(
        &mut self,
        streams: &Streams,
        (index, sample, told): (usize, SampleRef<'_>, &Told<'_>),
        out: &mut Out<'_>,
    ) -> Result<(), RecordError> {
        let cell = streams.all[index].cell;
        let robot = self.robots[cell].as_mut();
        let stamp_ns = sample.header().stamp_ns;
        // A health report may overtake the first samples of its stage.
        if sample.kind() != SampleKind::Health {
            self.start_ns.get_or_insert(stamp_ns);
        }
        let start_ns = self.start_ns.unwrap_or(stamp_ns);
        match (sample, &mut self.tracks[index]) {
            (SampleRef::Health(health), _) => self.report(index, health)?,
            (SampleRef::JointState(state), tracks) => {
                tracks.joint_state(state, robot);
                if let Some(words) = state.command.in_words() {
                    let text = TextLog::new(words).with_level(TextLogLevel::INFO);
                    let entity = &self.commands[cell];
                    self.texts.push(&self.store, &state.header, entity, &text)?;
                }
            }
            (SampleRef::TwinState(state), tracks) => tracks.twin_state(state, robot),
            (SampleRef::Detection(detection), Tracks::Detection(tracks)) => {
                let joints = &streams.cells[cell].joint_names;
                let of = (index, &streams.all[index]);
                let detection = (detection, told);
                tracks.accept(detection, of, start_ns, joints, robot, &self.store)?;
            }
            // `Streams::find` passes samples of the announced type only.
            (SampleRef::Detection(_), _) => {}
        }
        if self.gathered == 0 {
            self.first_ns = stamp_ns;
        }
        self.gathered += 1;
        let span_ns = stamp_ns.abs_diff(self.first_ns);
        if self.gathered >= self.pace.samples || span_ns >= self.pace.span_ns.unsigned_abs() {
            self.flush(out)?;
        }
        Ok(())
    }

    /// Sends the gathered samples.
    pub fn flush(&mut self, out: &mut Out<'_>) -> Result<(), RecordError> {
        self.gathered = 0;
        for robot in self.robots.iter_mut().flatten() {
            robot.flush(&self.store, out)?;
        }
        for tracks in &mut self.tracks {
            tracks.flush(&self.store, out)?;
        }
        self.texts.flush(out)
    }

    /// Logs a text if a stage has lost samples or was restarted since its last report.
    fn report(&mut self, index: usize, health: &Health) -> Result<(), RecordError> {
        let (entity, trouble_before) = &mut self.health[index];
        let trouble = health.dropped + health.restarts;
        if trouble == *trouble_before {
            return Ok(());
        }
        *trouble_before = trouble;
        let text = format!(
            "{}: {} of {} samples lost, {} restarts",
            health.stage, health.dropped, health.received, health.restarts
        );
        let text = TextLog::new(text).with_level(TextLogLevel::WARN);
        self.texts.push(&self.store, &health.header, entity, &text)
    }
}

impl Tracks {
    fn new(
        streams: &Streams,
        stream: &Stream,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        let joints = &streams.cells[stream.cell].joint_names;
        let joints: Vec<_> = joints.iter().map(String::as_str).collect();
        let mut track = |topic: &str, field: &str| {
            ScalarTrack::new(entity(topic, &[field]), &joints, store, out)
        };
        Ok(match stream.kind {
            SampleKind::JointState => Self::JointState {
                position: track(&stream.topic, "position")?,
                velocity: track(&stream.topic, "velocity")?,
                effort: track(&stream.topic, "effort")?,
            },
            SampleKind::TwinState => Self::TwinState {
                expected: track(&stream.topic, "effort")?,
                filtered_expected: track(&streams.residual_topic(stream), FILTERED_EXPECTED)?,
                residual: track(&streams.residual_topic(stream), "effort")?,
                draws_robot: !streams
                    .all
                    .iter()
                    .any(|s| s.cell == stream.cell && s.kind == SampleKind::JointState),
            },
            SampleKind::Detection => {
                Self::Detection(Box::new(DetectionTracks::new(streams, stream, store, out)?))
            }
            SampleKind::Health => Self::Health,
        })
    }

    fn joint_state(&mut self, state: &JointState, robot: Option<&mut Robot>) {
        let Self::JointState {
            position,
            velocity,
            effort,
        } = self
        else {
            return;
        };
        position.push(&state.header, &state.position);
        if state.header.has(flags::VELOCITY_MEASURED) {
            velocity.push(&state.header, &state.velocity);
        }
        if state.header.has(flags::EFFORT_MEASURED) {
            effort.push(&state.header, &state.effort);
        }
        if let Some(robot) = robot {
            robot.pose(&state.header, &state.position);
        }
    }

    fn twin_state(&mut self, state: &TwinState, robot: Option<&mut Robot>) {
        let Self::TwinState {
            expected,
            filtered_expected,
            residual,
            draws_robot,
        } = self
        else {
            return;
        };
        expected.push(&state.header, &state.expected_effort);
        // The transient of unsettled filters would dominate the scale of the plots.
        if state.header.has(flags::READY) {
            filtered_expected.push(&state.header, &state.filtered_expected_effort);
            residual.push(&state.header, &state.residual);
        }
        if let (true, Some(robot)) = (*draws_robot, robot) {
            robot.pose(&state.header, &state.position);
        }
    }

    fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        match self {
            Self::JointState {
                position,
                velocity,
                effort,
            } => {
                position.flush(store, out)?;
                velocity.flush(store, out)?;
                effort.flush(store, out)
            }
            Self::TwinState {
                expected,
                filtered_expected,
                residual,
                ..
            } => {
                expected.flush(store, out)?;
                filtered_expected.flush(store, out)?;
                residual.flush(store, out)
            }
            Self::Detection(tracks) => tracks.flush(store, out),
            Self::Health => Ok(()),
        }
    }
}
