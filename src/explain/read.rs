//! Reading of recordings into the engine's input.

use std::collections::BTreeMap;

use tauscope_dynamics::Model;
use tauscope_explain::{Input, Recording, RecordingTopics, Start};
use tauscope_pipeline::report::{Problem, Report};
use tauscope_session::{Joints, by_reason};
use tauscope_twin::JointCorrection;

use super::input::{Named, Request};

/// Facts about the input that are needed after the engine has taken it.
#[derive(Debug)]
pub struct Kept {
    /// The robot as the engine sees it.
    pub model: Model,
    /// Whether its bodies have masses; false if the twin is external.
    pub bodies: bool,
    /// Twin that the explanation started from.
    pub start: Option<Start>,
    /// Start of each recording \[s from the start of the session\].
    pub begins_s: BTreeMap<String, f64>,
    /// Number of data rows lost on reading.
    pub lost: u64,
}

impl Kept {
    /// Extracts these facts from `input`.
    pub fn of(input: &Input) -> Self {
        let recordings = || input.fit.iter().chain(&input.holdout);
        let session_ns = recordings()
            .map(|recording| recording.start_ns)
            .min()
            .unwrap_or(0);
        let begin = |recording: &Recording| {
            let since_s = (recording.start_ns - session_ns) as f64 * 1e-9;
            (recording.name.clone(), since_s)
        };
        Self {
            model: input.model.clone(),
            bodies: input.bodies,
            start: input.start.clone(),
            begins_s: recordings().map(begin).collect(),
            lost: recordings().map(|recording| recording.losses.lost()).sum(),
        }
    }
}

/// Reads the recordings of `request`; `progress` receives the fraction that is read and the name of the next
/// recording.
///
/// # Errors
/// All recordings that cannot be used, with the reasons.
pub fn read(request: &Request, progress: &dyn Fn(f64, &str)) -> Result<Input, Report> {
    let facts = &request.cell.facts;
    let topics = RecordingTopics {
        state: request.state_topic.clone(),
        reference: request.twin_topic.clone(),
        longest_s: request.longest_s,
    };
    let limits = request.cell.effort_limits();
    let joints = Joints {
        names: &facts.joint_names,
        effort_limits: &limits,
    };
    let count = (request.fit.len() + request.holdout.len()) as f64;
    let mut errors = Vec::new();
    let mut done = 0.0;
    let mut read_all = |recordings: &[Named]| -> Vec<Recording> {
        let mut all = Vec::new();
        for Named { name, path } in recordings {
            progress(done / count, &format!("reading {name}"));
            done += 1.0;
            match Recording::read(path, &topics, joints) {
                Ok(mut recording) => {
                    recording.name.clone_from(name);
                    all.push(recording);
                }
                Err(error) => errors.push(error),
            }
        }
        all
    };
    let fit = read_all(&request.fit);
    let holdout = read_all(&request.holdout);
    let mut report = Report::default();
    for reason in by_reason(&errors, request.fit.len() + request.holdout.len()) {
        report.push(Problem::new(reason));
    }
    // The effort of an external twin already includes the robot's bodies.
    let (model, bodies) = match (&request.cell.model, &request.twin_topic) {
        (Some(model), None) => (model.clone(), true),
        _ => (Model::massless(&facts.joint_names), false),
    };
    let start = start(request, &mut report);
    report.into_result(Input {
        case: request.case.clone(),
        model,
        bodies,
        effort_unit: facts.effort_unit.as_str().to_owned(),
        torque_constants_nm_per_a: facts.torque_constants_nm_per_a.clone(),
        fit,
        holdout,
        start,
        without: request.without.clone(),
    })
}

/// Returns the friction, rotors and springs that the robot's file states.
fn of_robot(request: &Request) -> Option<Start> {
    let terms = request.cell.stated_terms();
    let joints = request.cell.facts.joint_names.len();
    (!terms.is_empty() && request.twin_topic.is_none()).then(|| Start {
        was_found: false,
        terms,
        gain: vec![1.0; joints],
        gain_deviation: vec![0.0; joints],
        offset: vec![0.0; joints],
    })
}

fn start(request: &Request, report: &mut Report) -> Option<Start> {
    let facts = &request.cell.facts;
    let Some(start) = &request.start else {
        return of_robot(request);
    };
    let file = &start.file;
    match file.resolve(&facts.joint_names, facts.effort_unit.as_str()) {
        Ok(correction) => Some(Start {
            was_found: true,
            terms: correction.terms,
            gain: correction.joints.iter().map(|joint| joint.gain).collect(),
            gain_deviation: correction.joints.iter().map(gain_deviation).collect(),
            offset: correction.joints.iter().map(|joint| joint.offset).collect(),
        }),
        Err(error) => {
            report.push(Problem::new(error.to_string()));
            None
        }
    }
}

/// Returns the standard deviation of a joint's gain. Without a stated one it is 0 if the gain determines the effort
/// per N m, else infinite.
fn gain_deviation(joint: &JointCorrection) -> f64 {
    let of_line = if joint.tells_torque() {
        0.0
    } else {
        f64::INFINITY
    };
    joint.gain_deviation.unwrap_or(of_line)
}
