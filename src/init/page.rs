//! The page of findings.

use std::fmt::Write as _;
use std::path::Path;

use tauscope_dynamics::Model;
use tauscope_explain::report::{Report, Verdict};
use tauscope_pipeline::cell::{Cell, EffortUnit};
use tauscope_report as html;

use super::folder::Folder;
use super::learn::Learnt;

/// The arm and its recordings as the page shows them.
#[derive(Debug)]
pub struct Seen<'a> {
    /// The arm.
    pub cell: &'a Cell,
    /// Findings about the robot, a sentence each.
    pub of_robot: &'a [String],
    /// Findings about the recordings, a sentence each.
    pub of_recordings: &'a [String],
    /// Rows and parts of recordings that could not be used.
    pub lost: u64,
    /// Whether the pipeline listens to the robot.
    pub is_live: bool,
}

/// Returns the page as Markdown: the recordings, the physics that the twin lacks, the threshold that the detector has
/// learnt, the recordings to add, and the next commands.
pub fn page(folder: &Folder, seen: &Seen<'_>, report: &Report, learnt: &Learnt) -> String {
    let (lost, is_live) = (seen.lost, seen.is_live);
    let mut text = format!("# {}\n", seen.cell.facts.name);
    if !seen.of_robot.is_empty() {
        section(&mut text, "Robot", seen.of_robot);
    }
    section(&mut text, "Recordings", seen.of_recordings);
    if lost > 0 {
        let page = folder.explained().join("report.html");
        let say = format!(
            "{lost} rows or parts of them are not used. The notes of {} list them.",
            page.display()
        );
        list(&mut text, &[say]);
    }

    let mut twin = vec![report.summary.clone()];
    if report.verdict != Verdict::NotEvaluated {
        twin.push(proof(report, seen.cell));
    }
    section(&mut text, "Twin", &twin);
    let findings = html::largest_first(report);
    let findings: Vec<String> = findings.map(|finding| finding.sentence.clone()).collect();
    let page = folder.explained().join("report.html");
    list(&mut text, &first(findings, &page.display().to_string()));

    section(&mut text, "Detector", &[]);
    list(&mut text, &learnt.sentences);

    let motions = report.grouped_motions().into_iter();
    let motions = motions.map(|(sentence, _)| sentence).collect();
    let next = first(motions, &page.display().to_string());
    if !next.is_empty() {
        section(&mut text, "Record next", &[]);
        list(&mut text, &next);
    }

    section(&mut text, "Next steps", &[]);
    list(&mut text, &go_on(folder, report, learnt, is_live));
    text
}

/// Returns the next steps with the folder.
fn go_on(folder: &Folder, report: &Report, learnt: &Learnt, is_live: bool) -> Vec<String> {
    let pipeline = for_a_shell(&folder.pipeline());
    let search = format!(
        "Search recordings for contacts: `tauscope replay RECORDING... --pipeline {pipeline} --out results`."
    );
    let first = if is_live {
        vec![
            format!("Listen to the robot: `tauscope run {pipeline}`."),
            search,
        ]
    } else {
        vec![
            format!("Play a recording through the pipeline: `tauscope run {pipeline}`."),
            search,
            format!(
                "Connect to the live robot: edit `ingest` in {pipeline}; the comment there says how."
            ),
        ]
    };
    let what = if report.verdict == Verdict::NotEvaluated {
        "why the twin was not explained"
    } else if learnt.is_explained {
        "how the twin was corrected"
    } else {
        "what the explanation found, although the detector does not use its twin"
    };
    let page = folder.explained().join("report.html");
    let read = format!("Read {what}: {}.", page.display());
    first.into_iter().chain([read]).collect()
}

/// Quotes a path for a shell.
fn for_a_shell(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-".contains(c);
    if text.chars().all(is_plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// The error on held-out recordings at a joint, before and after the correction, and its unit.
struct JointError<'a> {
    joint: &'a str,
    unit: &'a str,
    before: f64,
    after: f64,
}

/// Describes by joint how much the correction reduces the error on held-out recordings.
fn proof(report: &Report, cell: &Cell) -> String {
    let slides = |joint: &String| {
        let mut joints = cell.model.iter().flat_map(Model::joints);
        joints.any(|known| known.name == *joint && known.slides())
    };
    let (before, after) = (&report.holdout_rms_before, &report.holdout_rms_after);
    let joints = report.joints.iter().zip(before.iter().zip(after));
    let errors = joints.map(|(joint, (&before, &after))| JointError {
        joint,
        unit: match cell.facts.effort_unit {
            EffortUnit::Nm if slides(joint) => "N",
            unit => super::look::words(unit),
        },
        before,
        after,
    });
    told(&errors.collect::<Vec<_>>())
}

/// Formats the errors; a unit that all joints share appears once.
fn told(errors: &[JointError<'_>]) -> String {
    let of_first = errors.first().map_or("", |first| first.unit);
    let is_one = errors.iter().all(|error| error.unit == of_first);
    let parts = errors.iter().map(|error| {
        let JointError {
            joint,
            unit,
            before,
            after,
        } = error;
        let part = format!("{joint} {before:.3} to {after:.3}");
        if is_one {
            part
        } else {
            format!("{part} {unit}")
        }
    });
    let parts: Vec<String> = parts.collect();
    let parts = parts.join(", ");
    if is_one {
        format!("RMS error on recordings that were held out, in {of_first}: {parts}.")
    } else {
        format!("RMS error on recordings that were held out: {parts}.")
    }
}

/// Returns the first few sentences, and where to find the others.
fn first(mut sentences: Vec<String>, others: &str) -> Vec<String> {
    const SHOWN: usize = 6;
    if sentences.len() > SHOWN {
        let more = sentences.len() - SHOWN;
        sentences.truncate(SHOWN);
        sentences.push(format!("{more} more: {others}."));
    }
    sentences
}

fn section(text: &mut String, title: &str, sentences: &[String]) {
    let _ = write!(text, "\n## {title}\n\n");
    for sentence in sentences {
        let _ = writeln!(text, "{sentence}");
    }
}

fn list(text: &mut String, sentences: &[String]) {
    if sentences.is_empty() {
        return;
    }
    if !text.ends_with("\n\n") {
        text.push('\n');
    }
    for sentence in sentences {
        let _ = writeln!(text, "- {sentence}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_that_slides_has_its_error_in_newtons() {
        let error = |joint, unit, before, after| JointError {
            joint,
            unit,
            before,
            after,
        };
        let turns = || error("shoulder", "N m", 1.0, 0.5);
        assert_eq!(
            told(&[turns(), error("lift", "N", 20.0, 3.25)]),
            "RMS error on recordings that were held out: shoulder 1.000 to 0.500 N m, lift 20.000 to 3.250 N."
        );
        assert_eq!(
            told(&[turns()]),
            "RMS error on recordings that were held out, in N m: shoulder 1.000 to 0.500."
        );
    }
}
