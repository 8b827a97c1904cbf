//! Initial layout of an explanation: on the left the verdict above the log of events; on the right a tab per
//! recording with effort and residual of each joint.

use rerun::ApplicationId;
use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel,
    Spatial3DView, StateTimelineView, Tabs, TextDocumentView, TextLogView, TimePanel,
    TimeSeriesView, Vertical,
};
use rerun::external::re_sdk_types::blueprint::components::PanelState;
use rerun::log::LogMsg;

use super::properties::Properties;
use crate::error::RecordError;
use crate::rerun::explanation::{
    ExplainedRecording, Explanation, GHOST, RECORDING_TIME, effort_entity, event_entity, events_of,
    log_entity, residual_entity, text_entity,
};
use crate::rerun::robot::Robot;

/// Returns the messages of the layout.
pub(in crate::rerun) fn messages(
    explanation: &Explanation,
    robot: Option<&Robot>,
    application: &ApplicationId,
) -> Result<Vec<LogMsg>, RecordError> {
    let mut properties = Properties::default();
    let left = left(explanation, robot, &mut properties);
    let mut tabs: Vec<ContainerLike> = explanation
        .recordings
        .iter()
        .filter(|recording| !recording.joints.is_empty())
        .map(|recording| tab(explanation, recording, &mut properties))
        .collect();
    let root = if tabs.is_empty() {
        left
    } else {
        let right = if tabs.len() == 1 {
            tabs.remove(0)
        } else {
            Tabs::new(tabs).into()
        };
        Horizontal::new([left, right])
            .with_column_shares([1.0, 2.4])
            .into()
    };
    let time = TimePanel::new()
        .with_timeline(RECORDING_TIME)
        .with_state(PanelState::Collapsed);
    let blueprint = Blueprint::new(root)
        .with_auto_views(false)
        .with_auto_layout(false)
        .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Hidden))
        .with_selection_panel(SelectionPanel::from_state(PanelState::Hidden))
        .with_time_panel(time);
    properties.messages(&blueprint, application, BlueprintActivation::default())
}

/// The robot, the text below it, and the log of events if there are any.
fn left(
    explanation: &Explanation,
    robot: Option<&Robot>,
    properties: &mut Properties,
) -> ContainerLike {
    let mut views = Vec::<ContainerLike>::new();
    let mut shares = Vec::new();
    if let Some(robot) = robot {
        let name = explanation
            .recordings
            .first()
            .map_or("", |first| &first.name);
        let view = Spatial3DView::new(format!("Robot in {name}"))
            .with_origin(robot.entity().clone())
            .with_contents([format!("{}/**", robot.entity()), format!("/{GHOST}/**")])
            .into();
        properties.look_at(&view, robot.view_point());
        views.push(view);
        shares.push(2.4);
    }
    let text = TextDocumentView::new("Verdict")
        .with_contents([text_entity().to_string()])
        .into();
    views.push(text);
    shares.push(3.0);
    if !explanation.events.is_empty() {
        let logs = explanation
            .recordings
            .iter()
            .map(|recording| log_entity(&recording.name).to_string());
        let log = TextLogView::new("When").with_contents(logs).into();
        properties.events(&log);
        views.push(log);
        shares.push(1.0);
    }
    if views.len() == 1 {
        return views.remove(0);
    }
    Vertical::new(views).with_row_shares(shares).into()
}

/// Tab of a recording: a row per joint, and a band of events.
fn tab(
    explanation: &Explanation,
    recording: &ExplainedRecording,
    properties: &mut Properties,
) -> ContainerLike {
    let unit = match explanation.effort_unit.as_str() {
        "Nm" => "N m",
        unit => unit,
    };
    let mut rows = Vec::<ContainerLike>::new();
    let mut shares = Vec::new();
    for joint in &recording.joints {
        let name = &joint.name;
        let plots = [
            (
                format!("{name} effort [{unit}]"),
                effort_entity(&recording.name, name),
            ),
            (
                format!("{name} residual [{unit}]"),
                residual_entity(&recording.name, name),
            ),
        ]
        .map(|(title, entity)| {
            let view = TimeSeriesView::new(title)
                .with_contents([entity.to_string()])
                .into();
            properties.plot(&view, rows.is_empty(), None);
            view
        });
        if let Some(half) = joint.residual_range() {
            properties.vertical_range(&plots[1], -half, half);
        }
        rows.push(Horizontal::new(plots).into());
        shares.push(1.0);
    }
    let events: Vec<_> = events_of(explanation, recording)
        .map(|(number, _)| event_entity(&recording.name, number).to_string())
        .collect();
    if !events.is_empty() {
        shares.push(0.75 + 0.35 * events.len() as f32);
        let view = StateTimelineView::new("What acts when")
            .with_contents(events)
            .into();
        properties.plot(&view, false, None);
        rows.push(view);
    }
    let name = if recording.held_out {
        format!("{} (held out)", recording.name)
    } else {
        recording.name.clone()
    };
    Vertical::new(rows)
        .with_row_shares(shares)
        .with_name(name)
        .into()
}
