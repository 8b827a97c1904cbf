//! The wall: all cells, the worst first.

use maud::{Markup, html};

use super::{Viewer, layout, tile};
use crate::wall::{Severity, Snapshot, State};
use crate::words;

/// The page.
pub fn page(viewer: &Viewer, snapshot: &Snapshot) -> Markup {
    let content = html! {
        h1.quiet { "The wall" }
        p #lost role="alert" hidden {
            strong { "The connection to the fleet host is lost." } " The data on this page is outdated."
        }
        div #summary { (summary(snapshot)) }
        p #said.quiet role="status" aria-live="polite" {}
        @if snapshot.cells.is_empty() {
            p #empty { "No cell has connected yet. A cell appears once its pipeline has a " code { "publish" }
                " stage with " code { "zenoh" } " that connects to the router of this host." }
        }
        section #tiles aria-label="Cells, the worst first" {
            @for view in &snapshot.cells {
                div data-cell=(view.cell) { (tile::tile(view, snapshot.now_ns)) }
            }
        }
    };
    layout(viewer, "Wall", true, &content)
}

/// The line above the tiles.
pub fn summary(snapshot: &Snapshot) -> Markup {
    let refused: u64 = snapshot.refused.values().sum();
    html! {
        p.summary {
            span { (tile::stamp(snapshot.now_ns, &words::time(snapshot.now_ns))) }
            @for name in State::NAMES {
                @let count = snapshot.totals.get(name).copied().unwrap_or(0);
                @if count > 0 {
                    span.count data-severity=(severity(name)) { strong { (count) } " " (name.replace('_', " ")) }
                }
            }
        }
        @if snapshot.sessions_reached == 0 {
            p.refused role="alert" { strong { "This fleet host has no connection to a router or cell." } " This page is outdated." }
        }
        @if let Some(why) = &snapshot.unkept {
            p.refused role="alert" { strong { "Incidents and history are currently not stored." } " " (why) }
        }
        @if refused > 0 {
            details.muted {
                summary { (refused) " messages were refused" }
                ul { @for (reason, count) in &snapshot.refused { li { (count) " × " (reason) } } }
            }
        }
    }
}

fn severity(state: &str) -> &'static str {
    tile::name(match state {
        "stopped" => Severity::Critical,
        "stale" | "unknown" | "never_seen" => Severity::Serious,
        "running" => Severity::Good,
        _ => Severity::Notice,
    })
}
