//! The findings, one card each.

use maud::{Markup, html};
use tauscope_dynamics::terms::UNKNOWN;

use super::chart::{Axis, r};
use super::effects::{effect_at, effect_meaning, effect_title, place};
use super::groups;
use super::number_format::{almost_all, number_text, parameter_in, percent, value, with_digits_of};
use super::proof;
use tauscope_explain::report::error_left;
use tauscope_explain::report::{Finding, Report, Verdict};

/// One card for each finding, or a sentence that there is none.
pub(super) fn cards(report: &Report) -> Option<Markup> {
    if report.verdict == Verdict::NotEvaluated && report.findings.is_empty() {
        return None;
    }
    let groups = groups::of(report);
    Some(html! {
        @if report.findings.is_empty() {
            p {
                @if report.verdict == Verdict::NothingMissing && !proof::rows(report).iter().any(proof::Row::is_left) {
                    "Nothing. The residual between recordings and twin is noise, as far as this data shows."
                } @else {
                    "Nothing was named."
                }
            }
        }
        @if report.findings.len() > 1 {
            p.lead {
                "Findings by joint and link, the largest effort first."
                @if let Some(units) = units(report) { " " (units) }
                @if let Some(shares) = shares(report) { " " (shares) }
            }
        }
        @for group in &groups {
            @if report.findings.len() > 1 {
                h3.group {
                    (group.title())
                    @if group.effort > 0.0 { span.muted { "up to " (number_text(group.effort)) " " (report.effort_unit_at(group.joint)) " RMS" } }
                }
            }
            @for finding in &group.findings { (card(finding, report.effort_unit_at(finding.joint.as_deref()))) }
        }
    })
}

/// The reason why some parameters are in N m and some in A.
fn units(report: &Report) -> Option<&'static str> {
    let in_amperes = report.findings.iter().filter(|f| f.in_amperes).count();
    let mixed = in_amperes > 0 && in_amperes < report.findings.len();
    mixed.then_some(
        "Efforts are in A, as recorded. The parameters of a finding are in N m if these recordings determine the torque \
         constant of the joint, otherwise in A.",
    )
}

/// A remark on the findings' shares if they do not add up to the reduction by the correction.
fn shares(report: &Report) -> Option<Markup> {
    /// Fraction of the reduction above which the shares are treated as adding up to it.
    /// Layout: by eye; no number depends on it.
    const MOST: f64 = 0.8;
    let left = error_left(&report.holdout_rms_before, &report.holdout_rms_after);
    let gone = 1.0 - left * left;
    let alone: f64 = report.findings.iter().map(|finding| finding.explains).sum();
    let fitted = report.effort_unit == "A" && report.findings.iter().any(|f| !f.in_amperes);
    (alone < MOST * gone).then(|| {
        html! {
            "The shares below do not add up to the reduction by the correction: if one finding is left out, the others are "
            "fitted again and explain part of its share."
            @if fitted {
                " So do the torque constants, which are not findings: see " a href="#notes" { "Notes" } "."
            }
        }
    })
}

fn card(finding: &Finding, effort_unit: &str) -> Markup {
    let kind = if finding.known_as() == UNKNOWN.name {
        "card unknown"
    } else {
        "card"
    };
    let when = when(finding);
    html! {
        article class=(kind) {
            h3 {
                (effect_title(finding.known_as()))
                @if let Some(place) = place(finding.joint.as_deref(), finding.link.as_deref()) {
                    span.place { (place) }
                }
            }
            div.halves { div {
            p.sentence { (finding.sentence) }
            @if finding.is_without_law() {
                p.meaning { "No law and no curve describes it, so the correction does not contain it." }
            } @else if let Some(meaning) = effect_meaning(finding.known_as()) {
                p.meaning { (meaning) }
            }
            p.figures {
                @if finding.effort_rms > 0.0 {
                    span { "Effort " b { (number_text(finding.effort_rms)) " " (effort_unit) } " RMS" }
                }
                @if !finding.is_without_law() {
                    span {
                        "Without it " b { (percent(finding.explains)) } " of the mismatch (squared, in units of noise) would return "
                        (meter(finding.explains))
                    }
                }
                span { "Confidence " b { (almost_all(finding.confidence)) } }
                @if let Some(when) = when { span { (when) } }
            }
            }
            @if !finding.parameters.is_empty() { (parameters(finding)) }
            }
            @if !finding.equivalent_to.is_empty() {
                p.rival {
                    b { "Cannot be distinguished from " }
                    (list(finding.equivalent_to.iter().map(|rival| {
                        effect_at(&rival.effect, rival.joint.as_deref(), rival.link.as_deref())
                    })))
                    @if finding.equivalent_to.len() == 1 {
                        ". This data fits both; the name above is the more probable one."
                    } @else {
                        ". This data fits all of them; the name above is the most probable one."
                    }
                }
            }
        }
    }
}

/// Names in the given order, with semicolons and an `or`.
pub(super) fn list(names: impl Iterator<Item = String>) -> String {
    let mut names: Vec<_> = names.collect();
    let last = names.pop().unwrap_or_default();
    if names.is_empty() {
        last
    } else {
        format!("{} or {last}", names.join("; "))
    }
}

fn when(finding: &Finding) -> Option<String> {
    let recording = |text: String| match &finding.recording {
        Some(recording) => format!("{text} in {recording}"),
        None => text,
    };
    let time = |seconds: f64| format!("{} s", number_text((seconds * 100.0).round() / 100.0));
    match (finding.t_start, finding.t_end) {
        (Some(start), Some(end)) => {
            Some(recording(format!("From {} to {}", time(start), time(end))))
        }
        (Some(start), None) => Some(recording(format!("From {} on", time(start)))),
        (None, Some(end)) => Some(recording(format!("Until {}", time(end)))),
        (None, None) => finding.recording.as_ref().map(|name| format!("In {name}")),
    }
}

/// A share as a small bar.
pub(super) fn meter(share: f64) -> Markup {
    let width = if share.is_finite() {
        share.clamp(0.0, 1.0) * 80.0
    } else {
        0.0
    };
    html! {
        svg.meter viewBox="0 0 80 8" aria-hidden="true" {
            rect.rail width="80" height="8" rx="4" {}
            rect.fill width=(r(width)) height="8" rx="4" {}
        }
    }
}

fn parameters(finding: &Finding) -> Markup {
    // Masses first, times last.
    let rank = |name: &str| match name {
        "coulomb_after_nm" => 2,
        "t_start_s" | "change_time_session_s" => 3,
        "t_end_s" => 4,
        name => usize::from(!name.contains("mass")),
    };
    let mut parameters: Vec<_> = finding.parameters.iter().collect();
    parameters.sort_by_key(|(name, _)| rank(name));
    html! {
        table.parameters {
            thead { tr { th { "Parameter" } th.num { "Value" } th.num { "95 % interval" } th {} } }
            tbody {
                @for (name, given) in parameters {
                    @let (label, unit) = parameter_in(name, finding.in_amperes, finding.slides);
                    @let interval = finding.intervals_95.get(name).copied();
                    tr {
                        th scope="row" { (label) }
                        td.num { b { (value(given, interval)) } " " (unit) (degrees(given.as_f64(), &unit)) }
                        @if let Some([low, high]) = interval {
                            td.num { (with_digits_of(low, [low, high])) " to " (with_digits_of(high, [low, high])) }
                            td { (interval_picture(given.as_f64(), [low, high])) }
                        } @else {
                            td {} td {}
                        }
                    }
                }
            }
        }
    }
}

/// The value in degrees in addition, if it is an angle.
fn degrees(value: Option<f64>, unit: &str) -> Markup {
    html! {
        @if let Some(angle) = value && unit == "rad" {
            span.muted { " (" (number_text(angle.to_degrees())) "°)" }
        }
    }
}

/// The interval on an axis with zero, which shows its distance from no effect.
fn interval_picture(value: Option<f64>, [low, high]: [f64; 2]) -> Markup {
    let all = [Some(0.0), value, Some(low), Some(high)];
    let axis = (low.is_finite() && high.is_finite())
        .then(|| Axis::over(all.into_iter().flatten(), 5.0, 135.0))
        .flatten();
    html! {
        @if let Some(axis) = axis {
            svg.interval viewBox="0 0 140 16" role="img" aria-label="the interval on an axis with zero" {
                line.axis x1="5" x2="135" y1="8" y2="8" {}
                line.zero x1=(r(axis.px(0.0))) x2=(r(axis.px(0.0))) y1="2" y2="14" {}
                rect.range x=(r(axis.px(low))) y="5" width=(r((axis.px(high) - axis.px(low)).max(2.0))) height="6" rx="2" {}
                @if let Some(value) = value.filter(|value| value.is_finite()) {
                    circle.value cx=(r(axis.px(value))) cy="8" r="3.6" {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(unit: &str, in_amperes: [bool; 2], explains: f64) -> Report {
        let finding = |in_amperes: bool| {
            serde_json::json!({
                "effect": "coulomb_friction", "joint": "joint1", "link": null, "parameters": {}, "intervals_95": {},
                "in_amperes": in_amperes, "confidence": 0.9, "recording": null, "t_start": null, "t_end": null,
                "explains": explains, "sentence": "It has friction.",
                "equivalent_to": [{"effect": "torque_gain", "joint": "joint1", "link": null},
                    {"effect": "torque_bias", "joint": "joint1", "link": null}],
            })
        };
        let json = serde_json::json!({
            "case": "c", "verdict": "explained", "summary": "", "effort_unit": unit,
            "findings": in_amperes.map(finding), "rejected": [], "located": [], "undetectable": [],
            "next_motions": [], "notes": [], "joints": ["joint1"], "holdout_rms_before": [1.0],
            "holdout_rms_after": [0.18], "noise_floor": [0.1], "holdout_predictions": {},
        });
        match serde_json::from_value(json) {
            Ok(report) => report,
            Err(error) => panic!("{error}"),
        }
    }

    fn page(report: &Report) -> String {
        cards(report).map(Markup::into_string).unwrap_or_default()
    }

    #[test]
    fn shares_that_do_not_add_up_are_said_to_and_why_units_differ() {
        let text = page(&report("A", [true, false], 0.09));
        assert!(text.contains("Efforts are in A, as recorded."), "{text}");
        assert!(
            text.contains("do not add up") && text.contains("So do the torque constants"),
            "{text}"
        );
        assert!(
            text.contains("Without it <b>9 %</b> of the mismatch"),
            "{text}"
        );
        let in_nm = page(&report("Nm", [false, false], 0.09));
        assert!(in_nm.contains("do not add up") && !in_nm.contains("torque constants"));
        assert!(text.contains("fits all of them"), "{text}");
        let text = page(&report("A", [false, false], 0.48));
        assert!(!text.contains("do not add up"), "{text}");
        assert!(!text.contains("Efforts are in A"), "{text}");
    }
}
