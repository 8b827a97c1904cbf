//! A cell on the wall.

use maud::{Markup, html};
use tauscope_publish::message::{ContactMessage, StatusMessage};

use super::chart;
use crate::wall::{CellView, Severity, State};
use crate::words;

/// Returns a cell's tile, with the age of each value. The tile of a stale, unknown or ended cell is marked as old.
pub fn tile(view: &CellView, now_ns: i64) -> Markup {
    let status = view.status.as_ref();
    let is_old = matches!(
        view.state,
        State::Stale { .. } | State::Unknown { .. } | State::Ended { .. }
    );
    html! {
        article.tile.old[is_old] data-severity=(name(view.severity)) data-state=(view.state.name()) {
            header {
                h2 { a href={ "/cells/" (view.cell) } { (view.cell) } }
                (badge(view.state))
            }
            p.reason { (reason(view, now_ns)) }
            @if let Some(since_ns) = view.latched_behind() { p.reason {
                "Its alarm was latched " (stamp(since_ns, &words::age_at(since_ns, now_ns)))
                " ago; its release has not been reported."
            } }
            @if let Some(until_ns) = view.muted_behind(now_ns) { p.reason {
                "Muted until " (stamp(until_ns, &words::time_of_day(until_ns))) ": until then a new contact stops nothing."
            } }
            @if let Some(status) = status { (facts(view, status, view.stream_now_ns().unwrap_or(now_ns))) }
        }
    }
}

/// The state as shape, word and colour.
pub fn badge(state: State) -> Markup {
    html! {
        p.badge data-severity=(name(state.severity())) {
            (icon(state.severity())) " " span { (state.words()) }
        }
    }
}

/// A severity as a class.
pub fn name(severity: Severity) -> &'static str {
    match severity {
        Severity::Critical => "critical",
        Severity::Serious => "serious",
        Severity::Notice => "notice",
        Severity::Good => "good",
    }
}

/// Returns the shape of a severity; each has its own, for readers who do not see its colour.
fn icon(severity: Severity) -> Markup {
    let path = match severity {
        Severity::Critical => "M5 1h6l4 4v6l-4 4H5l-4-4V5z",
        Severity::Serious => "M8 1.5L15.5 15h-15z",
        Severity::Notice => "M8 1a7 7 0 1 0 0 14A7 7 0 1 0 8 1z",
        Severity::Good => "M2 8.5l4 4 8-9-1.6-1.4L6 9.5 3.5 7z",
    };
    html! { svg.icon viewBox="0 0 16 16" aria-hidden="true" { path d=(path) {} } }
}

/// Describes the start, the reason and the end of a state.
pub fn reason(view: &CellView, now_ns: i64) -> Markup {
    let reason = view.state.reason();
    html! {
        @match view.state {
            State::Muted { until_ns } => { "until " (stamp(until_ns, &words::time_of_day(until_ns))) ": " (reason) }
            _ => {
                @if let Some(since_ns) = view.since_ns {
                    "for " (stamp(since_ns, &words::age_at(since_ns, now_ns)))
                    @if !reason.is_empty() { ": " }
                }
                (reason)
            }
        }
    }
}

/// Returns a time as shown, with the full time as attribute and tooltip.
pub fn stamp(ns: i64, shown: &str) -> Markup {
    html! { time datetime=(words::iso(ns)) title=(words::time(ns)) { (shown) } }
}

/// Ratio of a joint's residual to its normal residual from which it is shown in the colour of a warning.
/// Resolution: what a person of a hundred cells should look at; nothing is decided by it.
const UNUSUAL: f64 = 2.0;

fn facts(view: &CellView, status: &StatusMessage, now_ns: i64) -> Markup {
    html! {
        dl {
            dt.brief { "Last sample" }
            dd.brief { (last_sample(view, status)) }
            dt { "Last contact" }
            dd { (last_contact(status.last_contact.as_ref(), now_ns)) }
            dt { "Contacts today" }
            dd { (contacts_today(status)) }
            dt.warn[view.lost_samples > 0] { "Lost samples" }
            dd.warn[view.lost_samples > 0] { (view.lost_samples) }
            dt.brief { "Residual" }
            dd.brief { (residual(view)) }
            @if let Some(residual) = &view.residual {
                @let is_unusual = residual.joint_ratio >= UNUSUAL;
                dt.warn[is_unusual] { "Drifts most" }
                dd.warn[is_unusual] { (residual.joint) ", " (format!("{:.2}", residual.joint_ratio)) " × normal" }
            }
            @if let Some(drift) = &view.drift {
                dt { "Friction" }
                @let is_stale = drift.stale_d.is_some();
                dd.warn[drift.finding.is_some() && !is_stale].muted[is_stale] title=[drift.finding.as_ref()] {
                    (drift.joint) ", " (drift.quantity.words()) " " (format!("{:+.0} %", 100.0 * drift.share))
                    @if drift.is_warmth { " (warmth)" }
                    @if let Some(days) = drift.stale_d { ", " (days) " d ago: stale" }
                    @if drift.curve.len() > 2 { (chart::spark("friction over its first", &drift.curve, "six weeks")) }
                }
            }
            @if let Some(change) = status.changes.first() {
                dt.warn { "Watch" }
                dd.warn { (words::change(change, &status.effort_unit)) }
            }
            @if view.clock_is_off {
                dt.warn { "Clock" }
                dd.warn { (words::clock(view)) }
            }
            dt.warn[view.urdf_differs] { "Twin, URDF" }
            dd.warn[view.urdf_differs] { code title=[status.twin_sha256.as_ref()] { (words::short_hash(status.twin_sha256.as_ref())) }
                 ", " code title=[status.urdf_sha256.as_ref()] { (words::short_hash(status.urdf_sha256.as_ref())) }
                 @if view.urdf_differs { ": other cells with " (status.robot) " have another URDF" } }
        }
    }
}

fn last_sample(view: &CellView, status: &StatusMessage) -> Markup {
    html! {
        @match (view.sample_age_ms, status.last_sample_ns) {
            (Some(age_ms), Some(stamp_ns)) => { (stamp(stamp_ns, &words::age(age_ms))) " ago" }
            _ => "none yet",
        }
    }
}

/// Describes the last contact: its kind, its age, and who acknowledged it.
pub fn last_contact(contact: Option<&ContactMessage>, now_ns: i64) -> Markup {
    let Some(contact) = contact else {
        return html! { "none" };
    };
    html! {
        (words::contact(contact)) ", "
        (stamp(contact.onset_ns, &words::age_at(contact.onset_ns, now_ns))) " ago"
        @match (&contact.acknowledged_by, contact.acknowledged_ns) {
            (Some(by), _) => { ", acknowledged by " (by) }
            (None, Some(_)) => ", acknowledged",
            (None, None) => @if contact.latched { strong { ", not acknowledged" } },
        }
    }
}

fn contacts_today(status: &StatusMessage) -> Markup {
    let since_ns = status.contacts_since_ns;
    html! {
        (status.contacts_today)
        @if since_ns > 0 { span.muted { " since " (stamp(since_ns, &words::time_of_day(since_ns))) } }
    }
}

fn residual(view: &CellView) -> Markup {
    let (curve, span) = if view.trend.len() > 2 {
        (&view.trend, "six weeks")
    } else {
        (&view.curve, "last hour")
    };
    html! {
        @match &view.residual {
            Some(residual) => {
                (format!("{:.2}", residual.ratio)) " × normal "
                span.muted { "(" (residual.normal) ")" }
            }
            // Not muted: on a dense wall that would leave the name of the value alone.
            None => "no normal yet",
        }
        @if curve.len() > 2 { (chart::spark("residual", curve, span)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::wall::{Event, Now, Wall};

    #[test]
    fn a_small_tile_says_that_there_is_no_normal_to_compare_with() {
        let mut wall = Wall::new(["a".to_owned()]);
        let mut status = fixture::status("x", 5);
        for joint in status.residual.iter_mut().flat_map(|it| &mut it.joints) {
            joint.calibrated = None;
        }
        let (cell, status) = ("a".to_owned(), Box::new(status));
        wall.take(Event::Status { cell, status }, Now::default());
        let shown = tile(&wall.snapshot().cells[0], 0).into_string();
        // Muted text is not shown on a small tile.
        assert!(
            shown.contains("<dd class=\"brief\">no normal yet</dd>"),
            "{shown}"
        );
    }
}
