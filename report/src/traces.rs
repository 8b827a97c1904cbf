//! Plots of each joint: effort over time, and residual over velocity, position and load.

use maud::{Markup, html};

use super::chart::{Axis, Panel, bulk, r};
use super::effects::effect_title;
use super::proof::{Row, rows};
use tauscope_explain::report::{Finding, JointPicture, RecordingPicture, Report};

/// Number of joints that are shown unfolded.
/// Layout: by eye; no number depends on it.
const OPEN: usize = 5;
/// Largest number of dots of each kind in a scatter plot.
/// Layout: by eye; no number depends on it.
const DOTS: usize = 900;
/// Fraction of the dots that may lie outside the axis of a scatter plot, at each end.
/// Layout: by eye; no number depends on it.
const WILD: f64 = 0.004;
/// Left and right ends of the plots over time \[px\].
/// Layout: by eye; no number depends on it.
const TIME_PX: [f64; 2] = [66.0, 950.0];

/// All joints: first those with findings or a large change, then the others, folded.
pub(super) fn joints(report: &Report, pictures: &[RecordingPicture]) -> Option<Markup> {
    let rows = rows(report);
    let mut order: Vec<&Row<'_>> = rows
        .iter()
        .filter(|row| {
            pictures
                .iter()
                .any(|picture| find(picture, row.joint).is_some())
        })
        .collect();
    if order.is_empty() {
        return None;
    }
    order.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    let of_interest = |row: &Row<'_>| {
        row.is_changed()
            || row.is_left()
            || named_at(report, row.joint).next().is_some()
            || eventful(report, pictures, row.joint).is_some()
    };
    let (mut first, mut rest): (Vec<_>, Vec<_>) =
        order.into_iter().partition(|row| of_interest(row));
    if first.is_empty() {
        first.extend((!rest.is_empty()).then(|| rest.remove(0)));
    }
    if first.len() > OPEN {
        rest.splice(0..0, first.drain(OPEN..));
    }
    Some(html! {
        p.legend {
            span.key.measured { "Measured" }
            span.key.before { "Twin as it was" }
            span.key.after { "Corrected twin" }
            span.key.band { "Noise (± 2 σ)" }
        }
        @for row in first { (joint(report, pictures, row, true)) }
        @if !rest.is_empty() {
            details {
                summary { "The other joints (" (rest.len()) ")" }
                @for row in rest { (joint(report, pictures, row, false)) }
            }
        }
    })
}

fn named_at<'a>(report: &'a Report, joint: &'a str) -> impl Iterator<Item = &'a Finding> {
    report
        .findings
        .iter()
        .filter(move |finding| finding.joint.as_deref() == Some(joint))
}

fn find<'a>(picture: &'a RecordingPicture, joint: &str) -> Option<&'a JointPicture> {
    picture
        .joints
        .iter()
        .find(|drawn| drawn.joint == joint && !drawn.time_s.is_empty())
}

fn joint(report: &Report, pictures: &[RecordingPicture], row: &Row<'_>, in_full: bool) -> Markup {
    let unit = report.effort_unit_at(Some(row.joint));
    let named: Vec<_> = named_at(report, row.joint)
        .map(|finding| effect_title(finding.known_as()))
        .collect();
    html! {
        div.joint {
            h3 { (row.joint) @if !named.is_empty() { span.place { (named.join(", ")) } } }
            @for picture in chosen(report, pictures, row.joint) {
                @if let Some(drawn) = find(picture, row.joint) {
                    @let spans = spans(report, pictures, picture, row.joint);
                    (over_time(picture, drawn, row, &spans, unit))
                }
            }
            @if in_full { (scatters(pictures, row.joint, unit)) }
        }
    }
}

/// The recordings to draw: the held-out one with the largest reduction, and one with a temporary finding.
fn chosen<'a>(
    report: &Report,
    pictures: &'a [RecordingPicture],
    joint: &str,
) -> Vec<&'a RecordingPicture> {
    let gain = |picture: &RecordingPicture| {
        find(picture, joint).map_or(0.0, |drawn| squares(drawn).0 - squares(drawn).1)
    };
    let held_out = pictures
        .iter()
        .filter(|picture| find(picture, joint).is_some())
        .max_by(|a, b| {
            (a.held_out, gain(a))
                .partial_cmp(&(b.held_out, gain(b)))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
    let mut chosen: Vec<_> = eventful(report, pictures, joint).into_iter().collect();
    chosen.extend(held_out.filter(|held| chosen.iter().all(|c| c.recording != held.recording)));
    chosen
}

/// The recording with the largest reduction by a finding that acts at this joint in this recording only.
fn eventful<'a>(
    report: &Report,
    pictures: &'a [RecordingPicture],
    joint: &str,
) -> Option<&'a RecordingPicture> {
    pictures
        .iter()
        .filter_map(|picture| {
            let (before, after) = squares(find(picture, joint)?);
            let spans = spans(report, pictures, picture, joint);
            let here = spans.iter().any(|span| span.here_only) && before > 1.2 * after;
            here.then_some((picture, before - after))
        })
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(picture, _)| picture)
}

/// Sums of squared residuals before and after the correction.
fn squares(drawn: &JointPicture) -> (f64, f64) {
    let squares = |expected: &[f64]| -> f64 {
        let residuals = drawn.measured.iter().zip(expected);
        let squares = residuals.map(|(m, e)| (m - e).powi(2));
        squares.filter(|square| square.is_finite()).sum()
    };
    (squares(&drawn.before), squares(&drawn.after))
}

/// A period in which a finding acts.
struct Span {
    title: String,
    from_s: f64,
    to_s: f64,
    /// Whether it acts in this recording and not in all.
    here_only: bool,
}

fn spans(
    report: &Report,
    pictures: &[RecordingPicture],
    picture: &RecordingPicture,
    joint: &str,
) -> Vec<Span> {
    let end_s = find(picture, joint)
        .and_then(|drawn| drawn.time_s.last().copied())
        .unwrap_or(0.0);
    let session_ns = pictures
        .iter()
        .map(|p| p.start_ns)
        .min()
        .unwrap_or(picture.start_ns);
    let since_session_s = picture.start_ns.saturating_sub(session_ns) as f64 * 1e-9;
    let span = |finding: &Finding| {
        if finding.joint.as_deref().is_some_and(|at| at != joint) {
            return None;
        }
        let title = effect_title(finding.known_as());
        if let Some(change_s) = finding.parameters.get("change_time_session_s") {
            let from_s = change_s.as_f64()? - since_session_s;
            return (0.0..end_s).contains(&from_s).then_some(Span {
                title,
                from_s,
                to_s: end_s,
                here_only: true,
            });
        }
        if finding.t_start.is_none() && finding.t_end.is_none() {
            return None;
        }
        let here = finding
            .recording
            .as_ref()
            .is_none_or(|name| *name == picture.recording);
        let from_s = finding.t_start.unwrap_or(0.0);
        let to_s = finding.t_end.unwrap_or(end_s).min(end_s);
        (here && from_s < to_s).then_some(Span {
            title,
            from_s,
            to_s,
            here_only: finding.recording.is_some(),
        })
    };
    report.findings.iter().filter_map(span).collect()
}

/// Plots of measured and expected effort, with the residuals below.
fn over_time(
    picture: &RecordingPicture,
    drawn: &JointPicture,
    row: &Row<'_>,
    spans: &[Span],
    unit: &str,
) -> Markup {
    let residual = |expected: &[f64]| -> Vec<f64> {
        drawn
            .measured
            .iter()
            .zip(expected)
            .map(|(m, e)| m - e)
            .collect()
    };
    let (before, after) = (residual(&drawn.before), residual(&drawn.after));
    let efforts = [&drawn.measured, &drawn.before, &drawn.after]
        .into_iter()
        .flatten()
        .copied();
    let residuals = before.iter().chain(&after).copied().chain([0.0]);
    let [from, to] = TIME_PX;
    let axes = (
        Axis::over(drawn.time_s.iter().copied(), from, to),
        Axis::over(efforts, 216.0, 26.0),
        Axis::over(residuals, 396.0, 252.0),
    );
    let (Some(time), Some(effort), Some(residual)) = axes else {
        return html! { p.muted { "No data of " (row.joint) " in " (picture.recording) "." } };
    };
    let above = Panel {
        x: time.clone(),
        y: effort.padded(0.05),
    };
    let below = Panel {
        x: time,
        y: residual.padded(0.05),
    };
    let kind = if picture.held_out {
        "held out, never fitted"
    } else {
        "used for the fit"
    };
    html! {
        figure {
            figcaption { (picture.recording) " (" (kind) ")" }
            svg.plot viewBox="0 0 960 436" role="img" aria-label={ "effort of " (row.joint) " over time in " (picture.recording) } {
                (above.frame(10, 5, None, &format!("Effort [{unit}]")))
                (below.frame(10, 4, Some("Time [s]"), &format!("Residual: measured − expected [{unit}]")))
                @for span in spans {
                    (above.span(span.from_s, span.to_s))
                    (below.span(span.from_s, span.to_s))
                }
                @if row.noise > 0.0 { (below.band("noise", -2.0 * row.noise, 2.0 * row.noise)) }
                (above.line("line measured", &drawn.time_s, &drawn.measured))
                (above.line("line before", &drawn.time_s, &drawn.before))
                (above.line("line after", &drawn.time_s, &drawn.after))
                (below.line("line before", &drawn.time_s, &before))
                (below.line("line after", &drawn.time_s, &after))
                @for (index, span) in spans.iter().enumerate() {
                    text.event x=(r(above.x.px(span.from_s.max(0.0)) + 5.0)) y=(r(39.0 + 14.0 * index as f64)) { (span.title) }
                }
            }
        }
    }
}

/// A residual with the quantities that it may depend on.
struct Dot {
    velocity: f64,
    position: f64,
    load: f64,
    before: f64,
    after: f64,
}

/// Horizontal coordinate of a dot.
type Of = fn(&Dot) -> f64;

/// Plots of the residual over velocity, position and load, where friction, springs and gains have distinct shapes.
fn scatters(pictures: &[RecordingPicture], joint: &str, unit: &str) -> Markup {
    let any_held_out = pictures
        .iter()
        .any(|p| p.held_out && find(p, joint).is_some());
    let dots: Vec<Dot> = pictures
        .iter()
        .filter(|picture| picture.held_out == any_held_out)
        .filter_map(|picture| find(picture, joint))
        .flat_map(dots)
        .collect();
    let step = dots.len().div_ceil(DOTS).max(1);
    let dots: Vec<&Dot> = dots.iter().step_by(step).collect();
    let residuals = dots.iter().flat_map(|dot| [dot.before, dot.after]);
    let Some([low, high]) = bulk(residuals, WILD) else {
        return html! {};
    };
    let y = Axis::between(low.min(0.0), high.max(0.0), 214.0, 26.0).padded(0.06);
    let effort = format!("Effort of the twin [{unit}]");
    let kinds: [(&str, Of); 3] = [
        ("Velocity [rad/s or m/s]", |dot| dot.velocity),
        ("Position [rad or m]", |dot| dot.position),
        (&effort, |dot| dot.load),
    ];
    html! {
        div.scatters {
            @for (name, of) in kinds {
                @if let Some([low, high]) = bulk(dots.iter().map(|dot| of(dot)), WILD) {
                    @let x = Axis::between(low, high, 56.0, 312.0).padded(0.04);
                    @let panel = Panel { x, y: y.clone() };
                    figure {
                        svg.plot viewBox="0 0 320 254" role="img" aria-label={ "residual of " (joint) " against " (name) } {
                            (panel.frame(5, 5, Some(name), &format!("Residual [{unit}]")))
                            (panel.dots("before", dots.iter().map(|dot| (of(dot), dot.before))))
                            (panel.dots("after", dots.iter().map(|dot| (of(dot), dot.after))))
                        }
                    }
                }
            }
        }
    }
}

fn dots(drawn: &JointPicture) -> impl Iterator<Item = Dot> {
    let at = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(f64::NAN);
    (0..drawn.time_s.len()).map(move |i| {
        let measured = at(&drawn.measured, i);
        Dot {
            velocity: at(&drawn.velocity, i),
            position: at(&drawn.position, i),
            load: at(&drawn.before, i),
            before: measured - at(&drawn.before, i),
            after: measured - at(&drawn.after, i),
        }
    })
}
