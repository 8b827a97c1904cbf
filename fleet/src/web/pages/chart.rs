//! Curves as SVG, without a style of their own: the style sheet knows their classes.

use maud::{Markup, html};
use tauscope_condition::Estimate;

use crate::store::{Day, Note};
use crate::words;

const DAY_NS: i64 = 86_400_000_000_000;

/// A small curve over equal steps, with its range in words for readers who cannot see it.
pub fn spark(what: &str, values: &[f64], span: &str) -> Markup {
    let (width, height) = (120.0, 24.0);
    let (low, high) = range(values.iter().copied());
    let step = width / (values.len().max(2) - 1) as f64;
    let y = |value: f64| height - 2.0 - (value - low) / (high - low) * (height - 4.0);
    let points = values.iter().enumerate();
    let points: Vec<String> = points
        .map(|(at, value)| format!("{:.1},{:.1}", at as f64 * step, y(*value)))
        .collect();
    let words = format!("{what}, {span}: {low:.2} to {high:.2}");
    html! {
        svg.spark viewBox="0 0 120 24" role="img" aria-label=(words) {
            title { (words) }
            polyline.line points=(points.join(" ")) {}
        }
    }
}

/// The lowest and the highest, apart from each other.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let bounds = values.filter(|value| value.is_finite());
    let (low, high) = bounds.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return (0.0, 1.0);
    }
    let apart = (high - low).max(1e-9 + 0.02 * high.abs());
    (low, low + apart)
}

/// A joint's residual by day: the root mean square as a line, the quietest and loudest hour as a band, the normal
/// residual as a dashed line, notes as marks.
pub fn days(days: &[&Day], normal: Option<f64>, notes: &[Note], now_ns: i64, unit: &str) -> Markup {
    let (width, height, left, foot) = (420.0, 120.0, 46.0, 18.0);
    let Some(first) = days.first() else {
        return html! { p.muted { "no history yet: it begins with the first whole minute" } };
    };
    let begin_ns = first.day_ns.min(now_ns - 7 * DAY_NS);
    let end_ns = now_ns.max(begin_ns + DAY_NS);
    let x =
        |ns: i64| left + (ns - begin_ns) as f64 / (end_ns - begin_ns) as f64 * (width - left - 8.0);
    let values = days
        .iter()
        .flat_map(|day| [day.low, day.high])
        .chain(normal);
    let (_, high) = range(values.chain([0.0]));
    let y = |value: f64| 6.0 + (1.0 - value / high) * (height - foot - 6.0);
    let point = |day: &&Day, value: f64| {
        format!(
            "{:.1},{:.1}",
            x(day.day_ns + DAY_NS / 2).min(width - 8.0),
            y(value)
        )
    };
    let line: Vec<String> = days.iter().map(|day| point(day, day.rms)).collect();
    let band: Vec<String> = days
        .iter()
        .map(|day| point(day, day.high))
        .chain(days.iter().rev().map(|day| point(day, day.low)))
        .collect();
    let last = days.last().map_or(0.0, |day| day.rms);
    let words = format!(
        "residual by day since {}: now {last:.3} {unit}, normal {}",
        words::day(begin_ns),
        normal.map_or_else(
            || "not known".to_owned(),
            |normal| format!("{normal:.3} {unit}")
        )
    );
    html! {
        svg.days viewBox="0 0 420 120" role="img" aria-label=(words) {
            title { (words) }
            line.axis x1=(left) y1=(y(0.0)) x2=(width - 8.0) y2=(y(0.0)) {}
            text.end x=(left - 6.0) y=(y(0.0)) { "0" }
            text.end x=(left - 6.0) y=(y(high) + 8.0) { (format!("{high:.2}")) }
            text x=(left) y=(height - 3.0) { (words::day(begin_ns)) }
            text.end x=(width - 8.0) y=(height - 3.0) { "now" }
            polygon.band points=(band.join(" ")) {}
            @if let Some(normal) = normal {
                line.normal x1=(left) y1=(format!("{:.1}", y(normal))) x2=(width - 8.0) y2=(format!("{:.1}", y(normal))) {}
            }
            @for note in notes.iter().filter(|note| note.at_ns >= begin_ns) {
                line.note.baseline[note.baseline] x1=(format!("{:.1}", x(note.at_ns))) y1="6"
                    x2=(format!("{:.1}", x(note.at_ns))) y2=(y(0.0)) { title { (note.text) } }
            }
            polyline.line points=(line.join(" ")) {}
            @for day in days { @let at = point(day, day.rms);
                @if let Some((cx, cy)) = at.split_once(',') { circle.dot cx=(cx) cy=(cy) r="2" {} }
            }
        }
    }
}

/// A number by night with its intervals, its first level as a dashed line, the temperature below, notes as marks.
pub fn nights(name: &str, nights: &[&Estimate], first: f64, notes: &[(f64, &Note)]) -> Markup {
    let (width, left, top, foot) = (420.0, 52.0, 6.0, 104.0);
    let (Some(oldest), Some(newest)) = (nights.first(), nights.last()) else {
        return html! { p.muted { "no night yet" } };
    };
    let begin = oldest.day.min(newest.day - 7.0);
    let span = (newest.day - begin).max(1.0);
    let x = |day: f64| left + (day - begin) / span * (width - left - 8.0);
    let ends = nights.iter().flat_map(|night| [night.low, night.high]);
    let (low, high) = range(ends.chain([first]));
    let y = |value: f64| top + (high - value) / (high - low) * (foot - top);
    let temperatures = nights
        .iter()
        .filter_map(|night| Some((night.day, night.temperature_c?)));
    let temperatures: Vec<(f64, f64)> = temperatures.collect();
    let (cold, hot) = range(temperatures.iter().map(|(_, value)| *value));
    let warm = |value: f64| 116.0 + (hot - value) / (hot - cold) * 26.0;
    let warmth: Vec<String> = temperatures
        .iter()
        .map(|(day, value)| format!("{:.1},{:.1}", x(*day), warm(*value)))
        .collect();
    let words = format!(
        "{name}, by night: now {:.3}, at first {first:.3}",
        newest.value
    );
    let date = |day: f64| words::day((day * 86_400e9) as i64);
    html! {
        svg.days viewBox="0 0 420 162" role="img" aria-label=(words) {
            title { (words) }
            text.end x=(left - 6.0) y=(top + 8.0) { (format!("{high:.3}")) }
            text.end x=(left - 6.0) y=(foot) { (format!("{low:.3}")) }
            line.normal x1=(left) y1=(format!("{:.1}", y(first))) x2=(width - 8.0) y2=(format!("{:.1}", y(first))) {}
            @for (day, note) in notes.iter().filter(|(day, _)| *day >= begin) {
                line.note.baseline[note.baseline] x1=(format!("{:.1}", x(*day))) y1="6"
                    x2=(format!("{:.1}", x(*day))) y2="144" { title { (note.text) } }
            }
            @for night in nights {
                line.interval x1=(format!("{:.1}", x(night.day))) y1=(format!("{:.1}", y(night.low)))
                    x2=(format!("{:.1}", x(night.day))) y2=(format!("{:.1}", y(night.high))) {}
                circle.dot cx=(format!("{:.1}", x(night.day))) cy=(format!("{:.1}", y(night.value))) r="1.5" {}
            }
            @if temperatures.len() > 1 {
                text.end x=(left - 6.0) y="124" { (format!("{hot:.0} °C")) }
                text.end x=(left - 6.0) y="144" { (format!("{cold:.0} °C")) }
                polyline.warmth points=(warmth.join(" ")) {}
            } @else {
                text x=(left) y="134" { "no temperature" }
            }
            line.axis x1=(left) y1="146" x2=(width - 8.0) y2="146" {}
            text x=(left) y="159" { (date(begin)) }
            text.end x=(width - 8.0) y="159" { (date(newest.day)) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_of_equal_or_few_values_is_drawn_too() {
        for values in [&[1.0, 1.0, 1.0][..], &[0.0], &[], &[f64::NAN, 2.0]] {
            let text = spark("residual", values, "last hour").into_string();
            assert!(text.contains("<polyline"), "{text}");
            assert!(!text.contains("inf"), "{text}");
        }
    }

    #[test]
    fn a_joint_without_history_says_so() {
        let text = days(&[], None, &[], 0, "Nm").into_string();
        assert!(text.contains("no history yet"), "{text}");
    }
}
