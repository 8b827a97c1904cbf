//! Findings as sentences.

use jiff::Timestamp;

use crate::finding::{Cause, Finding};
use crate::series::Covariate;
use crate::shape::Shape;

const SECONDS_A_DAY: f64 = 86_400.0;

/// A day: `2026-11-23`.
fn date(day: f64) -> String {
    let stamp = Timestamp::from_second((day * SECONDS_A_DAY) as i64);
    stamp.map_or_else(
        |_| "?".to_owned(),
        |stamp| stamp.strftime("%Y-%m-%d").to_string(),
    )
}

/// `20 % (17 to 23 %)`, or the size with its unit where there is no level for a ratio.
fn amount(finding: &Finding) -> String {
    let [low, high] = finding.interval.map(f64::abs);
    let (low, high) = (low.min(high), low.max(high));
    let size = finding.size.abs();
    let level = finding.level.abs();
    if finding.quantity.is_friction() && level > 0.0 {
        let percent = |value: f64| 100.0 * value / level;
        return format!(
            "{:.0} % ({:.0} to {:.0} %)",
            percent(size),
            percent(low),
            percent(high)
        );
    }
    let unit = finding.quantity.unit("N m");
    format!("{size:.2} {unit} ({low:.2} to {high:.2})").replace("  ", " ")
}

fn when(finding: &Finding) -> String {
    match (finding.shape, finding.until) {
        (_, Some(until)) => format!("from {} to {}", date(finding.from), date(until)),
        (Shape::Drift, None) => format!("and has gone on since about {}", date(finding.from)),
        (_, None) => format!("since {}", date(finding.from)),
    }
}

/// A finding as a sentence.
pub(crate) fn sentence(finding: &Finding) -> String {
    let place = finding.joint.as_deref().unwrap_or("the arm");
    let what = finding.quantity.words();
    let (by, when) = (amount(finding), when(finding));
    let way = if finding.size > 0.0 { "grew" } else { "fell" };
    let mut text = match finding.cause {
        Cause::Payload if finding.size > 0.0 => {
            format!("The arm carried {by} more than its twin knows of {when}.")
        }
        Cause::Payload => format!("The arm carried {by} less than its twin says {when}."),
        Cause::Wear => format!("{place} wears: its {what} grew by {by} {when}."),
        Cause::FrictionStep => {
            format!(
                "{place}: the {what} rose at once by {by} {when}. A crash or a dragging brake does that."
            )
        }
        Cause::FrictionLoss => {
            format!(
                "{place}: the {what} fell by {by} {when}. New grease or a new gear does that, or a broken part."
            )
        }
        Cause::Gain | Cause::Offset | Cause::Backlash => {
            format!("{place}: the {what} {way} by {by} {when}.")
        }
        Cause::CommonFriction | Cause::Warmth => String::new(),
    };
    if let Some(forecast) = &finding.forecast {
        let [low, high] = forecast.days;
        text += &format!(
            " At this rate {:.3} {} is reached in {:.0} to {:.0} days.",
            forecast.limit,
            finding.quantity.unit("N m"),
            low.floor(),
            high.ceil()
        );
    }
    text
}

/// Sentence of a change common to most joints.
pub(crate) fn common(finding: &Finding, joints: usize) -> String {
    let way = if finding.size > 0.0 { "grew" } else { "fell" };
    format!(
        "The friction of {joints} joints {way} together {}, the most certain by {}. Gears do not wear at once: \
         think of warmth without a sensor, of a cold start, or of another program.",
        when(finding),
        amount(finding)
    )
}

/// Sentence of a change by warmth.
pub(crate) fn warmth(finding: &Finding, covariate: Covariate) -> String {
    let place = finding.joint.as_deref().unwrap_or("the arm");
    let with = match covariate {
        Covariate::Temperature => "the temperature",
        Covariate::TimeSinceStart => "the time since the start",
        Covariate::OtherJoints => "that of the other joints",
    };
    let way = if finding.size > 0.0 { "grew" } else { "fell" };
    format!(
        "{place}: the {} {way} by {} {} with {with}. This is warmth and no wear.",
        finding.quantity.words(),
        amount(finding),
        when(finding)
    )
}
