//! Tables of the papers and further tables, for the terminal, the page and `--json`.

mod contacts;
mod cycles;
mod overall;

use comfy_table::{CellAlignment, presets};
use serde::Serialize;

use crate::evaluation::Evaluation;
use crate::judged::Judged;
use crate::metrics::statistics::{Distribution, mean_sd};

/// A table.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Table {
    /// Title.
    pub title: String,
    /// Explanation of the columns.
    pub note: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows; the first cell is the label.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    fn new(title: impl Into<String>, note: impl Into<String>, head: &[&str]) -> Self {
        Self {
            title: title.into(),
            note: note.into(),
            head: head.iter().map(|name| (*name).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }
}

/// All tables that apply to this set.
pub fn all(evaluation: &Evaluation, judged: &[Judged<'_>]) -> Vec<Table> {
    let mut tables = vec![overall::twins(evaluation)];
    let any_label = judged.iter().any(|judged| !judged.scored.is_empty());
    if any_label {
        tables.push(overall::samples(judged));
        tables.extend(overall::windows(judged));
        tables.push(overall::events(judged, evaluation.request.set.recovery_s));
        tables.push(overall::places(judged));
        tables.extend(contacts::tables(judged));
        tables.extend(cycles::tables(&evaluation.request, judged));
    } else {
        tables.push(overall::unscored(evaluation, judged));
    }
    tables.extend(overall::smallest(judged));
    tables
}

/// Formats tables and notes for a terminal.
pub fn text(tables: &[Table], notes: &[String]) -> String {
    let mut text = String::new();
    for table in tables {
        text.push_str(&format!("\n{}\n", table.title));
        if !table.note.is_empty() {
            text.push_str(&format!("  {}\n", table.note));
        }
        let mut drawn = comfy_table::Table::new();
        drawn.load_preset(presets::NOTHING);
        drawn.set_header(&table.head);
        for row in &table.rows {
            drawn.add_row(row);
        }
        for column in drawn.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        text.push_str(&format!("{drawn}\n"));
    }
    for note in notes {
        text.push_str(&format!("\nnote: {note}"));
    }
    text
}

/// Formats a number with `decimals` decimals; a dash if it is not finite.
fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() {
        format!("{value:.decimals$}")
    } else {
        "-".to_owned()
    }
}

/// Formats a count with its share: `7/9 (77.8 %)`.
fn part(count: usize, all: usize) -> String {
    match all {
        0 => "-".to_owned(),
        _ => format!("{count}/{all} ({} %)", percent(count, all)),
    }
}

fn percent(count: usize, all: usize) -> String {
    number(100.0 * count as f64 / all as f64, 1)
}

/// Formats the mean over seeds, with the standard deviation if there are several.
fn over_seeds(values: &[f64], decimals: usize) -> String {
    let (mean, sd) = mean_sd(values);
    match values {
        [_] => number(mean, decimals),
        _ if mean.is_nan() => "-".to_owned(),
        _ => format!("{mean:.decimals$} ± {sd:.decimals$}"),
    }
}

/// Formats mean and standard deviation in ms.
fn mean_sd_ms(of: &Distribution) -> String {
    match of.count {
        0 => "-".to_owned(),
        _ => format!("{:.0} ± {:.0}", 1e3 * of.mean, 1e3 * of.sd),
    }
}

fn ms(seconds: f64) -> String {
    number(1e3 * seconds, 0)
}
