//! Buffered columns, one track per entity.

use rerun::archetypes::{Arrows3D, Scalars, SeriesLines, StateChange, Transform3D};
use rerun::{AsComponents, EntityPath, Rgba32, TimeColumn, TimePoint, Timeline};
use tauscope_bus::Header;

use super::store::{Out, Store, unserializable};
use crate::error::RecordError;

/// Timelines with the names and content of Rerun's MCAP importer, so that streamed and imported data share an axis.
/// The publish time is the stamp, as in the archive.
pub(super) const LOG_TIME: &str = "message_log_time";
pub(super) const PUBLISH_TIME: &str = "message_publish_time";
/// Initial timeline of the viewer: the stamp of the measurement.
pub(super) const STAMP: &str = "ros2_timestamp";

/// Times of a single row.
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

/// Times of the rows of a track.
#[derive(Debug, Default)]
pub(super) struct Times {
    received_ns: Vec<i64>,
    stamp_ns: Vec<i64>,
    /// Name and zero of an additional timeline relative to the recording's start \[ns since the epoch\].
    since: Option<(&'static str, i64)>,
}

impl Times {
    pub fn push(&mut self, header: &Header) {
        self.received_ns.push(header.received_ns);
        self.stamp_ns.push(header.stamp_ns);
    }

    /// Creates times with an additional timeline relative to `start_ns`.
    pub fn since(name: &'static str, start_ns: i64) -> Self {
        Self {
            since: Some((name, start_ns)),
            ..Self::default()
        }
    }

    pub fn take(&mut self) -> Vec<TimeColumn> {
        let received = std::mem::take(&mut self.received_ns);
        let stamp = std::mem::take(&mut self.stamp_ns);
        let since = self.since.map(|(name, start_ns)| {
            TimeColumn::new_duration_nanos(name, stamp.iter().map(|ns| ns - start_ns))
        });
        let stamps = [
            (LOG_TIME, received),
            (PUBLISH_TIME, stamp.clone()),
            (STAMP, stamp),
        ];
        let stamps = stamps.map(|(name, ns)| TimeColumn::new_timestamp_nanos_since_epoch(name, ns));
        stamps.into_iter().chain(since).collect()
    }
}

/// Numbers over time, one series per name.
#[derive(Debug)]
pub(super) struct ScalarTrack {
    pub entity: EntityPath,
    width: usize,
    times: Times,
    values: Vec<f64>,
}

impl ScalarTrack {
    /// Creates a track and sends the message that names its series.
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

    /// Adds a row with one value per name; further values are ignored.
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

/// Link poses over time, as transforms from the root's frame.
#[derive(Debug)]
pub(super) struct PoseTrack {
    pub entity: EntityPath,
    parent_frame: String,
    times: Times,
    child_frames: Vec<String>,
    translations: Vec<[f32; 3]>,
    /// Rotations as x, y, z, w.
    quaternions: Vec<[f32; 4]>,
}

impl PoseTrack {
    pub fn new(entity: EntityPath, parent_frame: String, times: Times) -> Self {
        Self {
            entity,
            parent_frame,
            times,
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

/// An arrow in the root's frame \[m\].
#[derive(Debug)]
pub(super) struct Arrow {
    pub origin_m: [f64; 3],
    pub vector_m: [f64; 3],
    pub label: String,
}

/// Moving arrows; an empty row removes them. They are updated at most every [`ARROW_PERIOD_NS`].
#[derive(Debug)]
pub(super) struct ArrowTrack {
    entity: EntityPath,
    times: Times,
    /// Number of arrows by row.
    lengths: Vec<usize>,
    origins: Vec<[f32; 3]>,
    vectors: Vec<[f32; 3]>,
    labels: Vec<String>,
    /// Stamp of the current arrows \[ns\].
    shown_ns: Option<i64>,
}

/// Smallest interval between updates of arrows \[ns\]: 50 per second.
/// Resolution: size of the stream.
const ARROW_PERIOD_NS: u64 = 20_000_000;

impl ArrowTrack {
    pub fn new(entity: EntityPath) -> Self {
        let (times, lengths, labels) = Default::default();
        Self {
            entity,
            times,
            lengths,
            origins: Vec::new(),
            vectors: Vec::new(),
            labels,
            shown_ns: None,
        }
    }

    /// Sets the arrows from now on.
    pub fn push<const N: usize>(&mut self, header: &Header, arrows: Option<[Arrow; N]>) {
        let just_now = |shown: i64| header.stamp_ns.abs_diff(shown) < ARROW_PERIOD_NS;
        match (&arrows, self.shown_ns) {
            (None, None) => return,
            (Some(_), Some(shown)) if just_now(shown) => return,
            _ => {}
        }
        self.shown_ns = arrows.as_ref().map(|_| header.stamp_ns);
        self.times.push(header);
        self.lengths.push(arrows.as_ref().map_or(0, |_| N));
        for arrow in arrows.into_iter().flatten() {
            self.origins.push(arrow.origin_m.map(|metre| metre as f32));
            self.vectors.push(arrow.vector_m.map(|metre| metre as f32));
            self.labels.push(arrow.label);
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

/// A sequence of states.
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

    /// Sets the state from now on.
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

/// A state as coloured bands along the bottom of a plot, behind its lines. It is drawn as a thick line that changes
/// its colour. The viewer rounds the ends of lines, so a line as thick as the plot would cover its neighbours.
#[derive(Debug)]
pub(super) struct BandTrack {
    entity: EntityPath,
    times: Times,
    colours: Vec<Rgba32>,
    /// Colour and stamp of the newest row.
    shown: Option<(Rgba32, i64)>,
}

impl BandTrack {
    /// Thickness \[points\].
    /// Layout: by eye; no number depends on it.
    const THICKNESS: f32 = 14.0;
    /// Longest interval between points of an unchanged band \[ns\].
    /// Resolution: size of the stream.
    const PERIOD_NS: u64 = 20_000_000;

    /// Creates a track and sends the message with its style.
    pub fn new(
        entity: EntityPath,
        name: &str,
        store: &Store,
        out: &mut Out<'_>,
    ) -> Result<Self, RecordError> {
        let looks = SeriesLines::update_fields()
            .with_names([name])
            .with_widths([Self::THICKNESS]);
        out(store.always(&entity, &looks)?)?;
        let (times, colours) = Default::default();
        Ok(Self {
            entity,
            times,
            colours,
            shown: None,
        })
    }

    /// Sets the colour from now on.
    pub fn push(&mut self, header: &Header, colour: Rgba32) {
        let just_now = |shown_ns: i64| header.stamp_ns.abs_diff(shown_ns) < Self::PERIOD_NS;
        match self.shown {
            Some((before, shown_ns)) if before == colour && just_now(shown_ns) => return,
            // End of the previous band.
            Some((before, _)) if before != colour => {
                self.times.push(header);
                self.colours.push(before);
            }
            _ => {}
        }
        self.shown = Some((colour, header.stamp_ns));
        self.times.push(header);
        self.colours.push(colour);
    }

    pub fn flush(&mut self, store: &Store, out: &mut Out<'_>) -> Result<(), RecordError> {
        if self.colours.is_empty() {
            return Ok(());
        }
        let failed = unserializable(&self.entity);
        let colours = std::mem::take(&mut self.colours);
        // Zero is the bottom of the plot, because norms are not negative.
        let values = Scalars::new(std::iter::repeat_n(0.0, colours.len()))
            .columns_of_unit_batches()
            .map_err(&failed)?;
        let colours = SeriesLines::update_fields()
            .with_colors(colours)
            .columns_of_unit_batches()
            .map_err(&failed)?;
        out(store.columns(&self.entity, self.times.take(), values.chain(colours))?)
    }
}

/// Rare rows, each sent unbatched with the next flush.
#[derive(Debug, Default)]
pub(super) struct RowTrack {
    rows: Vec<rerun::log::LogMsg>,
}

impl RowTrack {
    /// Adds a complete message.
    pub fn push_message(&mut self, message: rerun::log::LogMsg) {
        self.rows.push(message);
    }

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
