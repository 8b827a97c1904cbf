//! Scores over time, one plot per recording, with labels and alarms.

use maud::{Markup, html};
use tauscope_dynamics::terms::words::counted;
use tauscope_report::chart::{Axis, Panel, bulk, r};

use super::recommendation;
use crate::judged::Judged;
use crate::metrics::Scored;

/// Largest number of recordings that are drawn.
/// Layout: by eye; no number depends on it.
const RECORDINGS: usize = 24;
/// Number of plots that are initially open.
/// Layout: by eye; no number depends on it.
const OPEN: usize = 3;
/// Largest number of points of a line.
/// Resolution: about one per pixel; changes the page's size.
const POINTS: usize = 700;
/// Upper end of the score axis, in thresholds; higher scores are clipped.
/// Layout: by eye; no number depends on it.
const HIGHEST: f64 = 6.0;
/// Style class of the score's line: the same colour for every detector, distinct from that of alarms.
const SCORE: &str = "c0";

/// One plot per recording, of the recommended detector; `None` if nothing was scored.
pub(super) fn section(judged: &[Judged<'_>]) -> Option<Markup> {
    let drawn = recommendation::best(judged).or_else(|| judged.first())?;
    if drawn.scored.is_empty() {
        return None;
    }
    let all: Vec<&Scored<'_>> = drawn.scored.iter().take(RECORDINGS).collect();
    let (open, rest) = all.split_at(all.len().min(OPEN));
    let left_out = drawn.scored.len() - all.len();
    let plots = |scored: &[&Scored<'_>]| {
        html! { @for one in scored { (plot(drawn, one)) } }
    };
    Some(html! {
        p.lead {
            "The score of " b { (drawn.label) } " over its threshold (1 is the threshold; what is far above it is cut off)."
        }
        p.legend {
            span class={ "key own " (SCORE) } { "Score" }
            span.key.truth { "Labelled contact" }
            span.key.found { "Alarm of a contact" }
            span.key.wrong { "False alarm" }
        }
        (plots(open))
        @if !rest.is_empty() {
            details { summary { (counted(rest.len(), "more recording")) } (plots(rest)) }
        }
        @if left_out > 0 {
            p.muted { (left_out) " recordings are not drawn; their scores are in the CSV files." }
        }
    })
}

fn plot(judged: &Judged<'_>, one: &Scored<'_>) -> Markup {
    let threshold = judged.run.first().threshold;
    let (xs, ys) = thinned(&one.output.t, &one.output.scores, threshold);
    let Some([low, high]) = bulk(ys.iter().copied(), 0.0) else {
        return html! { p.muted { "Nothing to draw of " (one.output.recording) "." } };
    };
    let panel = Panel {
        x: Axis::between(0.0, one.duration_s.max(1e-3), 56.0, 950.0),
        y: Axis::between(low.min(0.0), high.max(1.5), 160.0, 34.0),
    };
    let found = |t: f64| {
        let of_contact =
            |m: &crate::metrics::Matched<'_>| m.detection.is_some_and(|d| is_same(d.t, t));
        one.matching.events.iter().any(of_contact)
    };
    let wrong = |t: f64| {
        one.matching
            .false_alarms
            .iter()
            .any(|event| is_same(event.t, t))
    };
    let missed = one.matching.events.iter().filter(|m| m.detection.is_none());
    let missed = missed.count();
    html! {
        figure {
            figcaption {
                b { (one.output.recording) }
                @if missed > 0 { ": " (missed) " missed" }
                @if !one.matching.false_alarms.is_empty() { ", " (one.matching.false_alarms.len()) " false" }
            }
            svg.plot viewBox="0 0 960 200" role="img" aria-label={ "score of " (judged.label) " in " (one.output.recording) } {
                (panel.frame(10, 3, Some("Time [s]"), "Score / threshold"))
                @for matched in &one.matching.events {
                    (panel.span(matched.event.t_on, matched.event.t_off))
                }
                (panel.line(&format!("line own {SCORE}"), &xs, &ys))
                line.middle x1="56" x2="950" y1=(r(panel.y.px(1.0))) y2=(r(panel.y.px(1.0))) {}
                @for event in &one.output.events {
                    @let class = if wrong(event.t) { "alarm wrong" } else if found(event.t) { "alarm found" } else { "alarm" };
                    @let (from, to) = (panel.x.px(event.t), panel.x.px(event.t_off));
                    rect class=(class) x=(r(from)) y="4" width=(r((to - from).max(2.0))) height="7" {}
                }
            }
        }
    }
}

fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

/// Downsamples scores to the maximum of each time interval, in thresholds.
fn thinned(t: &[f64], scores: &[f64], threshold: f64) -> (Vec<f64>, Vec<f64>) {
    let scale = if threshold.abs() > 0.0 && threshold.is_finite() {
        threshold.abs()
    } else {
        1.0
    };
    let length = t.len().div_ceil(POINTS).max(1);
    let stretches = t.chunks(length).zip(scores.chunks(length));
    stretches
        .filter_map(|(t, scores)| {
            let finite = scores.iter().copied().filter(|score| score.is_finite());
            let most = finite.max_by(f64::total_cmp)?;
            Some((t[0], (most / scale).min(HIGHEST)))
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_survives_thinning_and_is_cut_off_far_above_the_threshold() {
        let t: Vec<f64> = (0..7000).map(f64::from).collect();
        let mut scores = vec![1.0; 7000];
        (scores[3333], scores[10]) = (4.0, 1e9);
        let (xs, ys) = thinned(&t, &scores, 2.0);
        assert_eq!(xs.len(), POINTS);
        assert_eq!(ys.iter().filter(|y| **y > 1.9).count(), 2);
        assert!(ys.iter().all(|y| *y <= HIGHEST));
    }
}
