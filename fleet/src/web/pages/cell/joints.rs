//! The joints of a cell: their residual, their normal residual, and the residual of their peers.

use maud::{Markup, html};
use tauscope_publish::message::JointResidual;

use super::super::chart;
use super::Kept;
use crate::store::Day;
use crate::wall::{CellView, Snapshot};
use crate::words;

/// Peers from which on one can be an outlier among them. Resolution: a median of three tells two faults.
const PEERS: usize = 3;
/// A modified z-score beyond this is an outlier.
/// Statistical: Iglewicz and Hoaglin 1993, How to detect and handle outliers, p. 12.
const OUTLIER: f64 = 3.5;
/// Standard deviation of a normal distribution over its median absolute deviation.
/// Physical: 1 / the normal quantile of 3/4.
const DEVIATIONS: f64 = 1.4826;

/// The table and the curves.
pub fn section(snapshot: &Snapshot, view: &CellView, kept: &Kept, unit: &str) -> Markup {
    let residual = view
        .status
        .as_ref()
        .and_then(|status| status.residual.as_ref());
    let Some(residual) = residual else {
        return html! { p.muted {
            @if view.status.is_none() { "The residual is unknown: the cell has not sent a status yet." }
            @else {
                "The residual is unknown: the cell's " code { "publish" } " stage does not listen to its twin."
            }
        } };
    };
    let normal = |joint: &JointResidual| {
        let learned = kept
            .normals
            .iter()
            .find(|normal| normal.joint == joint.name);
        learned.map(|normal| normal.rms).or(joint.calibrated)
    };
    html! {
        p.muted { "Residual (" (unit) ") of the last " (format!("{:.0}", residual.window_s)) " s without a contact, up to "
            (super::tile::stamp(residual.stamp_ns, &words::time(residual.stamp_ns))) ". Peers: cells with the same robot." }
        div.wide role="region" aria-label="Joints" tabindex="0" {
            table.fold {
                thead { tr {
                    th scope="col" { "Joint" } th.num scope="col" { "RMS" } th.num scope="col" { "Normal" }
                    th.num scope="col" { "Ratio" } th.num scope="col" { "Mean" } th scope="col" { "Among peers" }
                } }
                tbody { @for joint in &residual.joints { tr {
                    th scope="row" { (joint.name) }
                    td.num data-label="RMS" { (format!("{:.3}", joint.rms)) }
                    @match normal(joint).filter(|normal| *normal > 0.0) {
                        Some(normal) => {
                            td.num data-label="Normal" { (format!("{normal:.3}")) }
                            td.num.warn[joint.rms > 2.0 * normal] data-label="Ratio" { (format!("{:.2} ×", joint.rms / normal)) }
                        }
                        None => {
                            td.num.muted data-label="Normal" { "not known" }
                            td.num.muted data-label="Ratio" { "-" }
                        }
                    }
                    td.num data-label="Mean" { (format!("{:+.3}", joint.mean)) }
                    td.full data-label="Among peers" { (among_peers(snapshot, view, joint)) }
                } } }
            }
        }
        @if let Some(status) = &view.status { @if !status.changes.is_empty() {
            ul.changes { @for change in &status.changes { li { (words::change(change, unit)) } } }
        } }
        div.curves { @for joint in &residual.joints {
            @let days: Vec<&Day> = kept.days.iter().filter(|day| day.joint == joint.name).collect();
            figure {
                figcaption { (joint.name) ", residual by day (" (unit) ")" }
                (chart::days(&days, normal(joint), &kept.notes, snapshot.now_ns, unit))
            }
        } }
        @if !kept.days.is_empty() {
            p.legend.muted { "Line: root mean square of the day. Band: quietest to loudest hour. Dashed: normal. \
                Upright: a maintenance note." }
        }
    }
}

fn among_peers(snapshot: &Snapshot, view: &CellView, joint: &JointResidual) -> Markup {
    let peers = peers(snapshot, view, &joint.name);
    if peers.len() < PEERS {
        return html! { span.muted { (peers.len()) " peers, too few" } };
    }
    let (middle, is_out) = outlier(joint.rms, peers);
    html! {
        @if is_out { strong.warn { "outlier" } ", " }
        "median " (format!("{middle:.3}"))
    }
}

/// Returns the residual of this joint in the other cells with this robot \[effort unit\].
fn peers(snapshot: &Snapshot, view: &CellView, joint: &str) -> Vec<f64> {
    let Some(own) = &view.status else {
        return Vec::new();
    };
    let others = snapshot
        .cells
        .iter()
        .filter(|other| other.cell != view.cell);
    let statuses = others.filter_map(|other| other.status.as_ref());
    let same = statuses.filter(|status| {
        let robot = !own.robot.is_empty() && status.robot == own.robot;
        robot && status.effort_unit == own.effort_unit
    });
    let joints =
        same.flat_map(|status| status.residual.iter().flat_map(|residual| &residual.joints));
    let named = joints.filter(|other| other.name == joint);
    named.map(|other| other.rms).collect()
}

/// Returns the peers' median, and whether `value` is an outlier among them.
fn outlier(value: f64, mut peers: Vec<f64>) -> (f64, bool) {
    let middle = median(&mut peers);
    let mut deviations: Vec<f64> = peers.iter().map(|peer| (peer - middle).abs()).collect();
    let spread = DEVIATIONS * median(&mut deviations);
    (
        middle,
        (value - middle).abs() > OUTLIER * spread.max(0.05 * middle.abs()),
    )
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => 0.0,
        length if length % 2 == 1 => values[half],
        _ => f64::midpoint(values[half - 1], values[half]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_lies_far_beyond_what_peers_differ_by() {
        let peers = || vec![0.50, 0.52, 0.48, 0.55, 0.45];
        assert_eq!(outlier(0.6, peers()), (0.5, false));
        assert_eq!(outlier(1.2, peers()), (0.5, true));
        // Twins are no proof of precision.
        assert_eq!(outlier(0.51, vec![0.5; 4]), (0.5, false));
        assert_eq!(outlier(0.9, vec![0.5; 4]), (0.5, true));
    }
}
