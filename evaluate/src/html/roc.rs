//! Receiver operating characteristics.

use maud::{Markup, html};
use tauscope_report::chart::{Axis, Panel};

use super::line_class;
use crate::judged::Judged;
use crate::metrics::samples::Labelled;

/// Approximate number of points of a full curve.
/// Resolution: about one per pixel; also determines the size of the page.
const POINTS: usize = 400;
/// Approximate number of points of a full curve from which the enlarged part is cut.
/// Resolution: as [`POINTS`], for a twentieth of the range.
const FINE: usize = 8000;
/// Highest false positive rate of the enlarged curves; users do not accept a higher one.
/// Layout: by eye; no number depends on it.
const ZOOM: f64 = 0.05;

/// Returns a figure with one curve per detector, of the first seed; `None` if no test recording has both contact and
/// contact-free motion.
pub(super) fn section(judged: &[Judged<'_>]) -> Option<Markup> {
    let curves: Vec<_> = (judged.iter().enumerate())
        .map(|(index, judged)| (index, judged, samples(judged).roc(POINTS)))
        .filter(|(_, _, curve)| !curve.is_empty())
        .collect();
    if curves.is_empty() {
        return None;
    }
    let fine: Vec<_> = curves
        .iter()
        .map(|(index, judged, _)| (*index, zoomed(&samples(judged).roc(FINE))))
        .collect();
    let whole = curves
        .iter()
        .map(|(index, _, curve)| (*index, curve.clone()));
    let whole: Vec<_> = whole.collect();
    Some(html! {
        div.card {
            div.curves {
                (picture(&fine, ZOOM, "up to 5 % false positives"))
                p.legend {
                    @for (at, (index, judged, curve)) in curves.iter().enumerate() {
                        // Later curves are drawn over earlier ones.
                        @let covered = curves[at + 1..].iter().find(|(.., later)| later == curve);
                        span class={ "key own " (line_class(*index)) } {
                            (judged.label) " (AUC " (format!("{:.3}", judged.first().samples.auc)) ")"
                            @if let Some((_, by, _)) = covered { ", hidden by " (by.label) }
                        }
                    }
                    span.key.chance { "chance (0.5)" }
                }
            }
            details {
                summary { "Full range" }
                div.curves { (picture(&whole, 1.0, "whole")) }
            }
        }
    })
}

/// Draws the curves by detector up to a false positive rate.
fn picture(curves: &[(usize, Vec<(f64, f64)>)], most: f64, what: &str) -> Markup {
    let panel = Panel {
        x: Axis::between(0.0, most, 56.0, 536.0),
        y: Axis::between(0.0, 1.0, 440.0, 26.0),
    };
    html! {
        svg.plot.square viewBox="0 0 560 486" role="img" aria-label={ "Receiver operating characteristics, " (what) } {
            (panel.frame(5, 5, Some("False positive rate (contact-free samples above threshold)"), "True positive rate (contact samples above threshold)"))
            (panel.line("line chance", &[0.0, most], &[0.0, most]))
            @for (index, curve) in curves {
                @let (xs, ys): (Vec<f64>, Vec<f64>) = curve.iter().copied().unzip();
                (panel.line(&format!("line own {}", line_class(*index)), &xs, &ys))
            }
        }
    }
}

/// The part of a curve up to [`ZOOM`], with its interpolated point there.
fn zoomed(curve: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let within = curve.iter().copied().take_while(|(x, _)| *x <= ZOOM);
    let mut points: Vec<(f64, f64)> = within.collect();
    if let (Some(&(x0, y0)), Some(&(x1, y1))) = (points.last(), curve.get(points.len()))
        && x1 > x0
    {
        points.push((ZOOM, y0 + (ZOOM - x0) / (x1 - x0) * (y1 - y0)));
    }
    points
}

fn samples(judged: &Judged<'_>) -> Labelled {
    let mut all = Labelled::default();
    for one in &judged.scored {
        all.scores.extend_from_slice(&one.samples.scores);
        all.positive.extend_from_slice(&one.samples.positive);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enlarged_curve_ends_at_its_edge() {
        let points = zoomed(&[(0.0, 0.0), (0.0, 0.6), (0.1, 0.8), (1.0, 1.0)]);
        assert_eq!(points.len(), 3);
        assert!((points[2].0 - ZOOM).abs() < 1e-12 && (points[2].1 - 0.7).abs() < 1e-12);
    }
}
