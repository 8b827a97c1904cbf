//! View settings for which Rerun's layout types have no Rust methods yet. They are logged into the same blueprint, as
//! Rerun's Python package does.

use rerun::blueprint::{Blueprint, BlueprintActivation, ContainerLike};
use rerun::components::Range1D;
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, LineGrid3D, PlotLegend, ScalarAxis, TextLogColumns, TimeAxis,
    VisibleTimeRanges,
};
use rerun::external::re_sdk_types::blueprint::components::{
    BackgroundKind, Corner2D, LinkAxis, TextLogColumn, TimelineColumn, VisibleTimeRange,
};
use rerun::external::re_sdk_types::blueprint::datatypes::{
    TextLogColumn as Column, TextLogColumnKind, TimelineColumn as Timestamps,
};
use rerun::external::re_types_core::datatypes::{
    TimeInt, TimeRange, TimeRangeBoundary, VisibleTimeRange as Range,
};
use rerun::log::LogMsg;
use rerun::{
    ApplicationId, AsComponents, EntityPath, RecordingStreamBuilder, SerializedComponentBatch,
    TimePoint, Timeline,
};

use super::ViewPoint;
use crate::error::RecordError;
use crate::rerun::palette::{BACKGROUND, GRID};
use crate::rerun::store::Store;
use crate::rerun::tracks::STAMP;

/// The settings of all views.
#[derive(Debug, Default)]
pub(super) struct Properties {
    all: Vec<(EntityPath, Vec<SerializedComponentBatch>)>,
}

impl Properties {
    /// Sets eye and target of a 3D view.
    pub fn look_at(&mut self, view: &ContainerLike, point: ViewPoint) {
        self.set(
            view,
            "EyeControls3D",
            &EyeControls3D::new()
                .with_position(point.eye_m)
                .with_look_target(point.target_m),
        );
        self.set(view, "LineGrid3D", &LineGrid3D::new().with_color(GRID));
        let background = Background::new(BackgroundKind::SolidColor).with_color(BACKGROUND);
        self.set(view, "Background", &background);
    }

    /// Sets the columns of a text log: level and text. The time is part of the text, because the viewer's time column
    /// shows only the beginning of the date.
    pub fn events(&mut self, view: &ContainerLike) {
        let when = Timestamps {
            visible: false.into(),
            timeline: STAMP.into(),
        };
        let what = [TextLogColumnKind::LogLevel, TextLogColumnKind::Body].map(|kind| {
            let visible = true.into();
            TextLogColumn(Column { visible, kind })
        });
        let columns = TextLogColumns::new()
            .with_timeline_columns([TimelineColumn(when)])
            .with_text_log_columns(what);
        self.set(view, "TextLogColumns", &columns);
    }

    /// Links the time axis of a plot to that of all others. `window_ns` limits the visible past.
    pub fn plot(&mut self, view: &ContainerLike, legend: bool, window_ns: Option<i64>) {
        self.set(
            view,
            "TimeAxis",
            &TimeAxis::new().with_link(LinkAxis::LinkToGlobal),
        );
        let legend = PlotLegend::new()
            .with_visible(legend)
            .with_corner(Corner2D::RightTop);
        self.set(view, "PlotLegend", &legend);
        if let Some(window_ns) = window_ns {
            let range = TimeRange {
                start: TimeRangeBoundary::CursorRelative(TimeInt(-window_ns)),
                end: TimeRangeBoundary::AT_CURSOR,
            };
            let range = VisibleTimeRange(Range {
                timeline: STAMP.into(),
                range,
            });
            self.set(view, "VisibleTimeRanges", &VisibleTimeRanges::new([range]));
        }
    }

    /// Sets the range of values of a plot.
    pub fn vertical_range(&mut self, view: &ContainerLike, low: f64, high: f64) {
        let range = ScalarAxis::new().with_range(Range1D::new(low, high));
        self.set(view, "ScalarAxis", &range);
    }

    fn set(&mut self, view: &ContainerLike, name: &str, property: &dyn AsComponents) {
        if let ContainerLike::View(view) = view {
            let path = view
                .blueprint_path()
                .join(&EntityPath::from_single_string(name));
            self.all.push((path, property.as_serialized_batches()));
        }
    }

    /// Returns the messages of the blueprint, including the settings.
    pub fn messages(
        self,
        blueprint: &Blueprint,
        application: &ApplicationId,
        activation: BlueprintActivation,
    ) -> Result<Vec<LogMsg>, RecordError> {
        let failed = |reason: &dyn std::fmt::Display| RecordError::Encode {
            entity: "blueprint".to_owned(),
            reason: reason.to_string(),
        };
        let (stream, storage) = RecordingStreamBuilder::new(application.clone())
            .enabled(true)
            .memory()
            .map_err(|error| failed(&error))?;
        blueprint
            .send(&stream, activation)
            .map_err(|error| failed(&error))?;
        let mut messages = storage.take();
        messages.retain(|message| message.store_id().is_blueprint());
        let (Some(id), Some(activate)) = (
            messages.first().map(|first| first.store_id().clone()),
            messages.pop(),
        ) else {
            return Err(failed(&"Rerun made no messages of the layout"));
        };
        let store = Store { id };
        let time = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        for (path, batches) in &self.all {
            messages.push(store.at(time.clone(), path, batches)?);
        }
        messages.push(activate);
        Ok(messages)
    }
}
