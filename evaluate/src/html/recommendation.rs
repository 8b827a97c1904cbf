//! Recommended detector with its reason, and detectors that are often in alarm during contact-free time.

use maud::{Markup, html};

use crate::judged::Judged;
use crate::metrics::Numbers;

/// Share of the contact-free time in alarm above which a detector is not recommended.
/// Chosen: three minutes an hour, at which an operator no longer heeds an alarm; less would exclude detectors that
/// hold their alarms for a while.
const ALWAYS_ON: f64 = 0.05;
/// Share of the contact-free time in alarm above which the page warns.
/// Chosen: half a minute an hour, above which the number of false alarms alone misleads.
const OFTEN_ON: f64 = 0.01;

/// Returns the detector with the fewest mistakes: missed contacts plus false alarms, with equal weight. Ties are
/// resolved by the shorter time in alarm, then by the shorter delay. A detector above [`ALWAYS_ON`] is chosen only
/// if all are. `None` if nothing was scored or no test recording holds a contact.
pub(super) fn best<'a, 'b>(judged: &'b [Judged<'a>]) -> Option<&'b Judged<'a>> {
    let scored = judged.iter().filter(|j| !j.scored.is_empty());
    scored
        .filter(|judged| judged.first().events > 0)
        .min_by(|a, b| {
            rank(a)
                .partial_cmp(&rank(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })
}

/// Sort key of a detector; the smallest is the best.
fn rank(judged: &Judged<'_>) -> (bool, f64, f64, f64) {
    let numbers = judged.first();
    let share = numbers.free_share_in_alarm;
    let delay = numbers.delay_s.p50;
    (
        share > ALWAYS_ON,
        mistakes(judged),
        if share.is_finite() { share } else { 0.0 },
        if delay.is_finite() { delay } else { f64::MAX },
    )
}

/// Mean number of mistakes over the seeds, because the result of a neural network depends on its seed.
fn mistakes(judged: &Judged<'_>) -> f64 {
    let of = |numbers: &Numbers| numbers.events - numbers.found + numbers.false_alarms;
    let sum: usize = judged.numbers.iter().map(of).sum();
    sum as f64 / judged.numbers.len() as f64
}

/// The recommendation in a sentence; all its numbers belong to the recommended detector.
pub(super) fn sentence(judged: &[Judged<'_>]) -> String {
    let Some(best) = best(judged) else {
        return format!(
            "{} detectors ran; none can be recommended, because no labelled test recording holds a contact",
            judged.len()
        );
    };
    let reason = if judged.len() == 1 {
        "It is the only one that ran:".to_owned()
    } else if rank(best).0 {
        "All are in alarm for much of the time without contact; it makes the fewest mistakes of them:".to_owned()
    } else {
        let alike = |other: &&Judged<'_>| {
            mistakes(other) <= mistakes(best) && other.first().free_share_in_alarm <= ALWAYS_ON
        };
        let others = judged.iter().filter(|one| one.label != best.label);
        let alike = others.filter(alike).map(share_and_delay);
        ahead_of(share_and_delay(best), &alike.collect::<Vec<_>>())
    };
    let seeds = best.numbers.len();
    let of_which = if seeds > 1 {
        format!(" (the first of {seeds} seeds)")
    } else {
        String::new()
    };
    format!(
        "Take {}. {reason} {}{of_which}.",
        best.label,
        said_of(best.first())
    )
}

/// Share of the contact-free time in alarm, and delay: the criteria among detectors with equally few mistakes.
fn share_and_delay(judged: &Judged<'_>) -> (f64, f64) {
    let (_, _, share, delay) = rank(judged);
    (share, delay)
}

/// Reason why the detector with this share and delay ranks before others with equally few mistakes.
fn ahead_of((share, delay): (f64, f64), alike: &[(f64, f64)]) -> String {
    let few = match alike.len() {
        0 => return "It makes the fewest mistakes:".to_owned(),
        1 => "as few as one other".to_owned(),
        n => format!("as few as {n} others"),
    };
    let why = if alike.iter().all(|other| share < other.0) {
        "is in alarm without contact for the least time of them"
    } else if alike.iter().all(|other| delay < other.1) {
        "has the shortest delay of them"
    } else {
        "of those in alarm without contact for the least time it has the shortest delay"
    };
    format!("It makes the fewest mistakes, {few}, and {why}:")
}

fn said_of(numbers: &Numbers) -> String {
    let delay_ms = 1e3 * numbers.delay_s.p50;
    let delay = if delay_ms.is_finite() {
        format!(", half of them within {delay_ms:.0} ms")
    } else {
        String::new()
    };
    format!(
        "it finds {} of {} contacts{delay}, with {}",
        numbers.found,
        numbers.events,
        false_alarms(numbers)
    )
}

/// Number of false alarms, contact-free time and the 95 % bound on the rate, in words.
pub(super) fn false_alarms(numbers: &Numbers) -> String {
    let count = match numbers.false_alarms {
        0 => "no false alarm".to_owned(),
        1 => "1 false alarm".to_owned(),
        n => format!("{n} false alarms"),
    };
    let bound = numbers.false_alarms_per_hour_bound;
    if !bound.is_finite() {
        return count;
    }
    format!(
        "{count} in {:.1} min without contact (under {} an hour at 95 %)",
        60.0 * numbers.free_hours,
        bound_text(bound)
    )
}

/// Formats an upper bound, rounded up: `36`, `0.4`.
pub(super) fn bound_text(per_hour: f64) -> String {
    if per_hour >= 10.0 {
        format!("{:.0}", per_hour.ceil())
    } else {
        format!("{:.1}", (10.0 * per_hour).ceil() / 10.0)
    }
}

/// Warning about detectors that are often in alarm without contact: an alarm that never ends is one false alarm.
pub(super) fn flagged(judged: &[Judged<'_>]) -> Option<Markup> {
    let often = |judged: &&Judged<'_>| judged.first().free_share_in_alarm > OFTEN_ON;
    let mut flagged: Vec<&Judged<'_>> = judged.iter().filter(often).collect();
    flagged.sort_by(|a, b| {
        let share = |judged: &Judged<'_>| judged.first().free_share_in_alarm;
        share(b).total_cmp(&share(a))
    });
    (!flagged.is_empty()).then(|| {
        let said = |judged: &&Judged<'_>| {
            let share = 100.0 * judged.first().free_share_in_alarm;
            format!("{} {share:.0} %", judged.label)
        };
        let all: Vec<String> = flagged.iter().map(said).collect();
        html! {
            p.rival {
                b { "In alarm without contact for much of the time: " }
                (all.join(", "))
                ". A continuous alarm counts as one false alarm, however long it lasts: read the counts of these with care."
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_reason_that_decided_is_told() {
        let told = |alike: &[(f64, f64)]| ahead_of((0.01, 0.09), alike);
        assert_eq!(told(&[]), "It makes the fewest mistakes:");
        assert!(told(&[(0.02, 0.05)]).contains("as few as one other, and is in alarm"));
        assert!(
            told(&[(0.01, 0.1), (0.02, 0.1)])
                .contains("2 others, and has the shortest delay of them")
        );
        assert!(told(&[(0.01, 0.1), (0.02, 0.05)]).contains("of those in alarm"));
    }

    #[test]
    fn a_bound_is_rounded_up() {
        assert_eq!(bound_text(35.95), "36");
        assert_eq!(bound_text(0.31), "0.4");
    }
}
