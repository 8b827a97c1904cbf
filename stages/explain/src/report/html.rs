//! `report.html`: what was found as a page for whoever runs the cell. One file that needs nothing else: no script,
//! no font, no picture from elsewhere; light or dark as the reader's screen is, and good on paper.
//!
//! Everything that comes from a file or a name is escaped by the template; the pictures are SVG in the page and take
//! their colours from its style sheet (Okabe and Ito's, which the colour-blind can tell apart).

pub mod chart;
mod effects;
mod findings;
mod number_format;
mod proof;
mod rivals;
mod traces;

use std::collections::BTreeMap;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::report::schema::{RecordingPicture, Report, Verdict};

use self::number_format::{almost_all, effort_unit};

/// The style sheet of our pages.
pub const STYLE: &str = include_str!("html/style.css");

/// Nothing may be loaded and nothing may run: also if a name in a file tries to.
pub const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";

/// A verdict with more characters than this is set smaller.
/// Tuned: by eye, for the layout of the page.
const LONG: usize = 130;

/// The page.
///
/// `pictures` are the recordings to draw, none if there are none; the first stamp among them counts as the start of the
/// session. `provenance` stands at the foot as it is: by what was the report made, of which files, when.
pub fn page(
    report: &Report,
    pictures: &[RecordingPicture],
    provenance: &BTreeMap<String, String>,
) -> String {
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
        Section::of("rivals", "Rivals, and why not", rivals::rejected(report)),
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
                    (footer(report, provenance))
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

/// Class and sign of a verdict: it must not hang on colour alone.
fn verdict_badge(verdict: Verdict) -> (&'static str, &'static str) {
    match verdict {
        Verdict::Explained => ("explained", "✓"),
        Verdict::NothingMissing => ("nothing", "✓"),
        Verdict::UnknownRemains => ("unknown", "?"),
        Verdict::NotEvaluated => ("none", "–"),
    }
}

fn header(report: &Report) -> Markup {
    let (class, sign) = verdict_badge(report.verdict);
    let reason = report
        .reason
        .as_deref()
        .filter(|reason| !reason.trim().is_empty() && !report.summary.contains(reason));
    let facts = facts(report);
    html! {
        header class={ "verdict " (class) } {
            p.kicker {
                span.badge { span.sign aria-hidden="true" { (sign) } " " (verdict_text(report.verdict)) }
                span.case { (report.case) }
            }
            h1.long[report.summary.chars().count() > LONG] { (report.summary) }
            @if let Some(reason) = reason { p.reason { "Why: " (reason) } }
            @if !facts.is_empty() {
                dl.facts {
                    @for (number, text) in facts { div { dt { (number) } dd { (text) } } }
                }
            }
        }
    }
}

/// What it comes to, in numbers.
fn facts(report: &Report) -> Vec<(String, String)> {
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
        facts.push((count.to_string(), text.to_owned()));
        let share = proof::recovered(&rows);
        if share.is_finite() && !proof::is_elsewhere(report) {
            let text = "of the squared error is gone on held-out data, which was never fitted";
            facts.push((almost_all(share.max(0.0)), text.to_owned()));
        }
    }
    let known = rows.iter().filter(|row| row.over_noise().is_finite());
    let (known, quiet) = known.fold((0, 0), |(known, quiet), row| {
        (known + 1, quiet + usize::from(row.is_quiet()))
    });
    if known > 0 {
        let text = format!(
            "joints at the noise floor{}",
            if report.findings.is_empty() {
                ""
            } else {
                " after the correction"
            }
        );
        facts.push((format!("{quiet} of {known}"), text));
    }
    facts
}

fn footer(report: &Report, provenance: &BTreeMap<String, String>) -> Markup {
    let unit = effort_unit(&report.effort_unit);
    html! {
        footer {
            details {
                summary { "How to read this page" }
                dl.words {
                    dt { "Twin" } dd { "The model of the arm: from a motion it says which effort (" (unit) ") each joint should need." }
                    dt { "Mismatch, residual" } dd { "Measured effort minus the twin’s effort." }
                    dt { "Held-out" } dd { "Recordings, or parts of them, that no number on this page was fitted to. Errors on them show whether the correction predicts." }
                    dt { "RMS" } dd { "Root of the mean square of the residual over all samples as recorded, not filtered and not trimmed." }
                    dt { "Noise floor" } dd { "RMS of the white noise in the measured effort. No model can come below it." }
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
