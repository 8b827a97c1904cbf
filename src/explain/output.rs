//! Files with the results of an explanation.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tauscope_archive::whole_file;
use tauscope_explain::report::{MOTION_PREFIX, RecordingPicture, Verdict};
use tauscope_explain::{Outcome, Series};
use tauscope_pipeline::cell::EffortUnit;
use tauscope_report as html;
use tauscope_report::models::{self, Corrections, Target};
use tauscope_report::rollout::{self, Rollout};
use tauscope_session::robot::{self, Source};

use super::input::Request;
use super::read::Kept;
use super::{of_robot, picture, provenance_of, twin, write_whole};
use crate::existing::Force;
use crate::exit::Failure;

const PAGE: &str = "report.html";
const PICTURE: &str = "explain.rrd";
const REPORT: &str = "report.json";
const TWIN: &str = "twin.yaml";
const ROBOT: &str = "robot.urdf";
const ROBOT_MJCF: &str = "robot.xml";

/// The files that were written.
#[derive(Debug, Default)]
pub struct Made {
    /// The files, the most useful ones first.
    pub files: Vec<PathBuf>,
    /// Notes on results that could not be written, with the reason.
    pub notes: Vec<String>,
}

/// Creates the folder `out`.
///
/// # Errors
/// If it cannot be created.
pub fn make(out: &Path) -> Result<(), Failure> {
    whole_file::create_folder(out)
        .map_err(|error| Failure::rejected(format!("cannot make {}: {error}", out.display())))
}

/// Fails if results would replace files.
///
/// # Errors
/// If an input would be replaced, or a result exists already and `force` is not given.
pub fn refuse_to_replace(out: &Path, request: &Request, force: Force) -> Result<(), Failure> {
    let start = request.start.iter().map(|start| &start.path);
    let recordings = request.fit.iter().chain(&request.holdout);
    let inputs = start.chain(&request.robot_path);
    let inputs = inputs.chain(recordings.map(|recording| &recording.path));
    force.check_beside(results(out, request), inputs)
}

/// Returns the files that an explanation may write. The names of proposed motions are not known in advance; those of
/// an earlier explanation are included.
fn results<'a>(out: &'a Path, request: &'a Request) -> impl Iterator<Item = PathBuf> + 'a {
    let fixed = [REPORT, PAGE, TWIN, ROBOT, ROBOT_MJCF, PICTURE];
    let recordings = request.fit.iter().chain(&request.holdout);
    let predictions = recordings.map(|recording| format!("{}.csv", recording.name));
    let names = fixed.into_iter().map(str::to_owned).chain(predictions);
    names.map(|name| out.join(name)).chain(motions(out))
}

/// Returns the files of proposed motions in the folder.
fn motions(out: &Path) -> Vec<PathBuf> {
    // A folder that cannot be read causes an error when it is created.
    let entries = std::fs::read_dir(out).into_iter().flatten().flatten();
    let is_motion = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(MOTION_PREFIX) && name.ends_with(".csv")
    };
    entries
        .map(|entry| entry.path())
        .filter(is_motion)
        .collect()
}

/// Writes all results to `out`, and adds the names of the prediction files to the report.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    out: &Path,
    request: &Request,
    kept: &Kept,
    outcome: &mut Outcome,
) -> Result<Made, Failure> {
    let joints = &request.cell.facts.joint_names;
    for picture in &mut outcome.pictures {
        for (joint, name) in picture.joints.iter_mut().zip(joints) {
            joint.joint.clone_from(name);
        }
    }
    outcome.report.notes.splice(0..0, of_robot(request));
    let provenance = provenance_of(request).context("the hashes of the inputs")?;
    // Remove the files of an earlier explanation: they would contradict the new report.
    let fixed = [REPORT, PAGE, TWIN, ROBOT, ROBOT_MJCF, PICTURE].map(|name| out.join(name));
    for path in fixed.into_iter().chain(motions(out)) {
        // A missing file is fine, and a file that cannot be removed causes an error when it is written.
        let _ = std::fs::remove_file(path);
    }
    let mut made = Made::default();
    let mut predictions = Vec::new();
    for (recording, rows) in &outcome.predictions {
        let name = format!("{recording}.csv");
        let path = out.join(&name);
        write_whole(&path, prediction(rows, joints.len()).as_bytes())?;
        outcome
            .report
            .holdout_predictions
            .insert(recording.clone(), name);
        predictions.push(path);
    }
    let is_handed_out = outcome.report.hands_out_twin();
    let twin = is_handed_out.then(|| twin_text(request, kept, outcome, &provenance, &mut made));
    let twin = twin.transpose()?;
    let robot = robot_text(request, kept, outcome, &mut made);
    let rollout = rollout(request, kept, outcome, &mut made);
    let shown = |path: &Path| path.display().to_string();
    let (holdout, fit) = parted(request, &outcome.report.holdout_predictions);
    let around = html::Around {
        date: today(),
        provenance,
        model: kept.bodies.then_some(&kept.model),
        robot: request.robot_path.as_deref().map(shown),
        start: request.start.as_ref().map(|start| shown(&start.path)),
        fit,
        holdout,
        twin: twin.is_some().then(|| pasted(out, TWIN)),
        corrected_robot: (robot.as_ref())
            .filter(|(name, _)| *name == ROBOT)
            .map(|(name, _)| pasted(out, name)),
        rollout: rollout.as_ref(),
    };
    let put = |name: &str, text: &str, made: &mut Made| {
        let path = out.join(name);
        write_whole(&path, text.as_bytes())?;
        made.files.push(path);
        Ok::<(), Failure>(())
    };
    let page = html::page(&outcome.report, &outcome.pictures, &around);
    put(PAGE, &page, &mut made)?;
    put(REPORT, &json(outcome)?, &mut made)?;
    for (name, text) in &outcome.trajectories {
        put(name, text, &mut made)?;
    }
    if let Some(twin) = &twin {
        put(TWIN, twin, &mut made)?;
    }
    if let Some((name, text)) = &robot {
        put(name, text, &mut made)?;
    }
    if outcome.report.verdict != Verdict::NotEvaluated {
        let path = out.join(PICTURE);
        let shown = picture::of(&outcome.report, &outcome.pictures, kept, rollout.as_ref());
        tauscope_record::write_explanation(&path, &shown).context("the picture")?;
        made.files.push(path);
    }
    made.files.append(&mut predictions);
    Ok(made)
}

/// Returns the recordings that were held out, and those that were fitted. If none were given to hold out, some of
/// those to fit were held out.
fn parted(request: &Request, predicted: &BTreeMap<String, String>) -> (Vec<String>, Vec<String>) {
    let (mut holdout, mut fit) = (Vec::new(), Vec::new());
    for named in request.fit.iter().chain(&request.holdout) {
        let part = if predicted.contains_key(&named.name) {
            &mut holdout
        } else {
            &mut fit
        };
        part.push(named.path.display().to_string());
    }
    (holdout, fit)
}

/// Returns the date in UTC, in ISO 8601.
fn today() -> String {
    let now = jiff::Timestamp::now();
    now.strftime("%Y-%m-%d").to_string()
}

/// Returns the report as JSON.
///
/// # Errors
/// If the report cannot be encoded; no such case is known.
pub fn json(outcome: &Outcome) -> anyhow::Result<String> {
    serde_json::to_string_pretty(&outcome.report).context("cannot encode the report")
}

/// Formats a prediction as CSV without a header: a row per recorded row, a column per joint, `NaN` in rows without a
/// prediction.
fn prediction(rows: &[f64], joints: usize) -> String {
    let mut text = String::with_capacity(rows.len() * 12);
    for row in rows.chunks(joints.max(1)) {
        for (index, value) in row.iter().enumerate() {
            if index > 0 {
                text.push(',');
            }
            // 1e-8 A or N m is below the resolution of any sensor.
            text.push_str(&format!("{value:.8}"));
        }
        text.push('\n');
    }
    text
}

fn twin_text(
    request: &Request,
    kept: &Kept,
    outcome: &Outcome,
    provenance: &BTreeMap<String, String>,
    made: &mut Made,
) -> Result<String, Failure> {
    let (file, notes) = twin::file(request, kept, outcome, provenance);
    made.notes.extend(notes);
    Ok(serde_saphyr::to_string(&file).context("the twin")?)
}

/// Returns name and text of the corrected robot in the format of its file: a URDF if all corrections are of bodies, a
/// MuJoCo model if it has an element for any of them.
fn robot_text(
    request: &Request,
    kept: &Kept,
    outcome: &Outcome,
    made: &mut Made,
) -> Option<(&'static str, String)> {
    let is_written = kept.bodies && outcome.report.hands_out_twin();
    let urdf = request.cell.facts.urdf.as_ref().filter(|_| is_written)?;
    let mut gains = outcome.gain.iter();
    let mut offsets = kept.start.iter().flat_map(|start| &start.offset);
    let is_bare = gains.all(|gain| (gain - 1.0).abs() < f64::EPSILON)
        && offsets.all(|offset| offset.abs() < f64::EPSILON);
    let corrections = Corrections::of(&kept.model, &outcome.terms, &outcome.report.findings);
    if !is_bare || corrections.is_empty() {
        return None;
    }
    let source = request.robot_path.as_ref().map(|path| robot::source(path));
    let (name, target, text) = match source {
        Some(Ok(Source::Mjcf(text))) => (ROBOT_MJCF, Target::Mjcf, text),
        _ if corrections.is_only_bodies() => (ROBOT, Target::Urdf, urdf.clone()),
        _ => return None,
    };
    match models::write(target, &text, urdf, &corrections) {
        Ok(written) => {
            let lost = written.lost.iter();
            made.notes
                .extend(lost.map(|lost| format!("Not in {name}, or only nearly: {lost}.")));
            Some((name, written.text))
        }
        Err(error) => {
            made.notes.push(format!("{name} was not written: {error}."));
            None
        }
    }
}

/// Simulates the arm under the commands of the first held-out recording, and adds its errors to the report; nothing where
/// no commands are named, where nothing is corrected, or where the efforts are not in N m.
fn rollout(
    request: &Request,
    kept: &Kept,
    outcome: &mut Outcome,
    made: &mut Made,
) -> Option<Rollout> {
    let topic = request.command_topic.as_ref()?;
    let is_torque = request.cell.facts.effort_unit == EffortUnit::Nm;
    let corrections = Corrections::of(&kept.model, &outcome.terms, &outcome.report.findings);
    if !kept.bodies || !is_torque || !outcome.report.hands_out_twin() || corrections.is_empty() {
        return None;
    }
    let picture = outcome.pictures.iter().find(|picture| picture.held_out)?;
    let mut named = request.holdout.iter().chain(&request.fit);
    let path = &named.find(|named| named.name == picture.recording)?.path;
    let joints = &request.cell.facts.joint_names;
    let simulated = Series::of_commands(path, topic, joints)
        .map_err(|error| error.to_string())
        .and_then(|commands| {
            let rows = commands_of(&commands, picture, joints.len());
            rollout::simulated(&kept.model, &corrections, picture, &rows)
        });
    match simulated {
        Ok(rollout) => {
            outcome.report.simulated = Some(rollout.errors());
            Some(rollout)
        }
        Err(why) => {
            let note = format!("The arm was not simulated under the recorded commands: {why}.");
            made.notes.push(note);
            None
        }
    }
}

/// The commanded positions at the samples of a picture, row by row; empty if there are none.
fn commands_of(commands: &Series, picture: &RecordingPicture, joints: usize) -> Vec<f64> {
    let (mut from, mut row, mut rows) = (0, vec![0.0; joints], Vec::new());
    let times_s = picture.joints.first().map(|joint| &joint.time_s);
    let is_commanded = !commands.stamp_ns.is_empty();
    for time_s in times_s.into_iter().flatten().filter(|_| is_commanded) {
        let stamp_ns = picture.start_ns + (time_s * 1e9).round() as i64;
        commands.at(stamp_ns, &mut from, &mut row);
        rows.extend_from_slice(&row);
    }
    rows
}

/// Returns the absolute path of a result, for a pipeline file in any folder: its relative paths start at that folder.
fn pasted(out: &Path, name: &str) -> String {
    let path = out.join(name);
    std::path::absolute(&path)
        .unwrap_or(path)
        .display()
        .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_pasted_into_a_pipeline_file_works_wherever_it_lies() {
        let path = pasted(Path::new("cell/explained"), TWIN);
        assert!(Path::new(&path).is_absolute(), "{path}");
        assert!(path.ends_with("/cell/explained/twin.yaml"), "{path}");
    }
}
