//! `explain.rrd`: the content of the page, for the Rerun viewer.

use tauscope_explain::report::{Finding, JointPicture, RecordingPicture, Report};
use tauscope_record::{
    ExplainedEvent, ExplainedJoint, ExplainedRecording, ExplainedRobot, Explanation,
};

use tauscope_report::rollout::Rollout;

use super::read::Kept;

/// Returns the content of the picture.
pub fn of(
    report: &Report,
    pictures: &[RecordingPicture],
    kept: &Kept,
    rollout: Option<&Rollout>,
) -> Explanation {
    let events = report
        .findings
        .iter()
        .filter_map(|finding| event(finding, kept));
    Explanation {
        case: report.case.clone(),
        effort_unit: report.effort_unit.clone(),
        text_markdown: text(report),
        recordings: pictures.iter().map(recording).collect(),
        events: events.collect(),
        robot: kept.bodies.then(|| ExplainedRobot {
            // The drawn robot moves as in the first recording.
            ghost: rollout
                .filter(|rollout| {
                    pictures
                        .first()
                        .is_some_and(|p| p.recording == rollout.recording)
                })
                .map(|rollout| {
                    rollout
                        .joints
                        .iter()
                        .map(|joint| joint.before.clone())
                        .collect()
                })
                .unwrap_or_default(),
            ..robot(report, kept)
        }),
    }
}

/// Returns the robot, with the links of the joints that have findings.
fn robot(report: &Report, kept: &Kept) -> ExplainedRobot {
    let model = &kept.model;
    let link_of = |finding: &Finding| {
        let of_joint = |joint: &String| {
            let child = model.joints()[model.joint_index(joint)?].child_link;
            Some(model.links()[child].name.clone())
        };
        finding
            .link
            .clone()
            .or_else(|| finding.joint.as_ref().and_then(of_joint))
    };
    ExplainedRobot {
        model: model.clone(),
        found: report.findings.iter().filter_map(link_of).collect(),
        ghost: Vec::new(),
    }
}

fn recording(picture: &RecordingPicture) -> ExplainedRecording {
    let joint = |joint: &JointPicture| ExplainedJoint {
        name: joint.joint.clone(),
        time_s: joint.time_s.clone(),
        position: joint.position.clone(),
        measured: joint.measured.clone(),
        twin: joint.before.clone(),
        corrected: joint.after.clone(),
    };
    ExplainedRecording {
        name: picture.recording.clone(),
        held_out: picture.held_out,
        start_ns: picture.start_ns,
        joints: picture.joints.iter().map(joint).collect(),
    }
}

/// Returns the event of a finding. The start of a finding without an end is relative to the start of the session; its
/// recording is the one that contains this time.
fn event(finding: &Finding, kept: &Kept) -> Option<ExplainedEvent> {
    let mut start_s = finding.t_start?;
    let mut recording = finding.recording.clone();
    if finding.t_end.is_none() && recording.is_none() {
        let before = kept
            .begins_s
            .iter()
            .filter(|(_, begins_s)| **begins_s <= start_s);
        let (name, begins_s) = before.max_by(|a, b| a.1.total_cmp(b.1))?;
        recording = Some(name.clone());
        start_s -= begins_s;
    }
    let place = finding.joint.as_ref().or(finding.link.as_ref());
    let label = match place {
        Some(place) => format!("{} at {place}", finding.effect),
        None => finding.effect.clone(),
    };
    Some(ExplainedEvent {
        recording,
        start_s,
        end_s: finding.t_end,
        label,
        sentence: finding.sentence.clone(),
    })
}

fn text(report: &Report) -> String {
    let mut text = format!("# {}\n\n{}\n", report.case, report.summary);
    for finding in &report.findings {
        text.push_str(&format!("\n- {}", finding.sentence));
    }
    for note in &report.notes {
        text.push_str(&format!("\n\n{note}"));
    }
    text
}
