//! Histograms of the delay from the beginning of a contact to the alarm.

use maud::{Markup, html};
use tauscope_report::chart::{Axis, Panel, r};

use super::line_class;
use crate::judged::Judged;
use crate::metrics::Matched;
use crate::metrics::statistics::{Distribution, quantile};

/// Number of bars of a histogram.
/// Layout: by eye; no number depends on it.
const BARS: usize = 24;

/// One histogram per detector, all to the same scale; `None` if no detector found a contact.
pub(super) fn section(judged: &[Judged<'_>]) -> Option<Markup> {
    let delays: Vec<Vec<f64>> = (judged.iter())
        .map(|judged| judged.matched().filter_map(|m| delay_ms(&m)).collect())
        .collect();
    let mut all: Vec<f64> = delays.iter().flatten().copied().collect();
    if all.is_empty() {
        return None;
    }
    all.sort_by(f64::total_cmp);
    // A few very late alarms must not compress the scale; they are counted in the last bar.
    let width = round_up(quantile(&all, 0.95).max(1.0) / (BARS - 2) as f64);
    let counts: Vec<[usize; BARS]> = delays.iter().map(|delays| bars(delays, width)).collect();
    let most = counts.iter().flatten().copied().max().unwrap_or(1);
    Some(html! {
        p.lead { "Found contacts by delay, " (width) " ms a bar; the last bar holds all later ones. Dashed: the median." }
        div.scatters {
            @for (index, judged) in judged.iter().enumerate() {
                @if !delays[index].is_empty() {
                    (histogram(judged, index, &delays[index], &counts[index], width, most))
                }
            }
        }
    })
}

fn delay_ms(matched: &Matched<'_>) -> Option<f64> {
    Some(1e3 * matched.delay_s()?)
}

/// Rounds up to 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let decade = 10_f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade);
    steps
        .into_iter()
        .find(|step| *step >= value)
        .unwrap_or(value)
}

/// Counts the delays per bar. The first bar holds alarms before the labelled beginning.
fn bars(delays_ms: &[f64], width: f64) -> [usize; BARS] {
    let mut counts = [0; BARS];
    for delay in delays_ms {
        let bar = ((delay / width).floor() + 1.0).clamp(0.0, (BARS - 1) as f64);
        counts[bar as usize] += 1;
    }
    counts
}

fn histogram(
    judged: &Judged<'_>,
    index: usize,
    delays: &[f64],
    counts: &[usize; BARS],
    width: f64,
    most: usize,
) -> Markup {
    let panel = Panel {
        x: Axis::between(-width, width * (BARS - 1) as f64, 44.0, 312.0),
        y: Axis::between(0.0, most as f64, 170.0, 26.0),
    };
    let of = Distribution::of(delays.iter().copied());
    let median = panel.x.px(of.p50);
    html! {
        figure {
            figcaption {
                b { (judged.label) }
                br;
                (format!("{:.0} ± {:.0}, p50 {:.0}, p99 {:.0} ms", of.mean, of.sd, of.p50, of.p99))
            }
            svg.plot viewBox="0 0 320 208" role="img" aria-label={ "delays of " (judged.label) } {
                (panel.frame(4, 4, Some("Delay [ms]"), "Contacts"))
                g class=(line_class(index)) {
                    @for (bar, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                        @let from = width * (bar as f64 - 1.0);
                        @let (left, right) = (panel.x.px(from), panel.x.px(from + width));
                        @let top = panel.y.px(*count as f64);
                        rect.count x=(r(left + 0.5)) y=(r(top)) width=(r(right - left - 1.0)) height=(r(170.0 - top)) {}
                    }
                }
                line.middle x1=(r(median)) x2=(r(median)) y1="26" y2="170" {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn early_and_late_alarms_have_bars_of_their_own() {
        let counts = bars(&[-5.0, 0.0, 9.9, 10.0, 5000.0], 10.0);
        assert_eq!(counts[..3], [1, 2, 1]);
        assert_eq!(counts[BARS - 1], 1);
    }

    #[test]
    fn a_bar_is_a_round_number_wide() {
        for (value, up) in [(0.3, 0.5), (7.0, 10.0), (11.0, 20.0)] {
            assert!((round_up(value) - up).abs() < 1e-12);
        }
    }
}
