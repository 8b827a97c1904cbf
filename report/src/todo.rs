//! Next steps: file to load, parts to inspect, motion to record; and the inputs of the report.

use maud::{Markup, html};
use tauscope_dynamics::terms::UNKNOWN;
use tauscope_dynamics::terms::words::counted;

use super::Around;
use super::effects::effect_title;
use super::groups::{self, Group};
use super::number_format::{almost_all, percent};
use super::proof;
use super::rivals::trajectory;
use tauscope_explain::report::look_at as part;
use tauscope_explain::report::{Finding, NextMotion, Report, Rival, Verdict};
use tauscope_explain::report::{UNCHANGED, error_left};

/// Number of parts that are listed for inspection.
/// Layout: by eye; no number depends on it.
const PARTS: usize = 4;

/// The box with the next steps.
pub(super) fn todo(report: &Report, around: &Around<'_>, robot: Option<Markup>) -> Markup {
    html! {
        section.todo id="now" {
            h2 { "What to do now" }
            div.with-robot {
                dl.steps {
                    div { dt { "Load" } dd { (load(report, around)) } }
                    div { dt { "Look at" } dd { (look_at(report)) } }
                    div { dt { "Record next" } dd { (record(report)) } }
                }
                @if let Some(robot) = robot { (robot) }
            }
            (made_from(around))
        }
    }
}

/// Whether a finding is part of the corrected twin, because it lasts to the end.
fn lasts(finding: &Finding) -> bool {
    finding.t_end.is_none()
}

/// The file to load in the pipeline, or the reason why there is none.
fn load(report: &Report, around: &Around<'_>) -> Markup {
    let Some(twin) = around
        .twin
        .as_deref()
        .filter(|_| report.verdict != Verdict::NotEvaluated)
    else {
        return html! {
            p {
                @if report.is_of_mended() {
                    "Nothing yet. Correct the recordings or their description first, then run explain again."
                } @else { "Nothing. There is no corrected twin without a verdict." }
            }
        };
    };
    let left = error_left(&report.holdout_rms_before, &report.holdout_rms_after);
    let in_pipeline = html! {
        pre { code { "twin: {model: " (yaml(twin)) "}" } }
        @if let Some(robot) = &around.corrected_robot {
            p.muted { "Or give " code { (yaml(robot)) } " as the cell’s " code { "robot:" } " in its place. With both, the correction would count twice." }
        }
    };
    if report.findings.iter().any(lasts) {
        if left >= UNCHANGED && !proof::is_elsewhere(report) {
            return html! {
                p { "Nothing yet. On recordings that were not fitted, " code { (twin) } " is no better than the twin as it was. Record more first." }
            };
        }
        return html! {
            p {
                "The corrected twin, in your pipeline file"
                @if left < UNCHANGED { ". It leaves " (percent(left)) " of the error (RMS) on recordings that were not fitted" }
                ":"
            }
            (in_pipeline)
        };
    }
    html! {
        p {
            @if report.findings.is_empty() { "The twin can stay as it is. " }
            @else { "The findings are temporary, so the twin’s physics can stay as it is. " }
            "This file adds the noise and the scores that detectors need for their thresholds:"
        }
        (in_pipeline)
    }
}

/// A path as a YAML string, quoted if it has characters that are special in YAML.
fn yaml(path: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+@".contains(c);
    if path.chars().all(plain) {
        path.to_owned()
    } else {
        format!("'{}'", path.replace('\'', "''"))
    }
}

/// Parts of the arm to inspect, the largest effort first.
fn look_at(report: &Report) -> Markup {
    let groups = groups::of(report);
    let all: Vec<&Finding> = groups
        .iter()
        .flat_map(|group| group.findings.iter().copied())
        .collect();
    // The largest finding of each place.
    let of_group = |group: &Group<'_>| {
        let mut findings = group.findings.iter().filter(|f| !may_be_nothing(f));
        findings.find_map(|finding| {
            Some((
                part(finding)?,
                finding.known_as().to_owned(),
                finding.confidence,
            ))
        })
    };
    let parts: Vec<(String, String, f64)> = groups.iter().filter_map(of_group).collect();
    if parts.is_empty() {
        return html! {
            p {
                @if all.is_empty() { "Nothing: no effect was found." }
                @else { "Nothing: the findings are normal for such an arm, not faults." }
            }
        };
    }
    html! {
        ul {
            @for (text, effect, confidence) in parts.iter().take(PARTS) {
                li {
                    (text)
                    span.muted { " (" (effect_title(effect)) ", confidence " (almost_all(*confidence)) ")" }
                }
            }
        }
        @if parts.len() > PARTS { p.muted { (counted(parts.len() - PARTS, "more place")) " with smaller efforts: see below." } }
    }
}

/// Whether the intervals of all sizes include zero: such a finding needs no inspection. Times are not sizes.
fn may_be_nothing(finding: &Finding) -> bool {
    let of = |name: &str, [low, high]: [f64; 2]| {
        let is_change = name.contains("extra") || name.contains("delta");
        (!name.ends_with("_s")).then_some((is_change, low <= 0.0 && high >= 0.0))
    };
    let sizes = finding.intervals_95.iter();
    let sizes: Vec<(bool, bool)> = sizes.filter_map(|(name, i)| of(name, *i)).collect();
    // If a finding has parameters of a change, only these count, not the baseline that changed.
    let changes = sizes.iter().any(|(is_change, _)| *is_change);
    let mut found = sizes
        .iter()
        .filter(|(is_change, _)| *is_change || !changes)
        .peekable();
    found.peek().is_some() && found.all(|(_, may_be_zero)| *may_be_zero)
}

/// The most informative motion to record, or that none is needed.
fn record(report: &Report) -> Markup {
    if let Some(first) = most_wanted(report) {
        return html! {
            p { (first.sentence) " " (trajectory(first)) }
            @if report.next_motions.len() > 1 {
                p.muted { a href="#next" { (counted(report.next_motions.len() - 1, "more motion")) } }
            }
        };
    }
    let left: Vec<&str> = (proof::rows(report).iter())
        .filter(|row| row.is_left())
        .map(|row| row.joint)
        .collect();
    let text = match report.verdict {
        Verdict::NotEvaluated => {
            "Repeat the same motion after the cause given above is corrected.".to_owned()
        }
        Verdict::UnknownRemains => {
            let unknown = (report.findings.iter()).filter(|f| f.known_as() == UNKNOWN.name);
            let mut joints: Vec<&str> = unknown.filter_map(|f| f.joint.as_deref()).collect();
            joints.extend(
                left.iter()
                    .filter(|joint| !joints.contains(joint))
                    .copied()
                    .collect::<Vec<_>>(),
            );
            let which = if joints.is_empty() {
                "every joint".to_owned()
            } else {
                joints.join(", ")
            };
            format!(
                "Move {which} over the whole range, slowly and fast, in both directions, in several poses of the arm; then explain \
                 these recordings together with today’s."
            )
        }
        _ if !left.is_empty() => format!(
            "The residual exceeds the noise at {}: move {} over the whole range, slowly and fast, in both directions.",
            left.join(", "),
            if left.len() == 1 { "it" } else { "them" }
        ),
        _ if (report.findings.iter()).any(|finding| !finding.equivalent_to.is_empty()) => {
            "No known motion would distinguish the rivals that remain; the findings below list these rivals."
                .to_owned()
        }
        _ => "Nothing more is needed.".to_owned(),
    };
    html! { p { (text) } }
}

/// The motion of the finding with the largest effort among those that have a motion.
fn most_wanted(report: &Report) -> Option<&NextMotion> {
    let groups = groups::of(report);
    let findings = groups.iter().flat_map(|group| group.findings.iter());
    let rank: Vec<(&str, Option<&str>)> = findings
        .map(|finding| (finding.effect.as_str(), finding.joint.as_deref()))
        .collect();
    let place = |motion: &&NextMotion| {
        let winner = motion.separates.first();
        let of = |w: &Rival| {
            let own = (w.effect.as_str(), w.joint.as_deref());
            rank.iter().position(|known| *known == own)
        };
        winner.and_then(of).unwrap_or(usize::MAX)
    };
    report.next_motions.iter().min_by_key(place)
}

/// Date and inputs of the report.
fn made_from(around: &Around<'_>) -> Markup {
    let list = |paths: &[String]| -> Markup {
        html! {
            @for (index, path) in paths.iter().enumerate() {
                @if index > 0 { ", " }
                code { (path) }
            }
        }
    };
    html! {
        p.inputs {
            @if !around.date.is_empty() { "Made " (around.date) ". " }
            @if let Some(robot) = &around.robot { "Robot: " code { (robot) } ". " }
            @if let Some(start) = &around.start { "Started from: " code { (start) } ". " }
            @if !around.fit.is_empty() { "Fitted: " (list(&around.fit)) ". " }
            @if !around.holdout.is_empty() { "Held out: " (list(&around.holdout)) "." }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(intervals: &[(&str, [f64; 2])]) -> Finding {
        let json = serde_json::json!({
            "effect": "temperature_viscous", "joint": "joint1", "link": null, "parameters": {},
            "intervals_95": intervals.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
            "confidence": 0.96, "recording": null, "t_start": null, "t_end": null, "explains": 0.01,
            "equivalent_to": [], "sentence": "",
        });
        match serde_json::from_value(json) {
            Ok(finding) => finding,
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn nobody_is_sent_to_what_may_be_nothing() {
        let warm = ("viscous_warm_nms_per_rad", [19.4, 35.6]);
        let time = ("time_constant_s", [1.2, 4.8]);
        let extra = |low| ("viscous_extra_cold_nms_per_rad", [low, 75.6]);
        assert!(may_be_nothing(&finding(&[warm, time, extra(0.0)])));
        assert!(!may_be_nothing(&finding(&[warm, time, extra(3.0)])));
        let mass = ("mass_kg", [1.2, 1.6]);
        let com = ("com_x_m", [-0.1, 0.1]);
        assert!(!may_be_nothing(&finding(&[mass, com])));
        assert!(!may_be_nothing(&finding(&[])));
    }

    #[test]
    fn a_path_is_pasted_as_a_text() {
        assert_eq!(yaml("/cells/a-1/twin.yaml"), "/cells/a-1/twin.yaml");
        assert_eq!(yaml("/it's, mine/twin.yaml"), "'/it''s, mine/twin.yaml'");
    }
}
