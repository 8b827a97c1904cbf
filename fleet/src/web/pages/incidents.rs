//! Incidents of all cells.

use maud::{Markup, html};

use super::{Viewer, layout, tile};
use crate::store::{Incident, KeptLabel, StoreError};
use crate::words;

/// The newest that are shown. Resolution: a week of a busy plant.
pub const MOST: u32 = 200;

/// Incidents, and the labels that are about them.
type Labelled = (Vec<Incident>, Vec<KeptLabel>);

/// The page.
pub fn page(viewer: &Viewer, kept: Option<Result<Labelled, StoreError>>, now_ns: i64) -> Markup {
    let content = html! {
        h1 { "Incidents" }
        p.muted { "The open ones first. What comes again within 10 minutes is the same incident." }
        @match kept {
            None => p { "This fleet host keeps no incidents." },
            Some(Err(error)) => p.refused role="alert" { (error) },
            Some(Ok((incidents, labels))) => (table(&incidents, &labels, now_ns, true)),
        }
    };
    layout(viewer, "Incidents", false, &content)
}

/// A label: what, who and when.
pub fn label(one: &KeptLabel) -> Markup {
    let label = &one.label;
    html! {
        "\u{201c}" (label.text) "\u{201d} " span.muted { (label.by) ", " (tile::stamp(label.at_ns, &words::time(label.at_ns))) }
    }
}

/// Incidents as a table, with the labels that are about them; `named`: with the cell.
pub fn table(incidents: &[Incident], labels: &[KeptLabel], now_ns: i64, named: bool) -> Markup {
    if incidents.is_empty() {
        return html! { p.muted { "none" } };
    }
    html! {
        div.wide role="region" aria-label="Incidents" tabindex="0" {
            table.fold {
                thead { tr {
                    th scope="col" { "State" }
                    @if named { th scope="col" { "Cell" } }
                    th scope="col" { "What" }
                    th scope="col" { "Last" }
                    th.num scope="col" { "Times" }
                    th scope="col" { "Acknowledged" }
                } }
                tbody { @for incident in incidents { tr {
                    td data-label="State" { (state(incident)) }
                    @if named { td data-label="Cell" { a href={ "/cells/" (incident.cell) } { (incident.cell) } } }
                    td.full data-label="What" { (incident.words)
                        @for one in labels.iter().filter(|one| one.incident == Some(incident.id)) {
                            div.label { (label(one)) }
                        }
                    }
                    td data-label="Last" { (tile::stamp(incident.last_ns, &words::age_at(incident.last_ns, now_ns))) " ago" }
                    td.num data-label="Times" { (incident.count)
                        @if incident.reopened > 0 { span.muted { ", reopened " (incident.reopened) "×" } } }
                    td.full data-label="Acknowledged" { @match (&incident.acknowledged_by, incident.acknowledged_ns) {
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
