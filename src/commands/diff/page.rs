//! The comparison as a page that stands alone.

use std::path::Path;

use maud::{DOCTYPE, PreEscaped, html};
use tauscope_pipeline::results::Comparison;

use super::{headline, places, row};

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:75rem;margin:2rem auto;padding:0 1rem}\
table{border-collapse:collapse;margin:1rem 0}th,td{padding:.2rem .8rem;text-align:left;border-bottom:1px solid #8884}\
td.n{text-align:right}:root{color-scheme:light dark}";

/// The page.
pub fn page(comparison: &Comparison, a: &Path, b: &Path) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "tauscope diff" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "What changed" }
                p { "A: " code { (a.display()) } br; "B: " code { (b.display()) } }
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
                table {
                    tr {
                        @for name in ["", "cell", "recording", "seconds", "link", "joints", "moved", "window [ns]"] {
                            th { (name) }
                        }
                    }
                    @for difference in &comparison.differences {
                        tr {
                            @for text in row(difference) { td { (text) } }
                            td { (difference.window_ns.0) " to " (difference.window_ns.1) }
                        }
                    }
                }
            }
        }
    };
    markup.into_string()
}
