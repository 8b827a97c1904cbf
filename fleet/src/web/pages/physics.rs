//! The physics of an arm over weeks: findings, and each number with its interval and the temperature.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use tauscope_condition::{Finding, Quantity};

use super::{NOT_SAFETY, chart};
use crate::physics::{CellPhysics, Followed};
use crate::store::Note;
use crate::words;

const NS_A_DAY: f64 = 86_400e9;
/// Days of the curves. Resolution: half a year, in which a season and a wearing gear show.
const DAYS: f64 = 182.0;
const DAYS_OF_A_WEEK: f64 = 7.0;

/// Returns the section of the cell's page. `physics`: `None` without nightly tables.
pub fn section(physics: Option<&CellPhysics>, notes: &[Note], now_ns: i64) -> Markup {
    let Some(physics) = physics else {
        return html! { p.muted {
            "No nightly numbers: run " code { "tauscope physics" } " every night, and start the fleet host with "
            code { "--physics" } "."
        } };
    };
    html! {
        p.muted { "Arm " (physics.arm) ", newest night " (day(physics.newest_day)) ", "
            (age(physics, now_ns)) ", twin "
            code { (words::short_hash(Some(&physics.twin_sha256).filter(|hash| !hash.is_empty()))) }
            ". Bars: 95 % intervals. Dashed: the first two weeks since the baseline. Peers: arms of the same robot." }
        (stale(physics, now_ns))
        div.old[physics.stale_d(now_ns).is_some()] {
            (findings(physics, f64::NEG_INFINITY))
            (table(physics))
            (curves(physics, notes))
        }
        p { a href={ "/cells/" (physics.cell) "/week" } { "The page of the week" } }
    }
}

/// Returns the self-contained page of a week: all findings, the new ones, and the level of each number.
pub fn week(physics: &CellPhysics, notes: &[Note], now_ns: i64, style: Option<&str>) -> Markup {
    let content = week_content(physics, notes, now_ns);
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (physics.cell) ", the week" }
                @match style {
                    Some(style) => { style { (PreEscaped(style)) } }
                    None => { link rel="stylesheet" href="/style.css"; }
                }
            }
            body {
                main { (content) }
                footer { p { (NOT_SAFETY) } }
            }
        }
    }
}

fn week_content(physics: &CellPhysics, notes: &[Note], now_ns: i64) -> Markup {
    let week = physics.newest_day - DAYS_OF_A_WEEK;
    let is_new = |one: &Finding| one.told >= week || one.until.is_some_and(|until| until >= week);
    let new = physics.findings.iter().filter(|one| is_new(one)).count();
    let open = physics
        .findings
        .iter()
        .filter(|one| one.is_alarm() && one.until.is_none())
        .count();
    let of_week = notes
        .iter()
        .filter(|note| note.at_ns as f64 / NS_A_DAY >= week);
    html! {
        h1 { (physics.cell) ", week to " (day(physics.newest_day)) }
        (stale(physics, now_ns))
        p.summary {
            span { "Arm " (physics.arm) ", robot " (physics.robot) }
            @if new > 0 { span.count data-severity="serious" { strong { (new) } " new this week" } }
            @else { span.count data-severity="notice" { "nothing new this week" } }
            @if open > 0 { span.count data-severity="serious" { strong { (open) } " lasting" } }
        }
        h2 { "What has changed" }
        (findings(physics, week))
        h2 { "Numbers" }
        (table(physics))
        (curves(physics, notes))
        h2 { "Notes of the week" }
        @let of_week: Vec<&Note> = of_week.collect();
        @if of_week.is_empty() { p.muted { "none" } }
        ul.notes { @for note in of_week { li { (words::time(note.at_ns)) ", " (note.by) ": " (note.text) } } }
        p.muted { "Made " (words::time(now_ns)) ". A hundred arms that do not change cause about one false finding in ten years." }
    }
}

/// Describes the age of the newest night.
fn age(physics: &CellPhysics, now_ns: i64) -> String {
    match physics.age_d(now_ns) {
        0 => "less than a day ago".to_owned(),
        1 => "1 day ago".to_owned(),
        days => format!("{days} days ago"),
    }
}

/// Returns the warning that the numbers are stale, if they are.
fn stale(physics: &CellPhysics, now_ns: i64) -> Markup {
    html! { @if physics.stale_d(now_ns).is_some() {
        p.refused role="alert" {
            strong { "Stale: the newest night was " (age(physics, now_ns)) "." }
            " All numbers, findings and forecasts here are as of " (day(physics.newest_day)) "; what has changed since is \
                not known. Does " code { "tauscope physics" } " still run, and do its tables arrive?"
        }
    } }
}

fn day(day: f64) -> String {
    words::day((day * NS_A_DAY) as i64)
}

fn findings(physics: &CellPhysics, new_since: f64) -> Markup {
    html! {
        @if physics.findings.is_empty() { p.muted { "Nothing has changed since the baseline." } }
        @else { ul.changes { @for one in &physics.findings { li {
            @if one.is_alarm() { strong.warn { (one.sentence) } } @else { (one.sentence) }
            span.muted { " Certain since " (day(one.told)) "." }
            @if new_since.is_finite() && one.told >= new_since { " " span.count data-severity="serious" { "new" } }
        } } } }
    }
}

fn name(one: &Followed) -> String {
    let joint = one.series.joint.as_deref().unwrap_or("arm");
    format!("{joint}, {}", one.series.quantity.words())
}

fn table(physics: &CellPhysics) -> Markup {
    html! {
        div.wide role="region" aria-label="Numbers" tabindex="0" {
            table.fold {
                thead { tr {
                    th scope="col" { "Number" } th.num scope="col" { "Newest night" } th.num scope="col" { "95 % interval" }
                    th.num scope="col" { "At first" } th.num scope="col" { "Last week" } th.num scope="col" { "Change" }
                    th scope="col" { "Among peers" }
                } }
                tbody { @for one in &physics.followed { @if let Some(newest) = one.series.estimates.last() { tr {
                    th scope="row" { (name(one)) }
                    td.num data-label="Newest night" { (format!("{:.3} {}", newest.value, one.unit)) }
                    td.num data-label="95 %" { (format!("{:.3} to {:.3}", newest.low, newest.high)) }
                    td.num data-label="At first" { (format!("{:.3}", one.first)) }
                    td.num data-label="Last week" { (format!("{:.3}", one.now)) }
                    td.num data-label="Change" { (change(one)) }
                    td data-label="Peers" { @match one.peers_median {
                        Some(median) => { @if one.is_outlier { strong.warn { "outlier" } ", " } "median " (format!("{median:.3}")) }
                        None => span.muted { "too few" },
                    } }
                } } } }
            }
        }
    }
}

/// Describes the change since the baseline, relative if the number has a level.
fn change(one: &Followed) -> String {
    match one.series.quantity {
        Quantity::Coulomb | Quantity::Viscous | Quantity::Gain if one.first > 0.0 => {
            format!("{:+.1} %", 100.0 * (one.now / one.first - 1.0))
        }
        _ => format!("{:+.3} {}", one.now - one.first, one.unit),
    }
}

/// Returns the curves, those with findings first.
fn curves(physics: &CellPhysics, notes: &[Note]) -> Markup {
    let (found, others): (Vec<&Followed>, Vec<&Followed>) = physics
        .followed
        .iter()
        .partition(|one| physics.is_found(one));
    html! {
        div.curves { @for one in found.into_iter().chain(others) { (figure(one, notes, physics.newest_day)) } }
    }
}

fn figure(one: &Followed, notes: &[Note], newest_day: f64) -> Markup {
    let since = newest_day - DAYS;
    let estimates = one
        .series
        .estimates
        .iter()
        .filter(|estimate| estimate.day >= since);
    let estimates: Vec<_> = estimates.collect();
    let marks: Vec<(f64, &Note)> = notes
        .iter()
        .map(|note| (note.at_ns as f64 / NS_A_DAY, note))
        .collect();
    html! {
        figure {
            figcaption { (name(one)) @if !one.unit.is_empty() { " (" (one.unit) ")" } }
            (chart::nights(&name(one), &estimates, one.first, &marks))
        }
    }
}
