#![doc = include_str!("../README.md")]
//!
//! `report.html`: what was found as a page for whoever runs the cell. One file that needs nothing else: no script,
//! no font, no picture from elsewhere; light or dark as the reader's screen is, and good on paper.
//!
//! Everything that comes from a file or a name is escaped by the template; the pictures are SVG in the page and take
//! their colours from its style sheet (Okabe and Ito's, which the colour-blind can tell apart).

pub mod chart;
mod effects;
mod findings;
mod groups;
pub mod models;
mod number_format;
mod proof;
mod rivals;
mod robot;
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

/// The style sheet of our pages.
pub const STYLE: &str = include_str!("style.css");

/// Nothing may be loaded and nothing may run: also if a name in a file tries to.
pub const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// A verdict with more characters than this is set smaller.
/// Layout: by eye; no number depends on it.
const LONG: usize = 130;

/// What the page tells beside the report. Paths are as the reader would type them; what is not there is left out.
#[derive(Debug, Clone, Default)]
pub struct Around<'a> {
    /// By what the report was made, of which files: stands at the foot as it is.
    pub provenance: BTreeMap<String, String>,
    /// The day on which it was made.
    pub date: String,
    /// The robot, to be drawn.
    pub model: Option<&'a Model>,
    /// The URDF.
    pub robot: Option<String>,
    /// The corrected twin that was started from.
    pub start: Option<String>,
    /// Recordings that were fitted.
    pub fit: Vec<String>,
    /// Recordings that were not.
    pub holdout: Vec<String>,
    /// The corrected twin, if one was written.
    pub twin: Option<String>,
    /// The corrected robot, if one was written.
    pub corrected_robot: Option<String>,
}

pub use groups::largest_first;

/// The page.
///
/// `pictures` are the recordings to draw, none if there are none; the first stamp among them counts as the start of the
/// session.
pub fn page(report: &Report, pictures: &[RecordingPicture], around: &Around<'_>) -> String {
    let robot = (around.model).and_then(|model| robot::picture(report, model, pictures));
    let sections: Vec<Section> = [
        Section::of(
            "missing",
            "What the twin leaves out",
            findings::cards(report),
        ),
        Section::of("where", "Where the mismatch sits", proof::located(report)),
        Section::of("proof", "Before and after", proof::before_and_after(report)),
        Section::of(
            "pictures",
            "Joint by joint",
            traces::joints(report, pictures),
        ),
        Section::of("rivals", "Rivals", rivals::rejected(report)),
        Section::of("next", "What to record next", rivals::next(report)),
        Section::of(
            "hidden",
            "What could have hidden",
            rivals::undetectable(report),
        ),
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
    /// Whether it speaks for the verdict; else it does not have its colour.
    is_good: bool,
}

/// What it comes to, in numbers.
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
            let text = "of the error (RMS) is left on held-out data, which was never fitted";
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
                    dt { "Twin" } dd { "The model of the arm: from a motion it says which effort (" (unit) ") each joint should need." }
                    dt { "Mismatch, residual" } dd { "Measured effort minus the twin’s effort." }
                    dt { "Held-out" } dd { "Recordings, or parts of them, that no number on this page was fitted to. Errors on them show whether the correction predicts." }
                    dt { "RMS" } dd { "Root of the mean square of the residual over all samples as recorded, not filtered and not trimmed." }
                    dt { "Noise" } dd { "RMS of the white noise in the measured effort, estimated from its fastest changes on the fitted recordings. It is an estimate: what changes from sample to sample and yet follows the motion counts as noise, too." }
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
