//! `report.html`: one self-contained page with the tables, receiver operating characteristics and delays. It shares
//! the style sheet and the content security policy of explain's page.

mod delays;
mod recommendation;
mod roc;
mod timeline;
mod tuning;

use std::collections::BTreeMap;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use tauscope_pipeline::provenance;
use tauscope_report::{POLICY, STYLE};

use crate::evaluation::Evaluation;
use crate::judged::Judged;
use crate::recording::Role;
use crate::tables::Table;

/// Style rules in addition to explain's style sheet.
const OWN_STYLE: &str = include_str!("html/style.css");

/// Number of line colours in the style sheet; further detectors reuse them with a dashed line.
/// Physical: the number of colours in the style sheet.
const COLOURS: usize = 7;

/// The page.
///
/// # Errors
/// If the set's files can no longer be read.
pub fn page(
    evaluation: &Evaluation,
    judged: &[Judged<'_>],
    tables: &[Table],
) -> std::io::Result<String> {
    let provenance = provenance_of(evaluation)?;
    let sections = [
        ("time", "Scores over time", timeline::section(judged)),
        (
            "roc",
            "Receiver operating characteristics",
            roc::section(judged),
        ),
        ("delays", "Detection delays", delays::section(judged)),
        ("tuning", "Tuning", tuning::section(judged)),
        ("tables", "Tables", Some(self::tables(tables))),
        ("notes", "Notes", notes(&evaluation.all_notes())),
    ];
    let sections: Vec<(&str, &str, Markup)> = (sections.into_iter())
        .filter_map(|(id, title, body)| Some((id, title, body?)))
        .collect();
    let set = &evaluation.request.set.set;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (set) ": detectors evaluated" }
                style { (PreEscaped(STYLE)) (PreEscaped(OWN_STYLE)) }
            }
            body {
                main {
                    (header(evaluation, judged))
                    nav { @for (id, title, _) in &sections { a href={ "#" (id) } { (title) } } }
                    @for (id, title, body) in &sections {
                        section id=(id) { h2 { (title) } (body) }
                    }
                    (footer(&provenance))
                }
            }
        }
    };
    Ok(page.into_string())
}

/// Class of a detector's line.
fn line_class(index: usize) -> String {
    let dashed = if index >= COLOURS { " dashed" } else { "" };
    format!("c{}{dashed}", index % COLOURS)
}

fn header(evaluation: &Evaluation, judged: &[Judged<'_>]) -> Markup {
    let request = &evaluation.request;
    let tests = request
        .recordings
        .iter()
        .filter(|r| r.role == Role::Test)
        .count();
    let scored = judged.first().map_or(0, |judged| judged.scored.len());
    let (class, sign) = if scored > 0 {
        ("nothing", "✓")
    } else {
        ("none", "–")
    };
    let mut facts = vec![(
        format!("{scored} of {tests}"),
        "test recordings scored".to_owned(),
    )];
    if let Some(first) = judged.first().filter(|judged| !judged.scored.is_empty()) {
        let numbers = first.first();
        facts.push((numbers.events.to_string(), "contacts in them".to_owned()));
        let minutes = format!("{:.1} min", 60.0 * numbers.free_hours);
        facts.push((minutes, "without contact".to_owned()));
    }
    if evaluation.lost > 0 {
        facts.push((
            evaluation.lost.to_string(),
            "samples lost or refused".to_owned(),
        ));
    }
    html! {
        header class={ "verdict " (class) } {
            p.kicker {
                span.badge { span.sign aria-hidden="true" { (sign) } " Evaluated" }
                span.case { (request.set.set) }
            }
            h1 { (recommendation::sentence(judged)) }
            dl.facts { @for (number, text) in facts { div { dt { (number) } dd { (text) } } } }
            @if let Some(flagged) = recommendation::flagged(judged) { (flagged) }
        }
    }
}

fn tables(tables: &[Table]) -> Markup {
    html! {
        @for table in tables {
            div.card {
                h3 { (table.title) }
                @if !table.note.is_empty() { p.muted { (table.note) } }
                div.wide {
                    table.matrix {
                        thead {
                            tr {
                                @for (index, name) in table.head.iter().enumerate() {
                                    th.num[index > 0] scope="col" { (name) }
                                }
                            }
                        }
                        tbody {
                            @for row in &table.rows {
                                tr {
                                    @for (index, cell) in row.iter().enumerate() {
                                        @if index == 0 { th scope="row" { (breakable(cell)) } } @else { td.num { (cell) } }
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A detector's name that may be broken after an underscore only, for narrow screens.
fn breakable(name: &str) -> Markup {
    html! {
        @for (index, part) in name.split_inclusive('_').enumerate() {
            @if index > 0 { wbr; }
            (part)
        }
    }
}

fn notes(notes: &[String]) -> Option<Markup> {
    (!notes.is_empty()).then(|| html! { ul { @for note in notes { li { (note) } } } })
}

fn provenance_of(evaluation: &Evaluation) -> std::io::Result<BTreeMap<String, String>> {
    let request = &evaluation.request;
    let mut all = BTreeMap::from([
        ("tauscope".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("set".to_owned(), provenance::sha256_of_file(&request.path)?),
    ]);
    for recording in &request.recordings {
        let key = format!("{}/{}", recording.role.as_str(), recording.name);
        all.insert(key, provenance::sha256_of_file(&recording.path)?);
    }
    Ok(all)
}

fn footer(provenance: &BTreeMap<String, String>) -> Markup {
    html! {
        footer {
            details {
                summary { "How to read this page" }
                dl.words {
                    dt { "AUC" } dd { "The probability that a sample in a contact scores higher than one outside." }
                    dt { "F1" } dd { "Harmonic mean of precision and recall of the samples at a threshold." }
                    dt { "Best F1" } dd { "The best over thresholds of mean + i standard deviations of the validation scores, for the i of the papers: what the method could do, not what a user would get. The threshold that was set may lie between two of them and do a little better." }
                    dt { "Found" } dd { "An alarm from 20 ms before the labelled beginning to 150 ms after the end." }
                    dt { "False alarm" } dd { "An alarm that belongs to no contact, nor comes in the rest after one; those within 250 ms of each other count once." }
                    dt { "Under … an hour at 95 %" } dd { "A detector with this rate would raise at most this number of false alarms in one of 20 evaluations like this one (Poisson). Few minutes without contact cannot show a low rate." }
                    dt { "Recommended" } dd { "The fewest mistakes: missed contacts and false alarms together. Of equals the one that is in alarm for less time, then the faster one. A detector that is in alarm for more than 5 % of the time without contact is not recommended." }
                }
            }
            details.provenance {
                summary { "Made from" }
                dl { @for (key, value) in provenance { dt { (key) } dd { (value) } } }
            }
        }
    }
}
