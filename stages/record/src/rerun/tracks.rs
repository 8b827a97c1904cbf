//! Columns that grow until they are sent: one track an entity.

use rerun::archetypes::{Arrows3D, Scalars, SeriesLines, StateChange, Transform3D};
use rerun::{AsComponents, EntityPath, TimeColumn, TimePoint, Timeline};
use tauscope_bus::Header;

use super::store::{Out, Store, unserializable};
use crate::error::RecordError;

/// The timelines, named and filled as Rerun's own MCAP importer does, so that what is streamed and
/// what is imported share an axis. The archive gives the stamp as publish time, so here too.
pub(super) const LOG_TIME: &str = "message_log_time";
pub(super) const PUBLISH_TIME: &str = "message_publish_time";
/// The timeline that the viewer opens on: the stamp of the measurement.
pub(super) const STAMP: &str = "ros2_timestamp";

/// The time of a single row.
pub(super) fn time_point(header: &Header) -> TimePoint {
    [
        (LOG_TIME, header.received_ns),
        (PUBLISH_TIME, header.stamp_ns),
        (STAMP, header.stamp_ns),
    ]
    .into_iter()
    .fold(TimePoint::default(), |point, (name, ns)| {
        point.with(Timeline::new_timestamp(name), ns)
    })
}

/// The times of the rows of a track.
#[derive(Debug, Default)]
pub(super) struct Times {
    received_ns: Vec<i64>,
    stamp_ns: Vec<i64>,
}

impl Times {
    pub fn push(&mut self, header: &Header) {
        self.received_ns.push(header.received_ns);
        self.stamp_ns.push(header.stamp_ns);
    }

    pub fn take(&mut self) -> [TimeColumn; 3] {
        let received = std::mem::take(&mut self.received_ns);
        let stamp = std::mem::take(&mut self.stamp_ns);
        [
            (LOG_TIME, received),
            (PUBLISH_TIME, stamp.clone()),
            (STAMP, stamp),
        ]
        .map(|(name, ns)| TimeColumn::new_timestamp_nanos_since_epoch(name, ns))
    }
}

/// Numbers over time: one series a name.
#[derive(Debug)]
pub(super) struct ScalarTrack {
    pub entity: EntityPath,
    width: usize,
    times: Times,
    values: Vec<f64>,
}

impl ScalarTrack {
    /// A track, and the message that names its series.
    pub fn new(
        entity: EntityPath,
        names: &[&str],
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        out(store.always(
            &entity,
            &SeriesLines::new().with_names(names.iter().copied()),
        )?)?;
        Ok(Self {
            entity,
            width: names.len(),
            times: Times::default(),
            values: Vec::new(),
        })
    }

    /// A row; as many values as there are names are taken.
    pub fn push(&mut self, header: &Header, values: &[f64]) {
        self.times.push(header);
        self.values.extend_from_slice(&values[..self.width]);
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        let rows = self.times.stamp_ns.len();
        if rows == 0 {
            return Ok(());
        }
        let columns = Scalars::new(std::mem::take(&mut self.values))
            .columns(std::iter::repeat_n(self.width, rows))
            .map_err(unserializable(&self.entity))?;
        out(store.columns(&self.entity, self.times.take(), columns)?)
    }
}

/// Where the links are, as a stream of transforms from the root's frame.
#[derive(Debug)]
pub(super) struct PoseTrack {
    pub entity: EntityPath,
    parent_frame: String,
    times: Times,
    child_frames: Vec<String>,
    translations: Vec<[f32; 3]>,
    /// x, y, z, w.
    quaternions: Vec<[f32; 4]>,
}

impl PoseTrack {
    pub fn new(entity: EntityPath, parent_frame: String) -> Self {
        Self {
            entity,
            parent_frame,
            times: Times::default(),
            child_frames: Vec::new(),
            translations: Vec::new(),
            quaternions: Vec::new(),
        }
    }

    pub fn push(&mut self, header: &Header, child: &str, translation: [f32; 3], xyzw: [f32; 4]) {
        self.times.push(header);
        self.child_frames.push(child.to_owned());
        self.translations.push(translation);
        self.quaternions.push(xyzw);
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        let rows = self.times.stamp_ns.len();
        if rows == 0 {
            return Ok(());
        }
        let rotations = std::mem::take(&mut self.quaternions);
        let columns = Transform3D::new()
            .with_many_translation(std::mem::take(&mut self.translations))
            .with_many_quaternion(rotations.into_iter().map(rerun::Quaternion::from_xyzw))
            .with_many_child_frame(std::mem::take(&mut self.child_frames))
            .with_many_parent_frame(std::iter::repeat_n(self.parent_frame.as_str(), rows))
            .columns_of_unit_batches()
            .map_err(unserializable(&self.entity))?;
        out(store.columns(&self.entity, self.times.take(), columns)?)
    }
}

/// A force on the robot, as an arrow that ends where it acts; a row without an arrow ends it.
#[derive(Debug)]
pub(super) struct ForceTrack {
    entity: EntityPath,
    times: Times,
    /// 1 for a row with an arrow, 0 for one without.
    lengths: Vec<usize>,
    origins: Vec<[f32; 3]>,
    vectors: Vec<[f32; 3]>,
    labels: Vec<String>,
}

impl ForceTrack {
    /// Length of the arrow: 100 N to the metre, so that a push by hand is as long as a forearm.
    const M_PER_N: f64 = 0.01;

    pub fn new(entity: EntityPath) -> Self {
        let (times, lengths, labels) = Default::default();
        Self {
            entity,
            times,
            lengths,
            origins: Vec::new(),
            vectors: Vec::new(),
            labels,
        }
    }

    /// The force \[N\] and the point \[m\] it acts at, in the root's frame; `None` for no force.
    pub fn push(&mut self, header: &Header, force: Option<([f64; 3], [f64; 3])>) {
        self.times.push(header);
        self.lengths.push(usize::from(force.is_some()));
        if let Some((force_n, point_m)) = force {
            let vector = force_n.map(|newton| newton * Self::M_PER_N);
            self.origins
                .push(std::array::from_fn(|i| (point_m[i] - vector[i]) as f32));
            self.vectors.push(vector.map(|metre| metre as f32));
            self.labels.push(format!("{:.0} N", norm(force_n)));
        }
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        if self.lengths.is_empty() {
            return Ok(());
        }
        let columns = Arrows3D::update_fields()
            .with_vectors(std::mem::take(&mut self.vectors))
            .with_origins(std::mem::take(&mut self.origins))
            .with_labels(std::mem::take(&mut self.labels))
            .columns(std::mem::take(&mut self.lengths))
            .map_err(unserializable(&self.entity))?;
        out(store.columns(&self.entity, self.times.take(), columns)?)
    }
}

/// Length of a vector.
pub(super) fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The states that something passes through.
#[derive(Debug)]
pub(super) struct StateTrack {
    entity: EntityPath,
    times: Times,
    states: Vec<String>,
}

impl StateTrack {
    pub fn new(entity: EntityPath) -> Self {
        Self {
            entity,
            times: Times::default(),
            states: Vec::new(),
        }
    }

    /// The state from now on.
    pub fn push(&mut self, header: &Header, state: &str) {
        self.times.push(header);
        self.states.push(state.to_owned());
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        if self.states.is_empty() {
            return Ok(());
        }
        let columns = StateChange::new()
            .with_state(std::mem::take(&mut self.states))
            .columns_of_unit_batches()
            .map_err(unserializable(&self.entity))?;
        out(store.columns(&self.entity, self.times.take(), columns)?)
    }
}

/// Rows that are rare, each sent as it is with the next flush.
#[derive(Debug, Default)]
pub(super) struct RowTrack {
    rows: Vec<rerun::log::LogMsg>,
}

impl RowTrack {
    pub fn push(
        &mut self,
        store: &Store,
        header: &Header,
        entity: &EntityPath,
        what: &dyn AsComponents,
    ) -> Result<(), RecordError> {
        self.rows.push(store.at(time_point(header), entity, what)?);
        Ok(())
    }

    pub fn flush(&mut self, out: &mut Out<'_>) -> Result<(), RecordError> {
        self.rows.drain(..).try_for_each(out)
    }
}
