//! The physics of all arms over weeks, evaluated from the nightly tables of `tauscope physics`.
//!
//! The folder has a table for each night, `cell=CELL/date=YYYY-MM-DD/physics*.parquet`, with a row for each number.
//! History belongs to the arm: an arm that moves to another cell takes its series with it.

mod table;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tauscope_condition::robust::median;
use tauscope_condition::short::{SoFar, so_far};
use tauscope_condition::{Cause, Estimate, Finding, Quantity, Series, assess, peers};

pub use table::{Column, Row, TABLE, TextColumn, folder_of};

const NS_A_DAY: f64 = 86_400e9;
/// Number of newest nights whose median is the current level. Resolution: a week has each day's work once.
const NEWEST: usize = 7;
/// Number of first nights whose median is the initial level; equal to the number of learned nights.
const FIRST: usize = tauscope_condition::series::LEARNED;
/// Age of the newest night above which numbers are stale \[days\]. Resolution: a long weekend on which no cell works.
const STALE_AFTER_D: f64 = 4.0;
/// Length of a curve on the wall \[days\]. Resolution: six weeks, in which a gear wears.
const CURVE_D: f64 = 42.0;

/// An error of reading the tables.
#[derive(Debug, thiserror::Error)]
pub enum PhysicsError {
    /// An I/O error.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The folder or file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A file that is not a table of nightly physics.
    #[error("{path} is no table of nightly physics: {reason}")]
    Table {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
}

/// The series of one number, with its levels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Followed {
    /// The series.
    #[serde(flatten)]
    pub series: Series,
    /// Its unit.
    pub unit: String,
    /// Median of the first nights since the baseline.
    pub first: f64,
    /// Median of the newest nights.
    pub now: f64,
    /// Median of this number over the other arms of the same robot, if there are enough.
    pub peers_median: Option<f64>,
    /// Whether it is an outlier among them.
    pub is_outlier: bool,
    /// Preliminary result, while there are fewer estimates than a month.
    pub so_far: Option<SoFar>,
}

/// The largest drift of friction in an arm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drift {
    /// The joint.
    pub joint: String,
    /// The friction that drifts.
    pub quantity: Quantity,
    /// Its relative change since the baseline.
    pub share: f64,
    /// The last six weeks, relative to the baseline.
    pub curve: Vec<f64>,
    /// The alarm for the arm, if any.
    pub finding: Option<String>,
    /// Whether the change is explained by temperature.
    pub is_warmth: bool,
    /// Age of the newest night, if it is stale \[days\].
    pub stale_d: Option<u32>,
}

/// The physics of one cell's arm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellPhysics {
    /// The cell.
    pub cell: String,
    /// The arm that is in it.
    pub arm: String,
    /// Its robot's name.
    pub robot: String,
    /// SHA-256 of the twin of the newest night; empty where there was none.
    pub twin_sha256: String,
    /// The newest night \[days since 1970-01-01 UTC\].
    pub newest_day: f64,
    /// The findings, newest first.
    pub findings: Vec<Finding>,
    /// All series.
    pub followed: Vec<Followed>,
}

/// Reads the tables of all cells under `folder` since a day. Tables that cannot be read are skipped, and their errors
/// are returned. `baselines` returns the days of a cell's maintenance notes that begin a new baseline.
///
/// # Errors
/// If the folder cannot be read.
pub fn read(
    folder: &Path,
    since_day: f64,
    baselines: &dyn Fn(&str) -> Vec<f64>,
) -> Result<(Vec<CellPhysics>, Vec<PhysicsError>), PhysicsError> {
    let (rows, unread) = table::rows(folder, since_day)?;
    let mut by_arm: BTreeMap<&str, Vec<&Row>> = BTreeMap::new();
    // The newest night determines which arm is in a cell.
    let mut newest: BTreeMap<&str, &Row> = BTreeMap::new();
    for row in &rows {
        by_arm.entry(&row.arm).or_default().push(row);
        let known = newest.entry(&row.cell).or_insert(row);
        if row.stamp_ns >= known.stamp_ns {
            *known = row;
        }
    }
    let mut cells: Vec<CellPhysics> = newest
        .into_iter()
        .map(|(cell, newest)| of_cell(cell, newest, &by_arm[newest.arm.as_str()], &baselines(cell)))
        .collect();
    beside_peers(&mut cells);
    Ok((cells, unread))
}

fn of_cell(cell: &str, newest: &Row, rows: &[&Row], baselines: &[f64]) -> CellPhysics {
    let mut numbers: BTreeMap<(Option<&str>, Quantity), Vec<&Row>> = BTreeMap::new();
    for row in rows {
        if let Some(quantity) = Quantity::of_name(&row.quantity) {
            let joint = (!row.joint.is_empty()).then_some(row.joint.as_str());
            numbers.entry((joint, quantity)).or_default().push(row);
        }
    }
    let since = baselines.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let followed = numbers.into_iter().map(|((joint, quantity), mut rows)| {
        rows.sort_by_key(|row| row.stamp_ns);
        let series = Series {
            joint: joint.map(str::to_owned),
            quantity,
            estimates: rows.iter().map(|row| row.estimate()).collect(),
        };
        followed(series, rows.last().map_or("", |row| &row.unit), since)
    });
    let followed: Vec<Followed> = followed.collect();
    let series: Vec<Series> = followed.iter().map(|one| one.series.clone()).collect();
    CellPhysics {
        cell: cell.to_owned(),
        arm: newest.arm.clone(),
        robot: newest.robot.clone(),
        twin_sha256: newest.twin_sha256.clone(),
        newest_day: newest.estimate().day,
        findings: assess(&series, baselines),
        followed,
    }
}

fn followed(series: Series, unit: &str, since: f64) -> Followed {
    let behind: Vec<Estimate> = series
        .estimates
        .iter()
        .copied()
        .filter(|one| one.day >= since)
        .collect();
    let values = |some: &[Estimate]| median(some.iter().map(|one| one.value).collect());
    Followed {
        unit: unit.to_owned(),
        first: values(&behind[..behind.len().min(FIRST)]),
        now: values(&behind[behind.len().saturating_sub(NEWEST)..]),
        peers_median: None,
        is_outlier: false,
        so_far: (behind.len() <= 2 * FIRST).then(|| so_far(&behind)),
        series,
    }
}

/// Compares each number with that of the other arms of the same robot.
fn beside_peers(cells: &mut [CellPhysics]) {
    let key = |cell: &CellPhysics, one: &Followed| {
        (
            cell.robot.clone(),
            one.series.joint.clone(),
            one.series.quantity,
            one.unit.clone(),
        )
    };
    let mut all: BTreeMap<_, Vec<(String, f64)>> = BTreeMap::new();
    for cell in cells.iter().filter(|cell| !cell.robot.is_empty()) {
        for one in &cell.followed {
            all.entry(key(cell, one))
                .or_default()
                .push((cell.cell.clone(), one.now));
        }
    }
    for cell in cells {
        for at in 0..cell.followed.len() {
            let others = all
                .get(&key(cell, &cell.followed[at]))
                .into_iter()
                .flatten();
            let others = others.filter(|(other, _)| *other != cell.cell);
            let others: Vec<f64> = others.map(|(_, value)| *value).collect();
            let one = &mut cell.followed[at];
            let deviation = one.series.estimates.last().map_or(0.0, Estimate::deviation);
            if let Some(among) = peers::among(one.now, deviation, &others) {
                one.peers_median = Some(among.median);
                one.is_outlier = among.is_outlier;
            }
        }
    }
}

impl CellPhysics {
    /// Returns whether there is a finding on this number.
    pub fn is_found(&self, one: &Followed) -> bool {
        let series = &one.series;
        let of = |found: &Finding| found.quantity == series.quantity && found.joint == series.joint;
        self.findings.iter().any(of)
    }

    /// Returns the age of the newest night at `now_ns` \[days\].
    pub fn age_d(&self, now_ns: i64) -> u32 {
        (now_ns as f64 / NS_A_DAY - self.newest_day).max(0.0) as u32
    }

    /// Returns the age of the newest night at `now_ns` \[days\], if the numbers are stale.
    pub fn stale_d(&self, now_ns: i64) -> Option<u32> {
        let is_stale = now_ns as f64 / NS_A_DAY - self.newest_day > STALE_AFTER_D;
        is_stale.then(|| self.age_d(now_ns))
    }

    /// Returns the joint whose friction has changed most at `now_ns` \[ns since the epoch\]. A joint with an alarm
    /// takes precedence.
    pub fn drift(&self, now_ns: i64) -> Option<Drift> {
        let found = self
            .findings
            .iter()
            .find(|one| one.is_alarm() && one.quantity.is_friction());
        let is_found = |one: &&Followed| {
            found.is_some_and(|found| {
                one.series.quantity == found.quantity && one.series.joint == found.joint
            })
        };
        let share = |one: &Followed| one.now / one.first - 1.0;
        let frictions = || {
            self.followed
                .iter()
                .filter(|one| one.series.quantity.is_friction() && one.first > 0.0)
        };
        let most = || frictions().max_by(|a, b| share(a).abs().total_cmp(&share(b).abs()));
        let one = frictions().find(is_found).or_else(most)?;
        let since = self.newest_day - CURVE_D;
        let newest = one
            .series
            .estimates
            .iter()
            .filter(|estimate| estimate.day >= since);
        Some(Drift {
            joint: one.series.joint.clone()?,
            quantity: one.series.quantity,
            share: share(one),
            curve: newest.map(|estimate| estimate.value / one.first).collect(),
            stale_d: self.stale_d(now_ns),
            is_warmth: self
                .findings
                .iter()
                .any(|found| found.cause == Cause::Warmth && found.joint == one.series.joint),
            finding: self
                .findings
                .iter()
                .find(|one| one.is_alarm())
                .map(|one| one.sentence.clone()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_without_a_new_night_are_stale_after_a_long_weekend() {
        let physics = CellPhysics {
            cell: "press".to_owned(),
            arm: "A-17".to_owned(),
            robot: String::new(),
            twin_sha256: String::new(),
            newest_day: 20_000.0,
            findings: Vec::new(),
            followed: Vec::new(),
        };
        let now_ns = |day: f64| (day * NS_A_DAY) as i64;
        assert_eq!(physics.stale_d(now_ns(20_003.5)), None);
        assert_eq!(physics.age_d(now_ns(20_003.5)), 3);
        assert_eq!(physics.stale_d(now_ns(20_300.5)), Some(300));
    }
}
