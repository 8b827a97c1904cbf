//! `twin.yaml`: what was found, as a pipeline's twin loads it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use tauscope_dynamics::terms::TermSpec;
use tauscope_explain::Outcome;
use tauscope_explain::report::{Finding, Report};
use tauscope_ingest::Topics;
use tauscope_pipeline::calibrate::{CalibrateError, Job};
use tauscope_twin::{Expected, JointCorrection, TwinFile};

use super::input::Request;
use super::read::Kept;

/// The corrected twin. Its noise, and the scores that thresholds rest on, are measured with the pipeline's
/// own twin on the fitted recordings in which nothing came and went; where there is none they are left out,
/// as they are where that twin fails, which is said.
pub fn file(
    request: &Request,
    kept: &Kept,
    outcome: &Outcome,
    provenance: &BTreeMap<String, String>,
) -> (TwinFile, Option<CalibrateError>) {
    let topics = Topics {
        state: request.state_topic.clone(),
        command: None,
        twin: request.twin_topic.clone(),
        tool: None,
        learn: None,
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
    file.terms = outcome.terms.iter().map(from_now_on).collect();
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
        return (file, None);
    }
    let mut measured = file.clone();
    match job.measure(&mut measured, &quiet, &|_, _| {}) {
        Ok(_) => (measured, None),
        Err(error) => (file, Some(error)),
    }
}

/// A step of friction in a session that is over leaves what came after it; a pipeline's session begins anew.
fn from_now_on(term: &TermSpec) -> TermSpec {
    let after = term.parameters.get("coulomb_after_nm");
    let (true, Some(after)) = (term.effect == "friction_step", after) else {
        return term.clone();
    };
    TermSpec {
        effect: "coulomb_friction".to_owned(),
        parameters: BTreeMap::from([("coulomb_nm".to_owned(), *after)]),
        ..term.clone()
    }
}

/// The fitted recordings that the corrected twin holds for from end to end.
fn quiet(request: &Request, kept: &Kept, report: &Report) -> Vec<PathBuf> {
    let disturbs = |finding: &Finding, name: &str| match finding.effect.as_str() {
        "contact_wall" => true,
        "friction_step" => {
            let begins_s = kept
                .begins_s
                .get(name)
                .copied()
                .unwrap_or(f64::NEG_INFINITY);
            finding
                .t_start
                .is_some_and(|changed_s| begins_s < changed_s)
        }
        _ => {
            let here = finding
                .recording
                .as_deref()
                .is_none_or(|other| other == name);
            here && finding.t_start.is_some()
        }
    };
    let findings = &report.findings;
    let is_quiet = |name: &str| !findings.iter().any(|finding| disturbs(finding, name));
    let quiet = request
        .fit
        .iter()
        .filter(|recording| is_quiet(&recording.name));
    quiet.map(|recording| recording.path.clone()).collect()
}
