//! `twin.yaml`: the corrected twin, in the format that a pipeline loads.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_dynamics::terms::{self, Effect, TermSpec, Time};
use tauscope_explain::Outcome;
use tauscope_explain::report::{Finding, Report};
use tauscope_ingest::Topics;
use tauscope_pipeline::calibrate::{CalibrateError, Job};
use tauscope_twin::{Expected, JointCorrection, TwinFile};

use super::input::Request;
use super::read::Kept;
use super::served::keep_what_serves;

/// Returns the corrected twin, and notes on it. Its noise, and the scores from which thresholds follow, are measured
/// with the pipeline's own twin on the fitted recordings without temporary effects. They are left out if there is no
/// such recording, or if that twin fails.
pub fn file(
    request: &Request,
    kept: &Kept,
    outcome: &Outcome,
    provenance: &BTreeMap<String, String>,
) -> (TwinFile, Vec<String>) {
    let topics = Topics {
        state: request.state_topic.clone(),
        command: None,
        twin: request.twin_topic.clone(),
        tool: None,
        learn: None,
        commands: None,
    };
    let expected = match request.twin_topic {
        Some(_) => Expected::Topic,
        None => Expected::Model,
    };
    let config = tauscope_twin::Config {
        expected,
        ..tauscope_twin::Config::default()
    };
    let job = Job {
        cell: &request.cell,
        topics: &topics,
        twin: &config,
        fit: &[],
        validation: &[],
    };
    let mut file = job.file();
    file.terms = outcome.terms.iter().map(TermSpec::from_now_on).collect();
    file.provenance.clone_from(provenance);
    for (index, name) in request.cell.facts.joint_names.iter().enumerate() {
        let start = kept.start.as_ref();
        let gain = outcome.gain.get(index).copied().unwrap_or(1.0);
        let deviation = outcome.gain_deviation.get(index).copied();
        let joint = JointCorrection {
            gain,
            gain_deviation: deviation
                .map(|known| if known.is_finite() { known } else { gain.abs() })
                .filter(|known| *known > 0.0),
            offset: start.map_or(0.0, |start| start.offset[index]),
            ..JointCorrection::default()
        };
        file.joints.insert(name.clone(), joint);
    }
    let quiet = quiet(request, kept, &outcome.report);
    if quiet.is_empty() {
        return (file, Vec::new());
    }
    let mut measured = file.clone();
    let before = before(request, &job);
    let mut measure = || {
        let notes = keep_what_serves(&job, &mut measured, &before, &quiet)?;
        job.choose_cutoffs(&mut measured, &quiet, &|_, _| {})?;
        job.measure(&mut measured, &quiet, &|_, _| {})?;
        Ok::<_, CalibrateError>(notes)
    };
    match measure() {
        Ok(notes) => (measured, notes),
        Err(error) => {
            let note = format!("twin.yaml holds no noise and no scores: {error}.");
            (file, vec![note])
        }
    }
}

/// Returns the twin that the explanation started from.
fn before(request: &Request, job: &Job<'_>) -> TwinFile {
    if let Some(start) = &request.start {
        return start.file.clone();
    }
    let mut file = job.file();
    for name in &request.cell.facts.joint_names {
        file.joints.insert(name.clone(), JointCorrection::default());
    }
    file
}

/// Returns the fitted recordings for which the corrected twin is valid from start to end.
fn quiet(request: &Request, kept: &Kept, report: &Report) -> Vec<PathBuf> {
    let disturbs = |finding: &Finding, name: &str| {
        let effect = terms::effect(finding.known_as());
        if effect.is_some_and(Effect::is_surface) {
            return true;
        }
        let begins_s = kept.begins_s.get(name).copied();
        let begins_s = begins_s.unwrap_or(f64::NEG_INFINITY);
        if effect.is_some_and(|effect| effect.traits.in_session) {
            // A bound without an interval is not the time of the change.
            let is_kept = finding.intervals_95.contains_key("t_start_s");
            let changed_s = if is_kept {
                finding.t_start
            } else {
                finding.t_end
            };
            return changed_s.is_some_and(|changed_s| begins_s < changed_s);
        }
        if effect.is_some_and(|effect| effect.time() == Time::Step) {
            return finding
                .t_start
                .is_some_and(|changed_s| begins_s < changed_s);
        }
        let recording = finding.recording.as_deref();
        recording.is_none_or(|other| other == name) && finding.t_start.is_some()
    };
    let findings = &report.findings;
    let is_quiet = |name: &str| !findings.iter().any(|finding| disturbs(finding, name));
    let quiet = request
        .fit
        .iter()
        .filter(|recording| is_quiet(&recording.name));
    quiet.map(|recording| recording.path.clone()).collect()
}
