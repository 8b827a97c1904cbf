//! Receiver operating characteristics.

use maud::{Markup, html};
use tauscope_explain::html::chart::{Axis, Panel};

use super::line_class;
use crate::judged::Judged;
use crate::metrics::samples::Labelled;

/// About so many points a curve.
/// Resolution: about one per pixel; changes the page's size.
const POINTS: usize = 400;

/// One picture with a curve a detector, of the first seed; none if no test recording has both contact and
/// free motion.
pub(super) fn section(judged: &[Judged<'_>]) -> Option<Markup> {
    let curves: Vec<_> = (judged.iter().enumerate())
        .map(|(index, judged)| (index, judged, samples(judged).roc(POINTS)))
        .filter(|(_, _, curve)| !curve.is_empty())
        .collect();
    if curves.is_empty() {
        return None;
    }
    let panel = Panel {
        x: Axis::between(0.0, 1.0, 56.0, 536.0),
        y: Axis::between(0.0, 1.0, 440.0, 26.0),
    };
    let ends = [0.0, 1.0];
    Some(html! {
        div.card {
            div.curves {
                svg.plot viewBox="0 0 560 486" role="img" aria-label="Receiver operating characteristics of all detectors" {
                    (panel.frame(5, 5, Some("False positive rate: share of free samples above the threshold"), "True positive rate: share of contact samples above it"))
                    (panel.line("line chance", &ends, &ends))
                    @for (index, _, curve) in &curves {
                        @let (xs, ys): (Vec<f64>, Vec<f64>) = curve.iter().copied().unzip();
                        (panel.line(&format!("line own {}", line_class(*index)), &xs, &ys))
                    }
                }
                p.legend {
                    @for (at, (index, judged, curve)) in curves.iter().enumerate() {
                        @let covered = curves[at + 1..].iter().find(|(.., later)| later == curve);
                        span class={ "key own " (line_class(*index)) } {
                            (judged.label) " (" (format!("{:.3}", judged.first().samples.auc)) ")"
                            @if let Some((_, by, _)) = covered { ", under " (by.label) }
                        }
                    }
                    span.key.chance { "chance (0.5)" }
                }
            }
        }
    })
}

fn samples(judged: &Judged<'_>) -> Labelled {
    let mut all = Labelled::default();
    for one in &judged.scored {
        all.scores.extend_from_slice(&one.samples.scores);
        all.positive.extend_from_slice(&one.samples.positive);
    }
    all
}
