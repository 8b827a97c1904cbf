//! Error reports of a query, with the place of the error and a remedy.

use std::ops::Range;
use std::path::Path;

use datafusion::common::SchemaError;
use datafusion::error::DataFusionError;
use datafusion::prelude::SessionContext;
use tauscope_pipeline::report::{Problem, Report, Source};
use tauscope_pipeline::suggest;

use crate::results;

/// Tables of archives.
const OF_ARCHIVES: [&str; 2] = ["recordings", "joints"];

/// Reports an error in the terms of the query.
pub(crate) fn of_query(context: &SessionContext, sql: &str, error: &DataFusionError) -> Report {
    // Invalid files passed to a table function.
    if let Some(report) = report_in(error) {
        return report.clone();
    }
    let text = error.strip_backtrace();
    let text = text.lines().next().unwrap_or_default();
    if let Some(name) = missing_table(text) {
        let title = format!("there is no table `{name}`");
        return at(sql, place_of_table(sql, name), title)
            .help(remedy(context, name))
            .into();
    }
    if let DataFusionError::SchemaError(of, _) = error.find_root()
        && let SchemaError::FieldNotFound {
            field,
            valid_fields,
        } = &**of
    {
        let names: Vec<&str> = valid_fields.iter().map(|column| column.name()).collect();
        let title = format!("there is no column `{}`", field.name());
        let help = suggest::help(field.name(), "the columns are", names);
        return at(sql, place_of_word(sql, field.name()), title)
            .maybe_help(help)
            .into();
    }
    let (title, place) = match text.split_once(" at Line: ") {
        Some((title, place)) => (title, place_of_line(sql, place)),
        None => (text, None),
    };
    at(sql, place, plain(title)).into()
}

/// Reason of an aborted answer, in one line.
pub fn of_answer(error: &anyhow::Error) -> String {
    match error.downcast_ref::<DataFusionError>() {
        Some(inner) => plain(&inner.strip_backtrace()),
        None => format!("{error:#}"),
    }
}

fn report_in(error: &DataFusionError) -> Option<&Report> {
    match error.find_root() {
        DataFusionError::External(inner) => inner.downcast_ref(),
        _ => None,
    }
}

fn at(sql: &str, place: Option<Range<usize>>, title: impl Into<String>) -> Problem {
    match place {
        Some(place) => Problem::at(
            &Source::new(Path::new("the query"), sql.to_owned()),
            place,
            title,
        ),
        None => Problem::new(title),
    }
}

/// The message without the enclosing names of `DataFusion`'s types.
fn plain(title: &str) -> String {
    let wrappers = [
        "Error during planning: ",
        "SQL error: ",
        "External error: ",
        "Arrow error: ",
        "Schema error: ",
    ];
    let mut title = title;
    while let Some(inner) = wrappers
        .iter()
        .find_map(|wrapper| title.strip_prefix(wrapper))
    {
        title = inner;
    }
    let inner = title
        .strip_prefix("ParserError(\"")
        .or_else(|| title.strip_prefix("TokenizerError(\""));
    inner
        .unwrap_or(title)
        .trim_end_matches("\")")
        .replace("\\\"", "\"")
}

/// Name of the table in `table 'datafusion.public.event' not found`.
fn missing_table(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once("table '")?;
    let (name, rest) = rest.split_once('\'')?;
    let name = name.rsplit('.').next()?;
    rest.starts_with(" not found").then_some(name)
}

fn remedy(context: &SessionContext, name: &str) -> String {
    if OF_ARCHIVES.contains(&name) {
        return "name the recordings behind the query: 'archive/*.mcap' or a manifest".to_owned();
    }
    if results::names().any(|known| known == name) {
        return "name a folder of `tauscope replay --manifest --out` behind the query".to_owned();
    }
    let names = context
        .catalog("datafusion")
        .and_then(|catalog| catalog.schema("public"));
    let mut names = names.map_or_else(Vec::new, |schema| schema.table_names());
    names.sort_unstable();
    let all = OF_ARCHIVES.into_iter().chain(results::names());
    match suggest::nearest(name, all) {
        Some(known) => format!("did you mean `{known}`?"),
        None if names.is_empty() => {
            "name recordings or folders of results behind the query".to_owned()
        }
        None => format!(
            "the tables are {}",
            suggest::list(names.iter().map(String::as_str))
        ),
    }
}

/// Place of `name` in the query as a table: after FROM or JOIN, otherwise anywhere.
fn place_of_table(sql: &str, name: &str) -> Option<Range<usize>> {
    let behind = |place: &Range<usize>| {
        let before = sql[..place.start].trim_end().to_ascii_lowercase();
        before.ends_with("from") || before.ends_with("join")
    };
    places_of_word(sql, name)
        .find(behind)
        .or_else(|| place_of_word(sql, name))
}

fn place_of_word(sql: &str, word: &str) -> Option<Range<usize>> {
    places_of_word(sql, word).next()
}

/// Places of `word` in the query as a whole word.
fn places_of_word(sql: &str, word: &str) -> impl Iterator<Item = Range<usize>> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let lower = sql.to_ascii_lowercase();
    let word = word.to_ascii_lowercase();
    let places: Vec<_> = lower
        .match_indices(&word)
        .map(|(at, found)| at..at + found.len())
        .collect();
    places.into_iter().filter(move |place| {
        !lower[..place.start].ends_with(is_part) && !lower[place.end..].starts_with(is_part)
    })
}

/// Place in the query of `1, Column: 8`.
fn place_of_line(sql: &str, place: &str) -> Option<Range<usize>> {
    let (line, column) = place.split_once(", Column: ")?;
    let column: String = column.chars().take_while(char::is_ascii_digit).collect();
    let (line, column): (usize, usize) = (line.parse().ok()?, column.parse().ok()?);
    let before: usize = sql
        .split_inclusive('\n')
        .take(line.checked_sub(1)?)
        .map(str::len)
        .sum();
    let from = sql[before..]
        .char_indices()
        .nth(column.checked_sub(1)?)
        .map_or(sql.len(), |(at, _)| before + at);
    let to = sql[from..]
        .find(char::is_whitespace)
        .map_or(sql.len(), |len| from + len);
    Some(from..to)
}
