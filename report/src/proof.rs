//! Location of the mismatch, and the residual after the correction.

use maud::{Markup, html};
use tauscope_dynamics::terms::words::counted;

use super::chart::r;
use super::number_format::{fixed, number_text, percent};
use tauscope_explain::report::{Located, Report, Verdict};

/// Number of table rows that are shown unfolded.
/// Layout: by eye; no number depends on it.
const ROWS: usize = 6;

/// Ratio of error to noise below which a joint is at the noise floor.
/// Tuned: by hand, on no recorded seeds; not swept.
const QUIET: f64 = 1.3;

/// Ratio of error to noise above which a joint still has a mismatch.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEFT: f64 = 3.0;

/// Ratio of error to noise below which the estimate of the noise is too high.
/// Chosen: twice the standard error of an RMS of 800 rows, 50 s at a cutoff of 8 Hz; only a sentence depends on it.
const BELOW: f64 = 0.95;

/// A joint's errors on held-out data \[effort unit\]; NaN if unknown.
#[derive(Debug, Clone)]
pub(super) struct Row<'a> {
    pub joint: &'a str,
    pub before: f64,
    pub after: f64,
    pub noise: f64,
}

impl Row<'_> {
    /// Error after the correction in units of the noise.
    pub fn over_noise(&self) -> f64 {
        if self.noise > 0.0 {
            self.after / self.noise
        } else {
            f64::NAN
        }
    }

    /// Whether the error after the correction is at the noise floor.
    pub fn is_quiet(&self) -> bool {
        self.over_noise() <= QUIET
    }

    /// Whether the error after the correction is clearly below the estimated noise.
    pub fn is_below(&self) -> bool {
        self.over_noise() < BELOW
    }

    /// Whether the error after the correction is clearly above the noise.
    pub fn is_left(&self) -> bool {
        self.over_noise() > LEFT
    }

    /// Whether the correction reduced the error enough for an unfolded picture.
    pub fn is_changed(&self) -> bool {
        self.before > 1.15 * self.after
    }

    /// Weight of the joint's squared error: the inverse noise variance, or 1 if the noise is unknown.
    fn weight(&self) -> f64 {
        if self.noise > 0.0 {
            self.noise.powi(-2)
        } else {
            1.0
        }
    }

    /// Reduction of the squared error, in units of the noise variance.
    pub fn gain(&self) -> f64 {
        let gain = (self.before.powi(2) - self.after.powi(2)) * self.weight();
        if gain.is_finite() {
            gain
        } else {
            f64::NEG_INFINITY
        }
    }
}

/// The errors of all joints.
pub(super) fn rows(report: &Report) -> Vec<Row<'_>> {
    let at = |values: &[f64], j: usize| values.get(j).copied().unwrap_or(f64::NAN);
    let row = |(j, joint)| Row {
        joint,
        before: at(&report.holdout_rms_before, j),
        after: at(&report.holdout_rms_after, j),
        noise: at(&report.noise_floor, j),
    };
    report
        .joints
        .iter()
        .map(String::as_str)
        .enumerate()
        .map(row)
        .collect()
}

/// Whether all findings belong to fitted recordings, so that held-out data cannot show them.
pub(super) fn is_elsewhere(report: &Report) -> bool {
    !report.findings.is_empty()
        && report.findings.iter().all(|finding| {
            let name = finding.recording.as_ref();
            name.is_some_and(|name| !report.holdout_predictions.contains_key(name))
        })
}

/// Location of the mismatch, as a table with a heat column.
pub(super) fn located(report: &Report) -> Option<Markup> {
    if report.located.is_empty() {
        return None;
    }
    let (first, rest) = report.located.split_at(report.located.len().min(ROWS));
    Some(html! {
        p.lead { "Joints, states and times with the largest residual, before any effect was considered. “Share” is the fraction of the joint’s squared residual there." }
        (heat(first))
        @if !rest.is_empty() {
            details {
                summary { (counted(rest.len(), "more place")) }
                (heat(rest))
            }
        }
    })
}

fn heat(places: &[Located]) -> Markup {
    html! {
        table.heat {
            thead { tr { th { "Joint" } th { "Where" } th { "Share of the joint’s mismatch" } th.num { "Size" } } }
            tbody {
                @for place in places {
                    tr {
                        th scope="row" { (place.joint) }
                        td { (place.place) }
                        td.share { (share_bar(place.share_of_residual)) }
                        td.num.hot style={ "--heat:" (heat_percent(place.over_noise)) "%" } {
                            @if place.over_noise.is_finite() { (times(place.over_noise)) " noise" } @else { "–" }
                        }
                    }
                }
            }
        }
    }
}

fn share_bar(share: f64) -> Markup {
    let width = if share.is_finite() {
        share.clamp(0.0, 1.0) * 160.0
    } else {
        0.0
    };
    html! {
        svg.bar viewBox="0 0 230 16" role="img" aria-label=(percent(share)) {
            rect.rail y="3" width="160" height="10" rx="2" {}
            rect.before y="3" width=(r(width)) height="10" rx="2" {}
            text x="168" y="13" { (percent(share)) }
        }
    }
}

/// Heat of a cell in percent: 0 at the noise, 70 at fifty times the noise.
fn heat_percent(over_noise: f64) -> i64 {
    if over_noise > 1.0 {
        (over_noise.ln() / 50_f64.ln() * 70.0).min(70.0) as i64
    } else {
        0
    }
}

/// A ratio as text, such as `1.3 ×`.
fn times(ratio: f64) -> String {
    if ratio < 9.95 {
        format!("{} ×", fixed(ratio, 1))
    } else {
        format!("{} ×", fixed(ratio, 0))
    }
}

/// Errors by joint: bars and a table.
pub(super) fn before_and_after(report: &Report) -> Option<Markup> {
    let rows = rows(report);
    let any = rows
        .iter()
        .any(|row| row.before.is_finite() || row.after.is_finite());
    if report.verdict == Verdict::NotEvaluated || !any {
        return None;
    }
    let unit = report.effort_unit_at(None);
    let left: Vec<String> = rows
        .iter()
        .filter(|row| row.is_left())
        .map(|row| format!("{} at {} its noise", row.joint, times(row.over_noise())))
        .collect();
    let below: Vec<&str> = rows
        .iter()
        .filter(|row| row.is_below())
        .map(|row| row.joint)
        .collect();
    Some(html! {
        p.lead {
            "RMS of measured minus expected effort on held-out data, in " (unit)
            ": not filtered, not trimmed. Nothing was fitted on it."
            @if is_elsewhere(report) {
                " The findings belong to other recordings and do not recur here, so little changes; see the plots of each joint."
            }
            @if report.findings.is_empty() { " Nothing was corrected, so both are the same." }
        }
        @if !left.is_empty() {
            p.rival {
                b { "Residual above the noise: " }
                (left.join(", ")) "."
            }
        }
        @if !below.is_empty() {
            p.muted {
                "Below the estimated noise: " (below.join(", ")) ". The estimate treats all changes from sample to sample as noise; "
                "here part of them follows the motion, or the held-out recordings have less noise than the fitted ones."
            }
        }
        p.legend {
            span.key.before { "Twin as it was" }
            span.key.after { "Corrected twin" }
            span.key.noise { "Noise of the measurement, estimated" }
        }
        (bars(&rows, unit))
        table.proof {
            thead { tr {
                th { "Joint" }
                th.num { "Before [" (unit) "]" } th.num { "After [" (unit) "]" } th.num { "Change" }
                th.num { "Noise [" (unit) "]" } th.num { "After, over noise" }
            } }
            tbody {
                @for row in &rows {
                    tr {
                        @let own = report.effort_unit_at(Some(row.joint));
                        th scope="row" { (row.joint) @if own != unit { " [" (own) "]" } }
                        td.num { (number_text(row.before)) }
                        td.num { b { (number_text(row.after)) } }
                        td.num { (change(row)) }
                        td.num { (number_text(row.noise)) }
                        td.num { @if row.over_noise().is_finite() { (times(row.over_noise())) } @else { "–" } }
                    }
                }
            }
        }
    })
}

fn change(row: &Row<'_>) -> String {
    let change = row.after / row.before - 1.0;
    if change.is_finite() {
        let text = fixed(change * 100.0, 0);
        format!("{}{text} %", if change > 0.005 { "+" } else { "" })
    } else {
        "–".to_owned()
    }
}

/// Two bars for each joint. If the joints' efforts differ widely, each joint has its own scale, because small bars
/// would be invisible on a common one.
fn bars(rows: &[Row<'_>], unit: &str) -> Markup {
    let largest = |row: &Row<'_>| {
        [row.before, row.after, row.noise]
            .into_iter()
            .filter(|value| value.is_finite())
            .fold(0.0, f64::max)
    };
    let all: Vec<f64> = rows.iter().map(largest).collect();
    let top = all.iter().copied().fold(0.0, f64::max);
    let least = all.iter().copied().filter(|v| *v > 0.0).fold(top, f64::min);
    let own_scale = top > 8.0 * least;
    let width = |value: f64, scale: f64| {
        let share = if scale > 0.0 { value / scale } else { 0.0 };
        let share = if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            0.0
        };
        format!("--w:{}%", r(100.0 * share))
    };
    // The number is placed behind the noise mark if that is longer than the bar.
    let beside = |value: f64, noise: f64, scale: f64| {
        let beyond = if scale > 0.0 {
            (noise - value) / scale
        } else {
            0.0
        };
        let beyond = if beyond > 0.0 { beyond.min(1.0) } else { 0.0 };
        format!("margin-left:{}%", r(100.0 * beyond))
    };
    html! {
        figure {
            div.bars role="img" aria-label="error on held-out data by joint, before and after" {
                @for (row, largest) in rows.iter().zip(&all) {
                    @let scale = if own_scale { *largest } else { top };
                    div.name { (row.joint) }
                    div.pair {
                        @for (class, value) in [("before", row.before), ("after", row.after)] {
                            div class={ "bar " (class) } {
                                i style=(width(value, scale)) {}
                                @if value.is_finite() {
                                    span style=(beside(value, row.noise, scale)) { (number_text(value)) " " (unit) }
                                }
                            }
                        }
                        @if row.noise.is_finite() { div.floor { i style=(width(row.noise, scale)) {} } }
                    }
                }
            }
            @if own_scale {
                figcaption { "Each joint is drawn to its own scale, since their efforts differ widely; the numbers are in " (unit) "." }
            }
        }
    }
}
