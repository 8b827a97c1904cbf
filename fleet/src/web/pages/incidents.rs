//! Incidents of all cells.

use maud::{Markup, html};

use super::{Viewer, layout, tile};
use crate::store::{Incident, StoreError};
use crate::words;

/// The newest that are shown. Resolution: a week of a busy plant.
pub const MOST: u32 = 200;

/// The page.
pub fn page(
    viewer: &Viewer,
    kept: Option<Result<Vec<Incident>, StoreError>>,
    now_ns: i64,
) -> Markup {
    let content = html! {
        h1 { "Incidents" }
        p.muted { "The open ones first. What comes again within 10 minutes is the same incident." }
        @match kept {
            None => p { "This fleet host keeps no incidents." },
            Some(Err(error)) => p.refused role="alert" { (error) },
            Some(Ok(incidents)) => (table(&incidents, now_ns, true)),
        }
    };
    layout(viewer, "Incidents", false, &content)
}

/// Incidents as a table; `named`: with the cell.
pub fn table(incidents: &[Incident], now_ns: i64, named: bool) -> Markup {
    if incidents.is_empty() {
        return html! { p.muted { "none" } };
    }
    html! {
        div.wide role="region" aria-label="Incidents" tabindex="0" {
            table {
                thead { tr {
                    th scope="col" { "State" }
                    @if named { th scope="col" { "Cell" } }
                    th scope="col" { "What" }
                    th scope="col" { "Last" }
                    th.num scope="col" { "Times" }
                    th scope="col" { "Acknowledged" }
                } }
                tbody { @for incident in incidents { tr {
                    td { (state(incident)) }
                    @if named { td { a href={ "/cells/" (incident.cell) } { (incident.cell) } } }
                    td { (incident.words) }
                    td { (tile::stamp(incident.last_ns, &words::age_at(incident.last_ns, now_ns))) " ago" }
                    td.num { (incident.count)
                        @if incident.reopened > 0 { span.muted { ", reopened " (incident.reopened) "×" } } }
                    td { @match (&incident.acknowledged_by, incident.acknowledged_ns) {
                        (Some(by), Some(at_ns)) => { (by) ", " (tile::stamp(at_ns, &words::age_at(at_ns, now_ns))) " ago" }
                        _ => span.muted { "no" },
                    } }
                } } }
            }
        }
    }
}

fn state(incident: &Incident) -> Markup {
    let severity = tile::name(incident.severity);
    html! {
        @if incident.closed_ns.is_none() {
            span.count data-severity=(severity) { "open" }
        } @else {
            span.muted { "over" }
        }
    }
}
