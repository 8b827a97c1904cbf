//! Live output of a run: lines, and on a terminal a table below them.

use std::time::{Duration, Instant};

use comfy_table::{CellAlignment, Table, presets};
use indicatif::{ProgressBar, ProgressStyle};

use crate::progress::draw_target;
use crate::terminal;

/// Verbosity of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Verbosity {
    /// Warnings and errors.
    Quiet,
    /// Also starts, findings, and a status line now and then.
    #[default]
    Normal,
    /// Also a status line every 2 s, and each step of the start.
    Verbose,
}

/// Time before the first status line.
const FIRST_LINE: Duration = Duration::from_secs(2);
/// Interval of further status lines.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// Interval of status lines if verbose.
const LINE_EVERY_VERBOSE: Duration = Duration::from_secs(2);
/// Refresh interval of the table.
const DRAW_EVERY: Duration = Duration::from_millis(500);

/// Status of a stage.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its name.
    pub stage: String,
    /// Received samples; for a source, emitted ones.
    pub received: u64,
    /// Sample rate \[Hz\].
    pub rate_hz: f64,
    /// Time since the newest sample; `None` before the first one.
    pub age: Option<Duration>,
    /// Samples lost or refused.
    pub dropped: u64,
    /// Progress of a source of known length, from 0 to 1.
    pub fraction_done: Option<f64>,
    /// Current condition, such as a mute or a contact; empty if there is none.
    pub holds: String,
}

/// Live output of a run.
#[derive(Debug)]
pub struct View {
    verbosity: Verbosity,
    /// Table below the lines, on a terminal.
    bar: Option<ProgressBar>,
    began: Instant,
    due: Instant,
}

impl View {
    /// Creates a view of this verbosity.
    pub fn new(verbosity: Verbosity, now: Instant) -> Self {
        let draws = terminal::can_redraw() && verbosity > Verbosity::Quiet;
        let bar = draws.then(|| {
            let bar = ProgressBar::with_draw_target(None, draw_target());
            let style = ProgressStyle::with_template("{msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        let due = now
            + if bar.is_some() {
                DRAW_EVERY
            } else {
                FIRST_LINE
            };
        Self {
            verbosity,
            bar,
            began: now,
            due,
        }
    }

    /// Prints a warning or an error.
    pub fn warn(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }

    /// Prints a start, an end or a finding, unless quiet.
    pub fn note(&self, line: &str) {
        if self.verbosity >= Verbosity::Normal {
            self.warn(line);
        }
    }

    /// Prints a detail, if verbose.
    pub fn detail(&self, line: &str) {
        if self.verbosity >= Verbosity::Verbose {
            self.warn(line);
        }
    }

    /// Shows the status of the stages, if due.
    pub fn show(&mut self, now: Instant, rows: impl FnOnce() -> Vec<Row>) {
        if now < self.due || self.verbosity == Verbosity::Quiet {
            return;
        }
        if let Some(bar) = &self.bar {
            self.due = now + DRAW_EVERY;
            bar.set_message(table(&rows()));
            bar.tick();
            return;
        }
        let verbose = self.verbosity == Verbosity::Verbose;
        self.due = now
            + if verbose {
                LINE_EVERY_VERBOSE
            } else {
                LINE_EVERY
            };
        let seconds = now.duration_since(self.began).as_secs_f64();
        self.note(&format!("{seconds:.0} s: {}", line(&rows())));
    }
}

impl Drop for View {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Formats the status of all stages as a line.
fn line(rows: &[Row]) -> String {
    let each = rows.iter().map(|row| {
        let mut text = format!("{} {}", row.stage, row.received);
        if let Some(age) = row.age {
            text += &format!(" ({:.0} Hz, last {} ago", row.rate_hz, seconds(age));
            if row.dropped > 0 {
                text += &format!(", {} dropped", row.dropped);
            }
            text.push(')');
        }
        if !row.holds.is_empty() {
            text += &format!(", {}", row.holds);
        }
        if let Some(done) = row.fraction_done {
            text += &format!(", {:.0} % done", 100.0 * done);
        }
        text
    });
    each.collect::<Vec<_>>().join("; ")
}

/// Formats the status as a table, with a row for each stage.
fn table(rows: &[Row]) -> String {
    let mut table = Table::new();
    table
        .load_preset(presets::NOTHING)
        .set_header(["stage", "received", "Hz", "last", "dropped", "", ""]);
    for row in rows {
        let age = row
            .age
            .map_or_else(|| "-".to_owned(), |age| format!("{} ago", seconds(age)));
        let done = row
            .fraction_done
            .map(|done| format!("{:.0} %", 100.0 * done));
        table.add_row([
            row.stage.clone(),
            row.received.to_string(),
            format!("{:.0}", row.rate_hz),
            age,
            row.dropped.to_string(),
            done.unwrap_or_default(),
            row.holds.clone(),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.trim_fmt()
}

fn seconds(age: Duration) -> String {
    format!("{:.1} s", age.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_age_and_loss_stand_in_a_line_and_in_a_table() {
        let row = |stage: &str, age_ms: Option<u64>, dropped| Row {
            stage: stage.to_owned(),
            received: 1200,
            rate_hz: 499.7,
            age: age_ms.map(Duration::from_millis),
            dropped,
            fraction_done: None,
            holds: if stage == "ingest" { "muted" } else { "" }.to_owned(),
        };
        let rows = [row("ingest", Some(40), 3), row("twin", None, 0)];
        assert_eq!(
            line(&rows),
            "ingest 1200 (500 Hz, last 0.0 s ago, 3 dropped), muted; twin 1200"
        );
        let table = table(&rows);
        let shown: Vec<Vec<&str>> = table
            .lines()
            .map(|line| line.split_whitespace().collect())
            .collect();
        assert_eq!(shown[0], ["stage", "received", "Hz", "last", "dropped"]);
        assert_eq!(
            shown[1],
            ["ingest", "1200", "500", "0.0", "s", "ago", "3", "muted"]
        );
    }
}
