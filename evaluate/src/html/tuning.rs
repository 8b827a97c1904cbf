//! Trade-off curves over the thresholds of a tuned detector, on the recordings that it was tuned on
//! (Salt Ducaju et al., section V).

use maud::{Markup, html};
use tauscope_detect::frame::{FoundSweep, Sweeps, ThresholdSweep};
use tauscope_report::chart::{Axis, Panel, r};

use crate::judged::Judged;

/// Left end of a picture's plot \[px\].
/// Layout: by eye; no number depends on it.
const LEFT: f64 = 52.0;
/// Right end of a picture's plot \[px\].
/// Layout: by eye; no number depends on it.
const RIGHT: f64 = 388.0;
/// Lower end of a picture's plot \[px\].
/// Layout: by eye; no number depends on it.
const BOTTOM: f64 = 240.0;
/// Upper end of a picture's plot \[px\].
/// Layout: by eye; no number depends on it.
const TOP: f64 = 26.0;

/// Curves of every tuned detector; `None` if no detector was tuned.
pub(super) fn section(judged: &[Judged<'_>]) -> Option<Markup> {
    let tuned: Vec<(&Judged<'_>, &Sweeps)> = (judged.iter())
        .filter_map(|judged| Some((judged, judged.run.first().sweeps.as_ref()?)))
        .collect();
    (!tuned.is_empty()).then(|| {
        html! {
            p.lead { "Results that other thresholds would have given on the tuning recordings. Dashed: the tuned threshold." }
            @for (judged, sweeps) in &tuned {
                div.card {
                    h3 { (judged.label) }
                    p.muted {
                        "F" sub { "th" } " = " (format!("{:.2} N", sweeps.force_threshold_n))
                        ": above it the force content of the band is a contact. γ = " (format!("{:.1}", sweeps.bound))
                        ": at or above it the force direction differs from that of the motion, and the contact is a cooperation."
                    }
                    div.scatters {
                        @if let Some(picture) = delays(sweeps) { (picture) }
                        @if let Some(picture) = counts(sweeps) { (picture) }
                        @if let Some(picture) = kinds(sweeps) { (picture) }
                    }
                }
            }
        }
    })
}

fn thresholds(sweep: &[ThresholdSweep]) -> Vec<f64> {
    sweep.iter().map(|at| at.force_threshold_n).collect()
}

/// Draws lines, given by name, class and values, over `F_th`.
fn over_threshold(
    sweeps: &Sweeps,
    (title, y_name): (&str, &str),
    lines: &[(&str, &str, Vec<f64>)],
) -> Option<Markup> {
    let xs = thresholds(&sweeps.detection);
    let values = lines.iter().flat_map(|(.., values)| values.iter().copied());
    let panel = Panel {
        x: Axis::over(xs.iter().copied(), LEFT, RIGHT)?,
        y: Axis::over(values.chain([0.0]), BOTTOM, TOP)?,
    };
    let tuned = panel.x.px(sweeps.force_threshold_n);
    Some(html! {
        figure {
            figcaption { b { (title) } }
            svg.plot viewBox="0 0 400 282" role="img" aria-label=(title) {
                (panel.frame(5, 5, Some("Threshold F_th [N]"), y_name))
                @for (_, class, values) in lines { (panel.line(&format!("line own {class}"), &xs, values)) }
                line.middle x1=(r(tuned)) x2=(r(tuned)) y1=(r(TOP)) y2=(r(BOTTOM)) {}
            }
            p.legend { @for (name, class, _) in lines { span class={ "key own " (class) } { (name) } } }
        }
    })
}

fn delays(sweeps: &Sweeps) -> Option<Markup> {
    let sweep = &sweeps.detection;
    let mean = |of: fn(&ThresholdSweep) -> &FoundSweep| -> Vec<f64> {
        sweep.iter().map(|at| 1e3 * of(at).mean_delay_s).collect()
    };
    let lines = [
        ("collisions", "c1", mean(|at| &at.collisions)),
        ("cooperations", "c0", mean(|at| &at.cooperations)),
    ];
    let names = ("Delay of what is found", "Mean delay [ms]");
    over_threshold(sweeps, names, &lines)
}

fn counts(sweeps: &Sweeps) -> Option<Markup> {
    let sweep = &sweeps.detection;
    let missed = |of: fn(&ThresholdSweep) -> &FoundSweep| -> Vec<f64> {
        sweep.iter().map(|at| of(at).missed as f64).collect()
    };
    let (collisions, cooperations) = (missed(|at| &at.collisions), missed(|at| &at.cooperations));
    // Thresholds within the noise would cause false alarms without limit and dominate the scale.
    let most = collisions.iter().chain(&cooperations).copied();
    let most = most.fold(5.0, f64::max);
    let false_alarms = (sweep.iter())
        .map(|at| at.false_alarms as f64)
        .map(|count| if count > 2.0 * most { f64::NAN } else { count })
        .collect();
    let lines = [
        ("missed collisions", "c1", collisions),
        ("missed cooperations", "c0", cooperations),
        ("false alarms", "c6", false_alarms),
    ];
    let names = ("Missed and false", "Contacts, alarms");
    over_threshold(sweeps, names, &lines)
}

/// Sensitivity against specificity over γ.
fn kinds(sweeps: &Sweeps) -> Option<Markup> {
    let (sweep, gamma) = (&sweeps.class, sweeps.bound);
    if sweep.is_empty() {
        return None;
    }
    let percent = |share: f64| 100.0 * share;
    let specificity: Vec<f64> = sweep.iter().map(|at| percent(at.specificity)).collect();
    let sensitivity: Vec<f64> = sweep.iter().map(|at| percent(at.sensitivity)).collect();
    let panel = Panel {
        x: Axis::between(0.0, 100.0, LEFT, RIGHT),
        y: Axis::between(0.0, 100.0, BOTTOM, TOP),
    };
    // The sweep's bounds on either side of γ separate the contacts in the same way.
    let tuned = sweep.iter().find(|at| at.bound >= gamma).or(sweep.last())?;
    Some(html! {
        figure {
            figcaption { b { "Collision or cooperation" } }
            svg.plot viewBox="0 0 400 282" role="img" aria-label="sensitivity against specificity" {
                (panel.frame(5, 5, Some("Specificity: collisions classified right [%]"), "Sensitivity: cooperations classified right [%]"))
                (panel.line("line own c2", &specificity, &sensitivity))
                circle.tuned.c2 cx=(r(panel.x.px(percent(tuned.specificity)))) cy=(r(panel.y.px(percent(tuned.sensitivity)))) r="5" {}
            }
            p.legend {
                span.key.own.c2 {
                    "γ from " (format!("{:.1}", sweep[0].bound)) " (left) to " (format!("{:.1}", sweep[sweep.len() - 1].bound))
                }
                span.key.dot.c2 { "tuned" }
            }
        }
    })
}
