//! Diagnosis of one arm from all of its series. A load changes several joints in the pattern of a mass, and the
//! payload has a series of its own; wear changes the friction of one joint; warmth follows the temperature.

use crate::finding::{Cause, Finding};
use crate::forecast::forecast;
use crate::robust::median;
use crate::series::{Covariate, Quantity, Series, Warmth};
use crate::shape::Shape;
use crate::watch::{Event, watch};
use crate::words;

/// Largest time between the onsets of changes that may have one cause \[days\].
/// Resolution: the number of nights until a small change is detected.
const TOGETHER_D: f64 = 10.0;
/// Smallest change of friction by warmth that is reported, as a share of the level.
/// Resolution: twice the reporting threshold for wear; every gear follows the season a little.
const WARM_SHARE: f64 = 0.1;
/// Fewest joints, and at least half of the arm's, whose simultaneous change of friction is not wear.
/// Resolution: three gears, of an arm of six.
const MANY_JOINTS: usize = 3;

/// An event and its series.
#[derive(Clone, Copy)]
struct Told<'a> {
    series: &'a Series,
    warmth: Option<&'a Warmth>,
    event: Event,
}

/// Returns the changes of an arm since the newest of `baselines` \[days since 1970-01-01 UTC\], the newest finding
/// first. Baselines are maintenance notes: estimates before them no longer describe the arm.
pub fn assess(all: &[Series], baselines: &[f64]) -> Vec<Finding> {
    let since = baselines.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let all: Vec<Series> = all.iter().map(|one| behind(one, since)).collect();
    let warmths: Vec<Option<Warmth>> = all.iter().map(|one| Warmth::of(one, &all)).collect();
    let mut told = Vec::new();
    let mut warm = Vec::new();
    for (series, warmth) in all.iter().zip(&warmths) {
        let warmth = warmth.as_ref();
        let watched = watch(&series.estimates, series.quantity, warmth);
        if let Some(warmth) = warmth
            && watched.events.is_empty()
            && series.quantity.is_friction()
        {
            warm.extend(explained(series, warmth, watched.slope));
        }
        let events = watched.events;
        told.extend(events.into_iter().map(|event| Told {
            series,
            warmth,
            event,
        }));
    }
    let mut findings = payloads(&mut told);
    findings.extend(frictions(&mut told, joints(&all)));
    findings.extend(told.into_iter().map(|one| finding(other(&one), &one)));
    // A joint with another finding is not reported for warmth in addition.
    warm.retain(|one: &Finding| findings.iter().all(|told| told.joint != one.joint));
    findings.extend(shared(one_a_joint(warm), joints(&all)));
    findings.sort_by(|a, b| {
        b.told
            .total_cmp(&a.told)
            .then_with(|| a.joint.cmp(&b.joint))
    });
    findings
}

/// The series since a time, sorted by time.
fn behind(series: &Series, since: f64) -> Series {
    let estimates = series.estimates.iter().copied();
    let mut estimates: Vec<_> = estimates.filter(|one| one.day >= since).collect();
    estimates.sort_by(|a, b| a.day.total_cmp(&b.day));
    Series {
        estimates,
        ..series.clone()
    }
}

fn joints(all: &[Series]) -> usize {
    let mut names: Vec<&String> = all.iter().filter_map(|one| one.joint.as_ref()).collect();
    names.sort();
    names.dedup();
    names.len()
}

/// Whether one of two events was detected before the other one began, so that they have different causes.
fn apart(a: &Event, b: &Event) -> bool {
    a.told < b.from || b.told < a.from
}

/// Whether the event `b` may have the same cause as `a`. An event that was detected before `a` began does not.
fn together(a: &Event, b: &Event) -> bool {
    if b.told < a.from {
        return false;
    }
    let over = |event: &Event| event.until.unwrap_or(f64::INFINITY) + TOGETHER_D;
    let begun_together = (a.from - b.from).abs() <= TOGETHER_D;
    begun_together || (b.from >= a.from - TOGETHER_D && over(b) <= over(a))
}

/// Moves the payload events out of `told` as findings, and removes their effects on other series.
fn payloads(told: &mut Vec<Told<'_>>) -> Vec<Finding> {
    let is_payload = |one: &Told<'_>| one.series.quantity == Quantity::Payload;
    let masses: Vec<Told<'_>> = told.iter().copied().filter(is_payload).collect();
    told.retain(|one| {
        let echoes = |mass: &Told<'_>| {
            // An effect of the payload ends with it; wear that happens to begin in these days does not.
            let lasts_alike = mass.event.until.is_some() == one.event.until.is_some();
            lasts_alike && together(&mass.event, &one.event)
        };
        !is_payload(one) && !masses.iter().any(echoes)
    });
    masses
        .iter()
        .map(|mass| finding(Cause::Payload, mass))
        .collect()
}

/// Moves the friction events out of `told` as findings: one per joint, or one for all joints if most changed at once.
fn frictions(told: &mut Vec<Told<'_>>, joints: usize) -> Vec<Finding> {
    let is_friction = |one: &Told<'_>| one.series.quantity.is_friction();
    let mut frictions: Vec<Told<'_>> = told.iter().copied().filter(is_friction).collect();
    told.retain(|one| {
        let beside = |friction: &Told<'_>| {
            let same_joint = friction.series.joint == one.series.joint;
            same_joint && together(&friction.event, &one.event)
        };
        !is_friction(one) && !frictions.iter().any(beside)
    });
    // Smallest relative uncertainty first.
    let sureness = |one: &Told<'_>| {
        let [low, high] = one.event.interval;
        one.event.size.abs() / (high - low).max(f64::MIN_POSITIVE)
    };
    frictions.sort_by(|a, b| sureness(b).total_cmp(&sureness(a)));
    let mut findings = Vec::new();
    while let Some(first) = frictions.first().copied() {
        let alike = |one: &Told<'_>| {
            let same_way = one.event.size * first.event.size > 0.0;
            let begun = (one.event.from - first.event.from).abs() <= TOGETHER_D;
            let lasts_alike = one.event.until.is_some() == first.event.until.is_some();
            same_way && begun && lasts_alike && !apart(&one.event, &first.event)
        };
        let mut names: Vec<_> = frictions.iter().filter(|one| alike(one)).collect();
        names.sort_by(|a, b| a.series.joint.cmp(&b.series.joint));
        names.dedup_by(|a, b| a.series.joint == b.series.joint);
        if many(names.len(), joints) {
            let mut common = finding(Cause::CommonFriction, &first);
            common.joint = None;
            common.sentence = words::common(&common, names.len());
            findings.push(common);
            frictions.retain(|one| !alike(one));
        } else {
            let is_same = |one: &&Told<'_>| {
                one.series.joint == first.series.joint && is_one_change(&one.event, &first.event)
            };
            let told = frictions.iter().filter(is_same).map(|one| one.event.told);
            let mut own = finding(friction(&first.event), &first);
            own.told = told.fold(own.told, f64::min);
            findings.push(own);
            frictions.retain(|one| !is_same(&one));
        }
    }
    findings
}

/// Whether two changes of one joint's friction are one: Coulomb and viscous friction of a gear wear together, and a
/// small drift is detected long after a large one.
fn is_one_change(a: &Event, b: &Event) -> bool {
    let drifts = |event: &Event| event.shape == Shape::Drift && event.until.is_none();
    let both_drift = drifts(a) && drifts(b) && a.size * b.size > 0.0;
    both_drift || !apart(a, b)
}

fn friction(event: &Event) -> Cause {
    match (event.size > 0.0, event.shape) {
        (true, Shape::Drift) => Cause::Wear,
        (true, _) => Cause::FrictionStep,
        (false, _) => Cause::FrictionLoss,
    }
}

fn other(told: &Told<'_>) -> Cause {
    match told.series.quantity {
        Quantity::Coulomb | Quantity::Viscous => friction(&told.event),
        Quantity::Gain => Cause::Gain,
        Quantity::Offset => Cause::Offset,
        Quantity::Backlash => Cause::Backlash,
        Quantity::Payload => Cause::Payload,
    }
}

fn finding(cause: Cause, told: &Told<'_>) -> Finding {
    let event = &told.event;
    let wears = cause == Cause::Wear && event.until.is_none();
    let forecast = wears.then(|| forecast(&told.series.estimates, told.warmth, event));
    let mut finding = Finding {
        cause,
        joint: told.series.joint.clone(),
        quantity: told.series.quantity,
        shape: event.shape,
        from: event.from,
        told: event.told,
        until: event.until,
        level: event.level,
        size: event.size,
        interval: event.interval,
        forecast: forecast.flatten(),
        sentence: String::new(),
    };
    finding.sentence = words::sentence(&finding);
    finding
}

/// Returns the change of friction that the covariate explains, and that would be reported without the covariate.
/// `slope` and `centre` are those of the series against its covariate.
fn explained(series: &Series, warmth: &Warmth, [slope, centre]: [f64; 2]) -> Option<Finding> {
    let blind = watch(&series.estimates, series.quantity, None).events;
    let by_warmth = |event: &Event| {
        let end = event.until.unwrap_or(f64::INFINITY);
        let nights = series.estimates.iter().zip(&warmth.values);
        let during = nights.filter(|(one, _)| (event.from..end).contains(&one.day));
        slope * (median(during.filter_map(|(_, value)| *value).collect()) - centre)
    };
    let most = blind
        .into_iter()
        .filter(|event| {
            let least = WARM_SHARE * event.level.abs();
            let by_warmth = by_warmth(event) * event.size.signum();
            event.size.abs() >= least && by_warmth >= least.max(0.5 * event.size.abs())
        })
        .max_by(|a, b| a.size.abs().total_cmp(&b.size.abs()))?;
    let of_others = warmth.covariate == Covariate::OtherJoints;
    let cause = if of_others {
        Cause::CommonFriction
    } else {
        Cause::Warmth
    };
    let mut finding = finding(
        cause,
        &Told {
            series,
            warmth: None,
            event: most,
        },
    );
    finding.sentence = words::warmth(&finding, warmth.covariate);
    Some(finding)
}

/// Merges common changes of friction into one finding if most joints have them, and drops them otherwise.
fn shared(mut warm: Vec<Finding>, joints: usize) -> Vec<Finding> {
    let is_common = |one: &Finding| one.cause == Cause::CommonFriction;
    let count = warm.iter().filter(|one| is_common(one)).count();
    let surest = warm.iter().filter(|one| is_common(one));
    let surest = surest.min_by(|a, b| a.told.total_cmp(&b.told)).cloned();
    warm.retain(|one| !is_common(one));
    if let Some(mut common) = surest.filter(|_| many(count, joints)) {
        common.joint = None;
        common.sentence = words::common(&common, count);
        warm.push(common);
    }
    warm
}

/// Whether `count` joints of an arm are too many for independent changes.
fn many(count: usize, joints: usize) -> bool {
    count >= MANY_JOINTS && 2 * count >= joints
}

/// The finding with the largest relative change of each joint.
fn one_a_joint(mut all: Vec<Finding>) -> Vec<Finding> {
    let share = |one: &Finding| (one.size / one.level).abs();
    all.sort_by(|a, b| a.joint.cmp(&b.joint).then(share(b).total_cmp(&share(a))));
    all.dedup_by(|a, b| a.joint == b.joint);
    all
}
