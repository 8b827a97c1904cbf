//! What was found, on one page.

use std::fmt::Write as _;
use std::path::Path;

use tauscope_explain::html;
use tauscope_explain::report::{Report, Verdict};

use super::folder::Folder;
use super::learn::Learnt;
use super::look::Looked;

/// The page as Markdown: what the recordings are, what the twin leaves out, what the detector has learnt, what to
/// record next, and how to go on. `is_live` tells that the pipeline listens to the robot, `lost` how many rows could not
/// be used.
pub fn page(
    folder: &Folder,
    looked: &Looked,
    report: &Report,
    learnt: &Learnt,
    is_live: bool,
    lost: u64,
) -> String {
    let mut text = format!("# {}\n", looked.cell.facts.name);
    section(&mut text, "Recordings", &looked.sentences);
    if lost > 0 {
        let page = folder.explained().join("report.html");
        let say = format!(
            "{lost} rows or parts of them could not be used: {} says which.",
            page.display()
        );
        list(&mut text, &[say]);
    }

    let mut twin = vec![report.summary.clone()];
    if report.verdict != Verdict::NotEvaluated {
        twin.push(proof(report));
    }
    section(&mut text, "Twin", &twin);
    let findings = html::largest_first(report);
    let findings: Vec<String> = findings.map(|finding| finding.sentence.clone()).collect();
    let page = folder.explained().join("report.html");
    list(&mut text, &first(findings, &page.display().to_string()));

    section(&mut text, "Detector", &[]);
    list(&mut text, &learnt.sentences);

    let next = first(motions(report), &page.display().to_string());
    if !next.is_empty() {
        section(&mut text, "Record next", &[]);
        list(&mut text, &next);
    }

    section(&mut text, "Go on", &[]);
    list(&mut text, &go_on(folder, report, learnt, is_live));
    text
}

/// What to do with the folder.
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
            format!("Listen to the robot: change `ingest` in {pipeline} as its comment says."),
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

/// A path as a shell takes it.
fn for_a_shell(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-".contains(c);
    if text.chars().all(is_plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// The motions to record next; a motion that is the same for several joints is told once.
fn motions(report: &Report) -> Vec<String> {
    // Stands for the joint in a sentence.
    const ITS: &str = "joint \0 ";
    let mut told: Vec<(String, Vec<&str>)> = Vec::new();
    for motion in &report.next_motions {
        let joint = motion.separates.first().and_then(|it| it.joint.as_deref());
        let joint = joint.unwrap_or_default();
        let sentence = motion.sentence.replace(&format!("joint {joint} "), ITS);
        match told.iter_mut().find(|(same, _)| *same == sentence) {
            Some((_, joints)) if joints.contains(&joint) => {}
            Some((_, joints)) => joints.push(joint),
            None => told.push((sentence, vec![joint])),
        }
    }
    let told = told.into_iter();
    told.map(|(sentence, joints)| match &joints[..] {
        all if all.len() > 1 && all.len() == report.joints.len() => {
            sentence.replace(ITS, "every joint ")
        }
        [first @ .., last] if !first.is_empty() => {
            let all = format!("each of the joints {} and {last} ", first.join(", "));
            sentence.replace(ITS, &all)
        }
        _ => sentence.replace(ITS, &format!("joint {} ", joints.concat())),
    })
    .collect()
}

/// How much smaller the error of the held-out recordings got, joint by joint.
fn proof(report: &Report) -> String {
    let joints = report.joints.iter();
    let errors = report
        .holdout_rms_before
        .iter()
        .zip(&report.holdout_rms_after);
    let parts = joints
        .zip(errors)
        .map(|(joint, (before, after))| format!("{joint} {before:.3} to {after:.3}"));
    let parts: Vec<String> = parts.collect();
    format!(
        "RMS error on recordings that were held out, in {}: {}.",
        report.effort_unit,
        parts.join(", ")
    )
}

/// The first few of many sentences, and where the others are.
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
