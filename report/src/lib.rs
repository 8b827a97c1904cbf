#![doc = include_str!("../README.md")]
//!
//! `report.html`: the findings as a page for the person who runs the cell. The file is self-contained: no script, no
//! external font or picture. It is light or dark like the reader's screen, and can be printed.
//!
//! The template escapes every text that comes from a file or a name. The pictures are inline SVG with the colours of
//! the style sheet: the palette of Okabe and Ito, which colour-blind readers can distinguish.

pub mod chart;
mod effects;
mod findings;
mod groups;
pub mod models;
mod number_format;
mod proof;
mod rivals;
mod robot;
pub mod rollout;
mod todo;
mod tone;
mod traces;

use std::collections::BTreeMap;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use tauscope_dynamics::Model;

use tauscope_explain::report::error_left;
use tauscope_explain::report::{RecordingPicture, Report, Verdict};

use self::number_format::percent;
use self::tone::Tone;

/// The style sheet of the pages.
pub const STYLE: &str = include_str!("style.css");

/// Content security policy: nothing may be loaded or executed, even if a name in a file contains markup.
pub const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// Number of characters above which the verdict is set in smaller type.
/// Layout: by eye; no number depends on it.
const LONG: usize = 130;

/// Content of the page in addition to the report. Paths are as the reader would type them. Empty fields are omitted.
#[derive(Debug, Clone, Default)]
pub struct Around<'a> {
    /// Program and input files of the report, by label; printed unchanged at the foot.
    pub provenance: BTreeMap<String, String>,
    /// Date of the report.
    pub date: String,
    /// Model of the robot, for the picture.
    pub model: Option<&'a Model>,
    /// Path of the URDF.
    pub robot: Option<String>,
    /// Path of the corrected twin that the explanation started from.
    pub start: Option<String>,
    /// Paths of the fitted recordings.
    pub fit: Vec<String>,
    /// Paths of the held-out recordings.
    pub holdout: Vec<String>,
    /// Path of the corrected twin, if one was written.
    pub twin: Option<String>,
    /// Path of the corrected robot, if one was written.
    pub corrected_robot: Option<String>,
    /// Motion of the simulated arm under the recorded commands, if there are any.
    pub rollout: Option<&'a rollout::Rollout>,
}

pub use groups::largest_first;

/// Renders the page.
///
/// `pictures` are the recordings to draw, possibly none. Their first stamp is treated as the start of the session.
pub fn page(report: &Report, pictures: &[RecordingPicture], around: &Around<'_>) -> String {
    let robot = (around.model).and_then(|model| robot::picture(report, model, pictures));
    let sections: Vec<Section> = [
        Section::of(
            "missing",
            "What the twin leaves out",
            findings::cards(report),
        ),
        Section::of("where", "Where the mismatch is", proof::located(report)),
        Section::of("proof", "Before and after", proof::before_and_after(report)),
        Section::of(
            "rollout",
            "Simulated under the same commands",
            around.rollout.map(rollout::section),
        ),
        Section::of(
            "pictures",
            "Joint by joint",
            traces::joints(report, pictures),
        ),
        Section::of("rivals", "Rivals", rivals::rejected(report)),
        Section::of("next", "What to record next", rivals::next(report)),
        Section::of("hidden", "Detection limits", rivals::undetectable(report)),
        Section::of("notes", "Notes", rivals::notes(report)),
    ]
    .into_iter()
    .flatten()
    .collect();
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (report.case) ": " (verdict_text(report.verdict)) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    (header(report))
                    (todo::todo(report, around, robot))
                    @if sections.len() > 1 {
                        nav {
                            @for section in &sections { a href={ "#" (section.id) } { (section.title) } }
                        }
                    }
                    @for section in &sections {
                        section id=(section.id) {
                            h2 { (section.title) }
                            (section.body)
                        }
                    }
                    (footer(report, &around.provenance))
                }
            }
        }
    }
    .into_string()
}

struct Section {
    id: &'static str,
    title: &'static str,
    body: Markup,
}

impl Section {
    fn of(id: &'static str, title: &'static str, body: Option<Markup>) -> Option<Self> {
        body.map(|body| Self { id, title, body })
    }
}

fn verdict_text(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Explained => "Explained",
        Verdict::NothingMissing => "Nothing missing",
        Verdict::UnknownRemains => "Something unknown remains",
        Verdict::NotEvaluated => "Not evaluated",
    }
}

fn header(report: &Report) -> Markup {
    let Tone { class, sign, text } = Tone::of(report);
    let reason = report
        .reason
        .as_deref()
        .filter(|reason| !reason.trim().is_empty() && !report.summary.contains(reason));
    let facts = facts(report);
    html! {
        header class={ "verdict " (class) } {
            p.kicker {
                span.badge { span.sign aria-hidden="true" { (sign) } " " (text) }
                span.case { (report.case) }
            }
            h1.long[report.summary.chars().count() > LONG] { (report.summary) }
            @if let Some(reason) = reason { p.reason { "Why: " (reason) } }
            @if !facts.is_empty() {
                dl.facts {
                    @for Fact { number, text, is_good } in facts {
                        div.plain[!is_good] { dt { (number) } dd { (text) } }
                    }
                }
            }
        }
    }
}

/// A number under the verdict.
struct Fact {
    number: String,
    text: String,
    /// Whether the number supports the verdict and so has its colour.
    is_good: bool,
}

/// The key figures under the verdict.
fn facts(report: &Report) -> Vec<Fact> {
    let fact = |number: String, text: &str, is_good| Fact {
        number,
        text: text.to_owned(),
        is_good,
    };
    let mut facts = Vec::new();
    if report.verdict == Verdict::NotEvaluated {
        return facts;
    }
    let rows = proof::rows(report);
    if !report.findings.is_empty() {
        let count = report.findings.len();
        let text = if count == 1 {
            "effect found"
        } else {
            "effects found"
        };
        facts.push(fact(count.to_string(), text, true));
        let left = error_left(&report.holdout_rms_before, &report.holdout_rms_after);
        if left.is_finite() && !proof::is_elsewhere(report) {
            let text = "of the error (RMS) remains on held-out data, which was not fitted";
            facts.push(fact(percent(left), text, true));
        }
    }
    let known = rows.iter().filter(|row| row.over_noise().is_finite());
    let (known, quiet) = known.fold((0, 0), |(known, quiet), row| {
        (known + 1, quiet + usize::from(row.is_quiet()))
    });
    if known > 0 {
        let text = format!(
            "joints at the noise of the measurement{}",
            if report.findings.is_empty() {
                ""
            } else {
                " after the correction"
            }
        );
        facts.push(fact(format!("{quiet} of {known}"), &text, quiet == known));
    }
    facts
}

fn footer(report: &Report, provenance: &BTreeMap<String, String>) -> Markup {
    let unit = report.effort_unit_at(None);
    html! {
        footer {
            details {
                summary { "How to read this page" }
                dl.words {
                    dt { "Twin" } dd { "The model of the arm: it computes the effort (" (unit) ") that a motion requires of each joint." }
                    dt { "Mismatch, residual" } dd { "Measured effort minus the twin’s effort." }
                    dt { "Held-out" } dd { "Recordings, or parts of them, that no number on this page was fitted to. Errors on them show whether the correction predicts." }
                    dt { "RMS" } dd { "Root of the mean square of the residual over all samples as recorded, not filtered and not trimmed." }
                    dt { "Noise" } dd { "RMS of the white noise in the measured effort, estimated from its fastest changes on the fitted recordings. It is an estimate: changes from sample to sample are treated as noise even if they follow the motion." }
                    dt { "95 % interval" } dd { "The true value lies in it in 95 of 100 cases like this one." }
                }
            }
            @if !provenance.is_empty() {
                details.provenance open {
                    summary { "Made from" }
                    dl { @for (key, value) in provenance { dt { (key) } dd { (value) } } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
