//! All cells at one instant, for page, terminal, JSON and metrics.

use std::collections::BTreeMap;

use serde::Serialize;
use tauscope_publish::message::StatusMessage;

use super::Now;
use super::state::{Severity, State};
use crate::physics::Drift;

/// All cells at one instant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Snapshot {
    /// When, by the clock of the fleet host \[ns since the epoch\].
    pub now_ns: i64,
    /// Zenoh sessions that the fleet host reaches; with 0 nothing here is fresh.
    pub sessions_reached: usize,
    /// How many cells there are in each state.
    pub totals: Totals,
    /// Messages that were refused, by reason.
    pub refused: BTreeMap<&'static str, u64>,
    /// Why incidents and history are not kept now; `None` where they are, or are not to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unkept: Option<String>,
    /// The worst first; of equals the one that is so for longest.
    pub cells: Vec<CellView>,
}

/// How many cells are in each state, by its name.
pub type Totals = BTreeMap<&'static str, usize>;

/// One cell at one instant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellView {
    /// The cell.
    pub cell: String,
    /// Where it stands.
    #[serde(flatten)]
    pub state: State,
    /// How much that matters: a cell that is latched is critical, whatever else it is.
    pub severity: Severity,
    /// Since when it is in that state; `None` where it was before this host first heard of it \[ns since the epoch\].
    #[serde(rename = "state_since_ns")]
    pub since_ns: Option<i64>,
    /// Since when a collision is latched, also while the cell is stale; `None` where nothing is \[ns since the epoch\].
    pub latched_since_ns: Option<i64>,
    /// Time since the newest status arrived \[ms\].
    pub status_age_ms: Option<u64>,
    /// Time since the newest sample arrived in the cell \[ms\].
    pub sample_age_ms: Option<u64>,
    /// How far the cell's clock is ahead of the fleet host's \[ms\].
    pub clock_ahead_ms: Option<f64>,
    /// The truth is no farther away from that \[ms\].
    pub clock_uncertainty_ms: Option<f64>,
    /// Whether the clocks differ by more than [`CLOCK_LIMIT_NS`](super::CLOCK_LIMIT_NS) for certain.
    pub clock_is_off: bool,
    /// Samples that its stages have lost.
    pub lost_samples: u64,
    /// Its residual against its normal.
    pub residual: Option<ResidualView>,
    /// The residual's length in each of the last minutes \[effort unit\].
    pub curve: Vec<f64>,
    /// The residual's length by day over the last six weeks, as a share of the normal; empty without a history.
    pub trend: Vec<f64>,
    /// The joint whose friction has changed most over weeks; `None` where no nightly numbers are followed.
    pub drift: Option<Drift>,
    /// Whether more cells with a robot of this name have another URDF, which they share.
    pub urdf_differs: bool,
    /// What it said last; as old as `status_age_ms`.
    pub status: Option<StatusMessage>,
}

/// A cell's residual against its normal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualView {
    /// Root mean square over all joints, over the same of the normal.
    pub ratio: f64,
    /// The joint whose residual grew most.
    pub joint: String,
    /// By how much.
    pub joint_ratio: f64,
    /// What is taken for normal: `calibration`, or `history` since the newest baseline.
    pub normal: &'static str,
}

impl CellView {
    /// Since when it is latched, where its state does not say so \[ns since the epoch\].
    pub fn latched_behind(&self) -> Option<i64> {
        let is_said = matches!(self.state, State::Stopped { .. });
        self.latched_since_ns.filter(|_| !is_said)
    }

    /// Until when alarms of a latched cell cause no further stop, where its state does not say so; `None` where they do
    /// \[ns since the epoch\].
    pub fn muted_behind(&self, now_ns: i64) -> Option<i64> {
        let is_latched = matches!(self.state, State::Stopped { .. });
        let muted_s = self.status.as_ref().filter(|_| is_latched)?.alarm.muted_s;
        let left_ms = (muted_s * 1e3) as i64 - i64::try_from(self.status_age_ms?).ok()?;
        (left_ms > 0).then(|| now_ns.saturating_add(left_ms.saturating_mul(1_000_000)))
    }

    /// Now, by the clock of the cell's samples: ages of what has a stamp are against this \[ns since the epoch\].
    /// A recording that is played has another time than the fleet host.
    pub fn stream_now_ns(&self) -> Option<i64> {
        let newest_ns = self.status.as_ref()?.last_sample_ns?;
        let age_ns = self.sample_age_ms?.saturating_mul(1_000_000);
        Some(newest_ns.saturating_add(i64::try_from(age_ns).ok()?))
    }
}

impl ResidualView {
    /// Against the twin's calibration.
    pub fn of(status: &StatusMessage) -> Option<Self> {
        let joints = &status.residual.as_ref()?.joints;
        let known = joints.iter();
        let known =
            known.filter_map(|joint| Some((joint.name.as_str(), joint.rms, joint.calibrated?)));
        Self::against(known, "calibration")
    }

    /// Against a normal: joint, residual, normal \[effort unit\].
    pub fn against<'a>(
        joints: impl Iterator<Item = (&'a str, f64, f64)>,
        normal: &'static str,
    ) -> Option<Self> {
        let (mut now, mut usual) = (0.0, 0.0);
        let mut most: Option<(&str, f64)> = None;
        for (name, rms, normal) in joints.filter(|(_, _, normal)| *normal > 0.0) {
            now += rms * rms;
            usual += normal * normal;
            let ratio = rms / normal;
            if most.is_none_or(|(_, most)| ratio > most) {
                most = Some((name, ratio));
            }
        }
        let (joint, joint_ratio) = most?;
        Some(Self {
            ratio: f64::sqrt(now / usual),
            joint: joint.to_owned(),
            joint_ratio,
            normal,
        })
    }
}

/// Marks the cells whose URDF is not the one that most cells with a robot of that name have.
fn mark_other_urdfs(cells: &mut [CellView]) {
    let own = |cell: &CellView| {
        let status = cell.status.as_ref()?;
        Some((status.robot.clone(), status.urdf_sha256.clone()?))
    };
    let mut counts: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for (robot, urdf) in cells.iter().filter_map(own) {
        *counts.entry(robot).or_default().entry(urdf).or_default() += 1;
    }
    for cell in cells {
        let most = own(cell).is_some_and(|(robot, urdf)| {
            let of_robot = &counts[&robot];
            of_robot.values().any(|count| *count > of_robot[&urdf])
        });
        cell.urdf_differs = most;
    }
}

/// A name as people sort it, `press-2` before `press-10`: its words, with the number behind each.
fn natural(name: &str) -> Vec<(&str, u64, usize)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let word = rest.find(|c: char| c.is_ascii_digit());
        let (word, behind) = rest.split_at(word.unwrap_or(rest.len()));
        let number = behind.find(|c: char| !c.is_ascii_digit());
        let (number, behind) = behind.split_at(number.unwrap_or(behind.len()));
        // A number that is too long is longer than all others; one with zeros before it is another name.
        let value = match number {
            "" => 0,
            digits => digits.parse().unwrap_or(u64::MAX),
        };
        parts.push((word, value, number.len()));
        rest = behind;
    }
    parts
}

impl Snapshot {
    pub(super) fn new(
        now: Now,
        reached: usize,
        refused: BTreeMap<&'static str, u64>,
        mut cells: Vec<CellView>,
    ) -> Self {
        // Names keep equals in their places, so that the wall does not flicker.
        cells.sort_by(|a, b| {
            let key = |cell: &CellView| {
                let good = cell.severity == Severity::Good;
                let since_ns = cell.latched_since_ns.or(cell.since_ns);
                (cell.severity, if good { None } else { since_ns })
            };
            key(a)
                .cmp(&key(b))
                .then_with(|| natural(&a.cell).cmp(&natural(&b.cell)))
        });
        mark_other_urdfs(&mut cells);
        let mut totals: Totals = State::NAMES.iter().map(|name| (*name, 0)).collect();
        for cell in &cells {
            *totals.entry(cell.state.name()).or_default() += 1;
        }
        Self {
            now_ns: now.unix_ns,
            sessions_reached: reached,
            unkept: None,
            totals,
            refused,
            cells,
        }
    }

    /// The view of a cell.
    pub fn cell(&self, name: &str) -> Option<&CellView> {
        self.cells.iter().find(|cell| cell.cell == name)
    }
}
