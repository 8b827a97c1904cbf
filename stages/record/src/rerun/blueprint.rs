//! Initial layout of the viewer: robot and events on the left, a plot per joint and the detectors on the right, and a
//! tab per cell.

pub(super) mod explanation;
mod properties;

use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel,
    Spatial3DView, StateTimelineView, Tabs, TextLogView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::components::Name;
use rerun::external::re_sdk_types::blueprint::components::{PanelState, PlayState};
use rerun::log::LogMsg;
use rerun::{Rgba32, SeriesLines};
use tauscope_bus::SampleKind;

use self::properties::Properties;
use super::detections::{
    content_entity, events_entity, norms_entity, score_entity, state_entity, threshold_entity,
};
use super::painter::{FILTERED_EXPECTED, Painter, commands_entity};
use super::palette::{AXES, CONTACT, EXPECTED, MEASURED, RESIDUAL, SCORE};
use super::store::entity;
use super::tracks::STAMP;
use crate::error::RecordError;
use crate::streams::{Stream, Streams};

/// Time window of a live plot \[ns\].
/// Layout: by eye; no number depends on it.
const LIVE_WINDOW_NS: i64 = 30_000_000_000;

/// Purpose of the layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// A live stream.
    Live,
    /// A file.
    File,
}

/// Returns the messages of the layout.
pub(super) fn messages(
    streams: &Streams,
    painter: &Painter,
    purpose: Purpose,
) -> Result<Vec<LogMsg>, RecordError> {
    let mut properties = Properties::default();
    let mut layout = Layout {
        streams,
        painter,
        purpose,
        properties: &mut properties,
    };
    let mut cells: Vec<_> = (0..streams.cells.len())
        .map(|cell| layout.cell(cell))
        .collect();
    let root = match cells.pop() {
        Some(only) if cells.is_empty() => only,
        last => Tabs::new(cells.into_iter().chain(last)).into(),
    };
    let mut time = TimePanel::new()
        .with_timeline(STAMP)
        .with_state(PanelState::Collapsed);
    if purpose == Purpose::Live {
        time = time.with_play_state(PlayState::Following);
    }
    let blueprint = Blueprint::new(root)
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Hidden))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_time_panel(time);
    properties.messages(
        &blueprint,
        painter.store.id.application_id(),
        BlueprintActivation::default(),
    )
}

struct Layout<'a> {
    streams: &'a Streams,
    painter: &'a Painter,
    purpose: Purpose,
    properties: &'a mut Properties,
}

impl Layout<'_> {
    fn of(&self, cell: usize, kind: SampleKind) -> impl Iterator<Item = &Stream> {
        self.streams
            .all
            .iter()
            .filter(move |stream| stream.cell == cell && stream.kind == kind)
    }

    fn cell(&mut self, cell: usize) -> ContainerLike {
        let events: Vec<_> = self
            .of(cell, SampleKind::Detection)
            .map(|stream| events_entity(stream).to_string())
            .chain([
                format!("{}/diagnostics/**", entity(&self.streams.prefix(cell), &[])),
                commands_entity(self.streams, cell).to_string(),
            ])
            .collect();
        let events = TextLogView::new("Events").with_contents(events).into();
        self.properties.events(&events);
        let mut left = vec![events];
        let mut left_shares = vec![1.0];
        if let Some(robot) = self.painter.robot(cell) {
            let view = Spatial3DView::new("Robot")
                .with_origin(robot.entity().clone())
                .with_contents(robot.contents())
                .into();
            self.properties.look_at(&view, robot.view_point());
            left.insert(0, view);
            left_shares.insert(0, 3.0);
        }
        let mut right = Vec::new();
        let mut right_shares = Vec::new();
        let joints = self.joints(cell);
        if !joints.is_empty() {
            right_shares.push(joints.len().div_ceil(plots_a_row(joints.len())) as f32);
            right.push(in_rows(joints));
        }
        let scores = self.scores(cell);
        if !scores.is_empty() {
            let contents = (0..self.streams.all.len()).any(|stream| {
                self.streams.all[stream].cell == cell && self.painter.has_content(stream)
            });
            right_shares.push(if contents { 1.8 } else { 1.0 });
            right.push(
                if scores.len() == 1 {
                    scores
                } else {
                    vec![Tabs::new(scores).into()]
                }
                .remove(0),
            );
            let states: Vec<_> = self
                .of(cell, SampleKind::Detection)
                .map(|stream| state_entity(stream).to_string())
                .collect();
            right_shares.push(0.4 + 0.2 * states.len() as f32);
            let view = StateTimelineView::new("State").with_contents(states).into();
            self.properties.plot(&view, false, self.window_ns());
            right.push(view);
        }
        let name = self.streams.cells[cell].name.clone();
        let left = Vertical::new(left).with_row_shares(left_shares).into();
        if right.is_empty() {
            return left;
        }
        let right = Vertical::new(right).with_row_shares(right_shares).into();
        Horizontal::new([left, right])
            .with_column_shares([2.0, 3.0])
            .with_name(name)
            .into()
    }

    /// One plot per joint: measured and expected effort, and the residual.
    fn joints(&mut self, cell: usize) -> Vec<ContainerLike> {
        let efforts = |streams: &Streams, stream: &Stream| match stream.kind {
            SampleKind::JointState => {
                vec![(entity(&stream.topic, &["effort"]), "measured", MEASURED)]
            }
            SampleKind::TwinState => {
                let of_residual = |field| entity(&streams.residual_topic(stream), &[field]);
                vec![
                    (of_residual(FILTERED_EXPECTED), "expected", EXPECTED),
                    (of_residual("effort"), "residual", RESIDUAL),
                ]
            }
            _ => Vec::new(),
        };
        let series: Vec<_> = self
            .streams
            .all
            .iter()
            .filter(|stream| stream.cell == cell)
            .flat_map(|stream| efforts(self.streams, stream))
            .collect();
        if series.is_empty() {
            return Vec::new();
        }
        let info = &self.streams.cells[cell];
        let unit = if info.effort_unit == "Nm" {
            "N m"
        } else {
            &info.effort_unit
        };
        let count = info.joint_names.len();
        let mut plots = Vec::new();
        for (joint, name) in info.joint_names.iter().enumerate() {
            let mut view = TimeSeriesView::new(format!("{name} [{unit}]"))
                .with_contents(series.iter().map(|(entity, ..)| entity.to_string()));
            for (entity, label, colour) in &series {
                view = view.with_override(entity.clone(), &one_of(count, joint, label, *colour));
            }
            let view = view.into();
            self.properties.plot(&view, joint == 0, self.window_ns());
            plots.push(view);
        }
        plots
    }

    /// One plot per detector: its score and threshold, or the components whose maximum is the score.
    fn scores(&mut self, cell: usize) -> Vec<ContainerLike> {
        let mut plots = Vec::new();
        let detectors = self.streams.all.iter().enumerate();
        let detectors =
            detectors.filter(|(_, s)| s.cell == cell && s.kind == SampleKind::Detection);
        for (index, stream) in detectors {
            let (score, threshold) = (score_entity(stream), threshold_entity(stream));
            let label = &stream.label;
            let view = if self.painter.has_content(index) {
                let norms = norms_entity(stream);
                let looks = SeriesLines::new()
                    .with_names(["x", "y", "z"])
                    .with_colors(AXES)
                    .with_widths([1.5_f32; 3]);
                TimeSeriesView::new(format!("Force in the band by direction [N], {label}"))
                    .with_contents([
                        format!("{}/**", content_entity(stream)),
                        threshold.to_string(),
                    ])
                    .with_override(norms, &looks)
            } else {
                TimeSeriesView::new(format!("Score of {label}{}", unit_of(stream)))
                    .with_contents([score.to_string(), threshold.to_string()])
                    .with_override(score, &line("score", SCORE))
            };
            let view = view
                .with_override(
                    threshold,
                    &line(&threshold_name(self.painter.threshold(index)), CONTACT),
                )
                .into();
            self.properties.plot(&view, true, self.window_ns());
            plots.push(view);
        }
        plots
    }

    fn window_ns(&self) -> Option<i64> {
        (self.purpose == Purpose::Live).then_some(LIVE_WINDOW_NS)
    }
}

/// Unit on the axis of a detector's score.
fn unit_of(stream: &Stream) -> String {
    match stream.score_unit.as_str() {
        "" => " (no unit)".to_owned(),
        unit => format!(" [{unit}]"),
    }
}

/// Legend of the threshold, with its value if known.
fn threshold_name(value: Option<f64>) -> String {
    let value = value.filter(|value| value.is_finite());
    let value = value.map_or_else(String::new, |value| {
        if value != 0.0 && value.abs() < 1e-3 {
            return format!(" {value:.2e}");
        }
        let digits = format!(" {value:.4}");
        digits
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned()
    });
    format!("threshold{value} (alarm from here on)")
}

/// Number of plots per row: two, or more to avoid more than five rows.
fn plots_a_row(plots: usize) -> usize {
    plots.div_ceil(5).max(2)
}

/// Arranges plots in rows. Fewer plots in the last row are wider, whereas a grid would leave a gap.
fn in_rows(plots: Vec<ContainerLike>) -> ContainerLike {
    let a_row = plots_a_row(plots.len());
    let mut plots = plots.into_iter();
    let mut rows = Vec::<ContainerLike>::new();
    while plots.len() > 0 {
        rows.push(Horizontal::new(plots.by_ref().take(a_row)).into());
    }
    Vertical::new(rows).into()
}

/// Shows the series of one joint of an entity with one series per joint.
fn one_of(count: usize, joint: usize, label: &str, colour: Rgba32) -> SeriesLines {
    let names = (0..count).map(|j| Name::from(if j == joint { label } else { "other joints" }));
    SeriesLines::new()
        .with_names(names)
        .with_visible_series((0..count).map(|j| j == joint))
        .with_colors(vec![colour; count])
        .with_widths(vec![1.5_f32; count])
}

fn line(label: &str, colour: Rgba32) -> SeriesLines {
    SeriesLines::new()
        .with_names([label])
        .with_colors([colour])
        .with_widths([1.5_f32])
}

/// Positions of eye and target of a 3D view \[m\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ViewPoint {
    pub eye_m: [f32; 3],
    pub target_m: [f32; 3],
}
