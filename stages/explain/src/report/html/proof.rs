//! Where the mismatch sits, and what is left of it after the correction.

use maud::{Markup, html};

use super::chart::r;
use super::number_format::{effort_unit, fixed, number_text, percent};
use crate::report::schema::{Located, Report, Verdict};

/// How many rows of a table are shown at once.
/// Tuned: by eye, for the layout of the page.
const ROWS: usize = 10;

/// A joint with an error below this many times its noise is at the noise floor.
/// Tuned: by hand, on no recorded seeds; not swept.
const QUIET: f64 = 1.3;

/// A joint with an error above this many times its noise still has a mismatch.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEFT: f64 = 3.0;

/// A joint's errors on held-out data \[effort unit\]; what is not known is not a number.
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

    /// Whether nothing but noise is left.
    pub fn is_quiet(&self) -> bool {
        self.over_noise() <= QUIET
    }

    /// Whether more than noise is left, by so much that it must be said.
    pub fn is_left(&self) -> bool {
        self.over_noise() > LEFT
    }

    /// Whether the correction made a difference that is worth a picture.
    pub fn is_changed(&self) -> bool {
        self.before > 1.15 * self.after
    }

    /// What weighs the joint among others: its own noise, or nothing.
    fn weight(&self) -> f64 {
        if self.noise > 0.0 {
            self.noise.powi(-2)
        } else {
            1.0
        }
    }

    /// What was gained, in squared units of noise.
    pub fn gain(&self) -> f64 {
        let gain = (self.before.powi(2) - self.after.powi(2)) * self.weight();
        if gain.is_finite() {
            gain
        } else {
            f64::NEG_INFINITY
        }
    }
}

/// The joints with their errors.
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

/// Share of the squared error that is gone, each joint in units of its noise.
pub(super) fn recovered(rows: &[Row<'_>]) -> f64 {
    let (before, after) = rows
        .iter()
        .filter(|row| row.before.is_finite() && row.after.is_finite())
        .fold((0.0, 0.0), |(before, after), row| {
            (
                before + row.before.powi(2) * row.weight(),
                after + row.after.powi(2) * row.weight(),
            )
        });
    1.0 - after / before
}

/// Whether all that was found happened in recordings that were fitted, so that held-out data cannot show it.
pub(super) fn is_elsewhere(report: &Report) -> bool {
    !report.findings.is_empty()
        && report.findings.iter().all(|finding| {
            let name = finding.recording.as_ref();
            name.is_some_and(|name| !report.holdout_predictions.contains_key(name))
        })
}

/// Where, as a table with heat.
pub(super) fn located(report: &Report) -> Option<Markup> {
    if report.located.is_empty() {
        return None;
    }
    let (first, rest) = report.located.split_at(report.located.len().min(ROWS));
    Some(html! {
        p.lead { "Before any name was tried: in which joint, state or time the residual is largest. “Share” is the part of that joint’s squared residual that lies there." }
        (heat(first))
        @if !rest.is_empty() {
            details {
                summary { (rest.len()) " more places" }
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
        svg.bar viewBox="0 0 220 16" role="img" aria-label=(percent(share)) {
            rect.rail y="3" width="160" height="10" rx="2" {}
            rect.before y="3" width=(r(width)) height="10" rx="2" {}
            text x="168" y="13" { (percent(share)) }
        }
    }
}

/// Nothing at the noise, all at fifty times the noise.
fn heat_percent(over_noise: f64) -> i64 {
    if over_noise > 1.0 {
        (over_noise.ln() / 50_f64.ln() * 70.0).min(70.0) as i64
    } else {
        0
    }
}

/// `1.3 ×`.
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
    let unit = effort_unit(&report.effort_unit);
    let left: Vec<String> = rows
        .iter()
        .filter(|row| row.is_left())
        .map(|row| {
            format!(
                "{} at {} its noise floor",
                row.joint,
                times(row.over_noise())
            )
        })
        .collect();
    Some(html! {
        p.lead {
            "RMS of measured minus expected effort on held-out data, in " (unit)
            ": not filtered, not trimmed. Nothing was fitted on it."
            @if is_elsewhere(report) {
                " What was found happened in other recordings and does not recur here, so little changes; see below, joint by joint."
            }
            @if report.findings.is_empty() { " Nothing was corrected, so both are the same." }
        }
        @if !left.is_empty() {
            p.rival {
                b { "More than noise is left: " }
                (left.join(", ")) "."
            }
        }
        p.legend {
            span.key.before { "Twin as it was" }
            span.key.after { "Corrected twin" }
            span.key.noise { "Noise floor: no model can do better" }
        }
        (bars(&rows, unit))
        table.proof {
            thead { tr {
                th { "Joint" }
                th.num { "Before [" (unit) "]" } th.num { "After [" (unit) "]" } th.num { "Change" }
                th.num { "Noise floor [" (unit) "]" } th.num { "After, over noise" }
            } }
            tbody {
                @for row in &rows {
                    tr {
                        th scope="row" { (row.joint) }
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

/// Two bars a joint. Where the joints are of very different strength each is drawn to its own scale, else the small
/// ones could not be seen.
fn bars(rows: &[Row<'_>], unit: &str) -> Markup {
    /// Left end of the bars \[px\].
    /// Tuned: by eye, for the layout of the page.
    const START: f64 = 130.0;
    /// Length of the longest bar \[px\].
    /// Tuned: by eye, for the layout of the page.
    const WIDTH: f64 = 640.0;
    /// Height of a joint's row \[px\].
    /// Tuned: by eye, for the layout of the page.
    const PITCH: f64 = 46.0;
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
    let height = PITCH * rows.len() as f64 + 6.0;
    let width = |value: f64, scale: f64| {
        if value.is_finite() && scale > 0.0 {
            value / scale * WIDTH
        } else {
            0.0
        }
    };
    html! {
        figure {
            svg.bars viewBox={ "0 0 960 " (r(height)) } role="img" aria-label="error on held-out data by joint, before and after" {
                @for (j, (row, largest)) in rows.iter().zip(&all).enumerate() {
                    @let y = PITCH * j as f64 + 4.0;
                    @let scale = if own_scale { *largest } else { top };
                    @let noise_px = START + width(row.noise, scale);
                    text.joint.end x=(r(START - 12.0)) y=(r(y + 23.0)) { (short(row.joint)) }
                    @for (class, value, y) in [("before", row.before, y), ("after", row.after, y + 19.0)] {
                        rect class=(class) x=(r(START)) y=(r(y)) width=(r(width(value, scale).max(1.0))) height="16" rx="2" {}
                        @if value.is_finite() {
                            text.amount x=(r(START + width(value, scale).max(width(row.noise, scale)) + 8.0)) y=(r(y + 12.5)) {
                                (number_text(value)) " " (unit)
                            }
                        }
                    }
                    @if row.noise.is_finite() {
                        line.floor x1=(r(noise_px)) x2=(r(noise_px)) y1=(r(y - 2.0)) y2=(r(y + 37.0)) {}
                    }
                }
            }
            @if own_scale {
                figcaption { "Each joint is drawn to its own scale, since their efforts differ widely; the numbers are in " (unit) "." }
            }
        }
    }
}

/// A name that fits beside a bar.
fn short(name: &str) -> String {
    /// Longest name that is shown whole \[characters\].
    /// Tuned: by eye, for the layout of the page.
    const LETTERS: usize = 17;
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    let kept: String = name.chars().take(LETTERS - 1).collect();
    kept + "…"
}
