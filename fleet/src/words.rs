//! Times, ages, forces and changes in words, the same on page and terminal.

use jiff::Timestamp;
use tauscope_publish::message::{ChangeMessage, ContactMessage};

use crate::wall::CellView;

/// An age: `0.4 s`, `12 s`, `5 min`, `3 h`, `2 d`.
pub fn age(ms: u64) -> String {
    match ms {
        0..1_000 => "< 1 s".to_owned(),
        1_000..120_000 => format!("{} s", ms / 1_000),
        120_000..7_200_000 => format!("{} min", ms / 60_000),
        7_200_000..172_800_000 => format!("{} h", ms / 3_600_000),
        _ => format!("{} d", ms / 86_400_000),
    }
}

/// The age at `now_ns` of what was at `at_ns`.
pub fn age_at(at_ns: i64, now_ns: i64) -> String {
    let ms = now_ns.saturating_sub(at_ns).max(0) / 1_000_000;
    age(u64::try_from(ms).unwrap_or(0))
}

/// The offset of a cell's clock from this host's: `340 ms ahead ± 2 ms`; empty if it was not measured.
pub fn clock(view: &CellView) -> String {
    let (Some(ahead_ms), Some(most_ms)) = (view.clock_ahead_ms, view.clock_uncertainty_ms) else {
        return String::new();
    };
    let amount = |ms: f64| match ms {
        10_000.0.. => format!("{:.0} s", ms * 1e-3),
        10.0.. => format!("{ms:.0} ms"),
        _ => format!("{ms:.1} ms"),
    };
    let side = if ahead_ms < 0.0 { "behind" } else { "ahead" };
    format!("{} {side} ± {}", amount(ahead_ms.abs()), amount(most_ms))
}

/// A time for people: `2026-11-23 10:42:05 UTC`.
pub fn time(ns: i64) -> String {
    stamp(ns, "%Y-%m-%d %H:%M:%S UTC")
}

/// The time of day: `10:42:05 UTC`.
pub fn time_of_day(ns: i64) -> String {
    stamp(ns, "%H:%M:%S UTC")
}

/// A day: `2026-11-23`.
pub fn day(ns: i64) -> String {
    stamp(ns, "%Y-%m-%d")
}

/// A time for machines.
pub fn iso(ns: i64) -> String {
    stamp(ns, "%Y-%m-%dT%H:%M:%S%.3fZ")
}

fn stamp(ns: i64, format: &str) -> String {
    let stamp = Timestamp::from_nanosecond(i128::from(ns));
    stamp.map_or_else(
        |_| "?".to_owned(),
        |stamp| stamp.strftime(format).to_string(),
    )
}

/// The first characters of a hash.
pub fn short_hash(hash: Option<&String>) -> String {
    hash.map_or_else(|| "none".to_owned(), |hash| hash.chars().take(8).collect())
}

/// A contact: `collision at link5, 24 N`.
pub fn contact(contact: &ContactMessage) -> String {
    let mut text = if contact.kind.is_empty() {
        "contact".to_owned()
    } else {
        contact.kind.replace('_', " ")
    };
    if let Some(link) = &contact.link {
        text += &format!(" at {link}");
    }
    if let Some(other) = &contact.other_link {
        text += &format!(" or {other}");
    }
    if let Some(force_n) = contact.peak_force_n {
        text += &format!(", {force_n:.0} N");
    }
    if contact.end_ns.is_none() && contact.link.is_some() {
        // Link and force are known once it is over.
        text += " (first guess)";
    }
    text
}

/// A change of the arm: `not a contact: payload +2.10 kg at tool since 10:42:05 UTC`.
pub fn change(change: &ChangeMessage, effort_unit: &str) -> String {
    let known = !change.effect.is_empty() && change.effect != "unknown";
    let mut text = if known {
        let amount = tauscope_watch::amount(&change.effect, change.size, effort_unit);
        format!(
            "not a contact: {} {amount}",
            change.effect.replace('_', " ")
        )
    } else {
        "not a contact: a change that no known effect explains".to_owned()
    };
    let joints = change.joints.join(", ");
    match (&change.link, joints.is_empty()) {
        (Some(link), _) => text += &format!(" at {link}"),
        (None, false) => text += &format!(" at {joints}"),
        (None, true) => {}
    }
    text + &format!(" since {}", time_of_day(change.since_ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn ages_and_times_are_short() {
        for (ms, words) in [
            (3, "< 1 s"),
            (5_900, "5 s"),
            (400_000, "6 min"),
            (90_000_000, "25 h"),
        ] {
            assert_eq!(age(ms), words);
        }
        assert_eq!(time(1_700_000_000_000_000_000), "2023-11-14 22:13:20 UTC");
        assert_eq!(iso(1_700_000_000_123_000_000), "2023-11-14T22:13:20.123Z");
        assert_eq!(age_at(10, 5), "< 1 s");
        assert_eq!(time(i64::MIN).len(), time(0).len());
    }

    #[test]
    fn a_contact_and_a_change_are_one_sentence_each() {
        assert_eq!(
            contact(&fixture::contact(1, 5)),
            "contact at link5, 24 N (first guess)"
        );
        assert_eq!(
            change(&fixture::change(), "Nm"),
            "not a contact: payload +2.10 kg at tool since 00:00:00 UTC"
        );
    }
}
