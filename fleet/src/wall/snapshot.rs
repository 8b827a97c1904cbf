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
    /// Time by the clock of the fleet host \[ns since the epoch\].
    pub now_ns: i64,
    /// Number of connected Zenoh sessions; with 0 nothing here is fresh.
    pub sessions_reached: usize,
    /// Number of cells in each state.
    pub totals: Totals,
    /// Number of rejected messages by reason.
    pub refused: BTreeMap<&'static str, u64>,
    /// Reason why incidents and history are not stored now; `None` if they are, or if there is no store.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unkept: Option<String>,
    /// The cells, the most severe first; among equals the one that is in its state for longest.
    pub cells: Vec<CellView>,
}

/// Number of cells in each state, by the name of the state.
pub type Totals = BTreeMap<&'static str, usize>;

/// One cell at one instant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellView {
    /// The cell.
    pub cell: String,
    /// Its state.
    #[serde(flatten)]
    pub state: State,
    /// Its severity; a latched cell is critical in any state.
    pub severity: Severity,
    /// Start of that state; `None` if it precedes the first message that this host received \[ns since the epoch\].
    #[serde(rename = "state_since_ns")]
    pub since_ns: Option<i64>,
    /// Start of a latched collision, also while the cell is stale; `None` without a latch \[ns since the epoch\].
    pub latched_since_ns: Option<i64>,
    /// Time since the newest status arrived \[ms\].
    pub status_age_ms: Option<u64>,
    /// Time since the newest sample arrived in the cell \[ms\].
    pub sample_age_ms: Option<u64>,
    /// Offset of the cell's clock from the fleet host's, positive if ahead \[ms\].
    pub clock_ahead_ms: Option<f64>,
    /// Bound on the error of that offset \[ms\].
    pub clock_uncertainty_ms: Option<f64>,
    /// Whether the clocks certainly differ by more than [`CLOCK_LIMIT_NS`](super::CLOCK_LIMIT_NS).
    pub clock_is_off: bool,
    /// Number of samples that its stages have lost.
    pub lost_samples: u64,
    /// Its residual relative to its normal residual.
    pub residual: Option<ResidualView>,
    /// Norm of the residual in each of the last minutes \[effort unit\].
    pub curve: Vec<f64>,
    /// Norm of the residual by day over the last six weeks, relative to the normal one; empty without a history.
    pub trend: Vec<f64>,
    /// The joint whose friction has changed most over weeks; `None` without nightly tables.
    pub drift: Option<Drift>,
    /// Whether another URDF is more common among the cells with a robot of this name.
    pub urdf_differs: bool,
    /// The newest status, with the age `status_age_ms`.
    pub status: Option<StatusMessage>,
}

/// A cell's residual relative to its normal residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualView {
    /// Ratio of the root mean squares over all joints.
    pub ratio: f64,
    /// The joint with the largest ratio.
    pub joint: String,
    /// Ratio of that joint.
    pub joint_ratio: f64,
    /// Source of the normal residual: `calibration`, or `history` since the newest baseline.
    pub normal: &'static str,
}

impl CellView {
    /// Returns the start of a latch that its state does not show \[ns since the epoch\].
    pub fn latched_behind(&self) -> Option<i64> {
        let is_said = matches!(self.state, State::Stopped { .. });
        self.latched_since_ns.filter(|_| !is_said)
    }

    /// Returns the end of the mute of a latched cell, which its state does not show; `None` without a mute \[ns since
    /// the epoch\].
    pub fn muted_behind(&self, now_ns: i64) -> Option<i64> {
        let is_latched = matches!(self.state, State::Stopped { .. });
        let muted_s = self.status.as_ref().filter(|_| is_latched)?.alarm.muted_s;
        let left_ms = (muted_s * 1e3) as i64 - i64::try_from(self.status_age_ms?).ok()?;
        (left_ms > 0).then(|| now_ns.saturating_add(left_ms.saturating_mul(1_000_000)))
    }

    /// Returns the current time by the clock of the cell's samples, to which ages of stamps refer \[ns since the
    /// epoch\]. A recording that is played has another time than the fleet host.
    pub fn stream_now_ns(&self) -> Option<i64> {
        let newest_ns = self.status.as_ref()?.last_sample_ns?;
        let age_ns = self.sample_age_ms?.saturating_mul(1_000_000);
        Some(newest_ns.saturating_add(i64::try_from(age_ns).ok()?))
    }
}

impl ResidualView {
    /// Compares with the twin's calibration.
    pub fn of(status: &StatusMessage) -> Option<Self> {
        let joints = &status.residual.as_ref()?.joints;
        let known = joints.iter();
        let known =
            known.filter_map(|joint| Some((joint.name.as_str(), joint.rms, joint.calibrated?)));
        Self::against(known, "calibration")
    }

    /// Compares with a normal residual. `joints`: joint, residual, normal residual \[effort unit\].
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

/// Marks the cells whose URDF is not the most common one among the cells with a robot of that name.
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

/// Returns the key of a natural sort, `press-2` before `press-10`: the words of a name, with the number after each.
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
        // Equals are sorted by name, so that the wall does not flicker.
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

    /// Returns the view of a cell.
    pub fn cell(&self, name: &str) -> Option<&CellView> {
        self.cells.iter().find(|cell| cell.cell == name)
    }
}
