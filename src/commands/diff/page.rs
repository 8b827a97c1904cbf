//! The comparison as a self-contained HTML page.

use std::path::Path;

use maud::{DOCTYPE, PreEscaped, html};
use tauscope_pipeline::results::Comparison;

use super::{COLUMNS, headline, places, row};

const WINDOW: &str = "window [ns]";

const STYLE: &str = "*{box-sizing:border-box}\
body{font:15px/1.5 system-ui,sans-serif;max-width:75rem;margin:2rem auto;padding:0 1rem}\
code,td,p{overflow-wrap:anywhere}\
table{border-collapse:collapse;margin:1rem 0}th,td{padding:.2rem .8rem;text-align:left;border-bottom:1px solid #8884}\
th{white-space:nowrap}td.n{text-align:right}.note{font-weight:600}:root{color-scheme:light dark}\
@media(max-width:60rem){body{margin:1rem auto}table{width:100%}\
table.fold,.fold tbody,.fold td{display:block}.fold tr.names{display:none}\
.fold tr{display:grid;grid-template-columns:minmax(0,1fr);padding:.5rem 0;border-bottom:1px solid #8884}\
.fold td{padding:0;border:0}.fold td:empty{display:none}\
.fold td[data-label]::before{content:attr(data-label) \": \";opacity:.7}}";

/// Returns the page.
pub fn page(comparison: &Comparison, a: &Path, b: &Path, note: Option<&str>) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "tauscope diff" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "What changed" }
                p { "A: " code { (a.display()) } br; "B: " code { (b.display()) } }
                @if let Some(note) = note { p.note { (note) } }
                p { (headline(comparison)) "." }
                @for (name, only) in [("A", &comparison.only_in_a), ("B", &comparison.only_in_b)] {
                    @if !only.is_empty() { p { "Only in " (name) ": " (only.join(", ")) } }
                }
                h2 { "Where" }
                table {
                    tr { th { "place" } th { "appeared" } th { "vanished" } th { "moved" } }
                    @for (place, counts) in places(comparison) {
                        tr {
                            td { (place) }
                            @for n in [counts.appeared, counts.vanished, counts.moved] { td.n { (n) } }
                        }
                    }
                }
                h2 { "Events" }
                p { "Seconds count from the first sample of the recording; the window is in ns since the epoch." }
                table.fold {
                    tr.names {
                        @for name in COLUMNS { th { (name) } }
                        th { (WINDOW) }
                    }
                    @for difference in &comparison.differences {
                        tr {
                            @for (name, text) in COLUMNS.iter().zip(row(difference)) {
                                td data-label=[(!name.is_empty()).then_some(name)] { (text) }
                            }
                            td data-label=(WINDOW) { (difference.window_ns.0) " to " (difference.window_ns.1) }
                        }
                    }
                }
            }
        }
    };
    markup.into_string()
}
