//! The wall for a terminal: a table, and a line for each change.

use comfy_table::{Table, presets};

use crate::wall::{CellView, Snapshot, State};
use crate::words;

/// Maximum number of clocks named above the table. Resolution: more of them are one fault, this host's own clock.
const MOST_CLOCKS: usize = 3;

/// All cells as a table, under a line that sums them up.
pub fn table(snapshot: &Snapshot) -> String {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_header([
        "cell",
        "state",
        "since",
        "sample",
        "last contact",
        "today",
        "lost",
        "residual",
        "drifts most",
    ]);
    for view in &snapshot.cells {
        table.add_row(row(view, snapshot.now_ns));
    }
    let mut text = summary(snapshot);
    text.push('\n');
    if !snapshot.cells.is_empty() {
        for line in table.lines() {
            text += line.trim_end();
            text.push('\n');
        }
    }
    text
}

/// Summarizes the number of cells in each state, and the faults of the fleet host itself.
pub fn summary(snapshot: &Snapshot) -> String {
    let all = snapshot.cells.len();
    let counts = State::NAMES.iter().filter_map(|name| {
        let count = snapshot.totals.get(name).copied().unwrap_or(0);
        (count > 0).then(|| format!("{count} {}", name.replace('_', " ")))
    });
    let counts: Vec<String> = counts.collect();
    let mut text = format!("{}  {all} cells", words::time(snapshot.now_ns));
    if !counts.is_empty() {
        text += &format!(": {}", counts.join(", "));
    }
    if snapshot.sessions_reached == 0 {
        text += "; THIS HOST REACHES NO ROUTER, nothing here is fresh";
    }
    if let Some(why) = &snapshot.unkept {
        text += &format!("; incidents are not kept: {why}");
    }
    let off = snapshot.cells.iter().filter(|view| view.clock_is_off);
    for view in off.take(MOST_CLOCKS) {
        text += &format!("; {}: clock {}", view.cell, words::clock(view));
    }
    let refused: u64 = snapshot.refused.values().sum();
    if refused > 0 {
        text += &format!("; {refused} messages refused");
    }
    text
}

/// A cell in one line, for a pipe.
pub fn line(view: &CellView, now_ns: i64) -> String {
    let reason = view.state.reason();
    let colon = if reason.is_empty() { "" } else { ": " };
    let words = view.state.words();
    format!(
        "{}  {}  {words}{colon}{reason}",
        words::iso(now_ns),
        view.cell
    )
}

fn row(view: &CellView, now_ns: i64) -> [String; 9] {
    let none = || "-".to_owned();
    let stream_now_ns = view.stream_now_ns().unwrap_or(now_ns);
    let status = view.status.as_ref();
    let contact = status.and_then(|status| status.last_contact.as_ref());
    let state = match view.state {
        State::Muted { until_ns } => format!("muted until {}", words::time_of_day(until_ns)),
        state if view.latched_behind().is_some() => format!("{}, latched", state.words()),
        state => state.words().to_owned(),
    };
    [
        view.cell.clone(),
        state,
        view.since_ns
            .map_or_else(none, |since_ns| words::age_at(since_ns, now_ns)),
        view.sample_age_ms.map_or_else(none, words::age),
        contact.map_or_else(none, |contact| {
            let ago = words::age_at(contact.onset_ns, stream_now_ns);
            format!("{}, {ago} ago", words::contact(contact))
        }),
        status.map_or_else(none, |status| status.contacts_today.to_string()),
        view.lost_samples.to_string(),
        view.residual
            .as_ref()
            .map_or_else(none, |residual| format!("{:.2} x normal", residual.ratio)),
        view.residual.as_ref().map_or_else(none, |residual| {
            format!("{} {:.2} x", residual.joint, residual.joint_ratio)
        }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use crate::wall::{Event, Now, Wall};

    #[test]
    fn the_table_has_a_line_for_each_cell_and_says_what_is_not_fresh() {
        let mut wall = Wall::new(["b".to_owned()]);
        let now = Now {
            running_ms: 0,
            unix_ns: 5_000_000_000,
        };
        let (cell, instance) = ("a".to_owned(), "x".to_owned());
        wall.take(
            Event::Alive {
                cell: cell.clone(),
                instance,
            },
            now,
        );
        let mut status = fixture::status("x", 5);
        status.last_contact = Some(fixture::contact(1, 3));
        let status = Box::new(status);
        wall.take(Event::Status { cell, status }, now);
        let text = table(&wall.snapshot());
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert!(
            lines[0].contains("2 cells: 1 never seen, 1 running"),
            "{text}"
        );
        assert!(lines[0].contains("REACHES NO ROUTER"), "{text}");
        assert!(
            lines[2].trim_start().starts_with('b') && lines[2].contains("never seen"),
            "{text}"
        );
        assert!(
            lines[3].contains("contact at link5, 24 N (first guess), 1 s ago"),
            "{text}"
        );
        assert!(lines[3].contains("joint2 3.00 x"), "{text}");
    }
}
