//! Rejected rivals with their reasons, motions to record next, detection limits, and notes.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::effects::{effect_at, effect_title, place};
use super::findings::list;
use super::number_format::{number_text, parameter_in};
use super::proof;
use tauscope_explain::report::{NextMotion, Rejected, Report, Undetectable, Verdict};

/// Number of rejected rivals in the summary line.
/// Layout: by eye; no number depends on it.
const NAMES: usize = 4;

/// The rejected rivals in one line, with the reasons in a folded table.
pub(super) fn rejected(report: &Report) -> Option<Markup> {
    if report.rejected.is_empty() {
        return None;
    }
    let name =
        |rival: &Rejected| effect_at(&rival.effect, rival.joint.as_deref(), rival.link.as_deref());
    let first: Vec<String> = report.rejected.iter().take(NAMES).map(name).collect();
    let more = report.rejected.len() - first.len();
    Some(html! {
        details {
            summary {
                "Considered but not named: " (first.join("; "))
                @if more > 0 { "; and " (more) " more" }
                " (reasons)"
            }
            (rejected_table(&report.rejected))
        }
    })
}

fn rejected_table(rivals: &[Rejected]) -> Markup {
    html! {
        table {
            thead { tr { th { "Considered" } th { "Where" } th { "Why it was not named" } } }
            tbody {
                @for rival in rivals {
                    tr {
                        th scope="row" { (effect_title(&rival.effect)) }
                        td { (place_or_all(rival.joint.as_deref(), rival.link.as_deref())) }
                        td { (rival.reason) }
                    }
                }
            }
        }
    }
}

fn place_or_all(joint: Option<&str>, link: Option<&str>) -> String {
    place(joint, link).unwrap_or_else(|| "whole arm".to_owned())
}

/// Motions to record next, or that none is needed.
pub(super) fn next(report: &Report) -> Option<Markup> {
    if report.next_motions.is_empty() {
        let undecided = report.findings.iter().any(|f| !f.equivalent_to.is_empty());
        if proof::rows(report).iter().any(proof::Row::is_left) {
            return None;
        }
        let text = match report.verdict {
            Verdict::Explained if !undecided => {
                "Nothing more is needed to name the findings: this data distinguishes them from every rival considered."
            }
            Verdict::NothingMissing => {
                "Nothing is needed. To find weaker effects than the detection limits below, record longer, faster and with a load."
            }
            _ => return None,
        };
        return Some(html! { p { (text) } });
    }
    let groups = report.grouped_motions();
    Some(
        html! { ol.next { @for (sentence, motions) in &groups { (next_motion(sentence, motions)) } } },
    )
}

fn next_motion(sentence: &str, motions: &[&NextMotion]) -> Markup {
    html! {
        li {
            p { (sentence) }
            @for motion in motions {
                p.figures {
                    @if !motion.separates.is_empty() {
                        span { "Decides between " (list(motion.separates.iter().map(|rival| {
                            effect_at(&rival.effect, rival.joint.as_deref(), rival.link.as_deref())
                        }))) }
                    }
                    span { (trajectory(motion)) }
                }
            }
        }
    }
}

/// The file with a motion, if there is one.
pub(super) fn trajectory(motion: &NextMotion) -> Markup {
    html! {
        @if let Some(file) = &motion.trajectory {
            "Trajectory: "
            @if is_plain_name(file) { a href=(file) { (file) } } @else { code { (file) } }
        }
    }
}

/// Whether a name is a relative path to a file, and nothing else that a link could mean.
fn is_plain_name(name: &str) -> bool {
    let plain =
        |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'_' | b'-' | b'/');
    !name.is_empty() && !name.starts_with('/') && name.bytes().all(plain)
}

/// The smallest effects that would have been found: one row for each effect, one column for each joint.
pub(super) fn undetectable(report: &Report) -> Option<Markup> {
    if report.undetectable.is_empty() {
        return None;
    }
    let (of_joints, others): (Vec<_>, Vec<_>) = report.undetectable.iter().partition(|hidden| {
        hidden
            .joint
            .as_ref()
            .is_some_and(|joint| report.joints.contains(joint))
    });
    Some(html! {
        p.lead { "The smallest effect that this data would have shown. Smaller effects may be present." }
        details {
            summary { "Show the limits by effect" }
            @if !of_joints.is_empty() { (matrix(report, &of_joints)) }
            @if !others.is_empty() { (others_table(&others)) }
        }
    })
}

fn matrix(report: &Report, hidden: &[&Undetectable]) -> Markup {
    let mut seen = BTreeSet::new();
    let rows: Vec<(&str, &str, bool, bool)> = hidden
        .iter()
        .flat_map(|hidden| {
            let parameters = hidden.smallest_findable.keys();
            parameters.map(|name| {
                let units = (hidden.in_amperes, hidden.slides);
                (hidden.effect.as_str(), name.as_str(), units.0, units.1)
            })
        })
        .filter(|row| seen.insert(*row))
        .collect();
    let cell = |(effect, name, amperes, slides): (&str, &str, bool, bool), joint: &String| {
        hidden
            .iter()
            .filter(|hidden| hidden.effect == effect && hidden.joint.as_ref() == Some(joint))
            .filter(|hidden| (hidden.in_amperes, hidden.slides) == (amperes, slides))
            .find_map(|hidden| hidden.smallest_findable.get(name).copied())
    };
    html! {
        div.wide {
            table.matrix {
                thead { tr { th { "Effect" } th { "Found from" } @for joint in &report.joints { th.num { (joint) } } } }
                tbody {
                    @for row in rows {
                        @let (label, unit) = parameter_in(row.1, row.2, row.3);
                        tr {
                            th scope="row" { (effect_title(row.0)) }
                            td { (label) @if !unit.is_empty() { " [" (unit) "]" } }
                            @for joint in &report.joints {
                                td.num { @if let Some(least) = cell(row, joint) { (number_text(least)) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn others_table(hidden: &[&Undetectable]) -> Markup {
    html! {
        table {
            thead { tr { th { "Effect" } th { "Where" } th { "Found from" } } }
            tbody {
                @for hidden in hidden {
                    tr {
                        th scope="row" { (effect_title(&hidden.effect)) }
                        td { (place_or_all(hidden.joint.as_deref(), hidden.link.as_deref())) }
                        td {
                            @for (index, (name, least)) in hidden.smallest_findable.iter().enumerate() {
                                @let (label, unit) = parameter_in(name, hidden.in_amperes, hidden.slides);
                                @if index > 0 { ", " }
                                (label) " " (number_text(*least)) " " (unit)
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Notes of the report.
pub(super) fn notes(report: &Report) -> Option<Markup> {
    (!report.notes.is_empty()).then(|| {
        html! { ul.notes { @for note in &report.notes { li { (note) } } } }
    })
}
