//! `labels.json`: what was done to the arm, and when.

use std::collections::BTreeMap;

use serde::Serialize;

use super::scenario::{RecordingSpec, Role};
use super::simulation::Event;

/// Weaker pushes are too weak to count \[N\].
const WEAK_N: f64 = 2.0;

/// The labels of a set of recordings, as `tauscope evaluate` reads them. Times are seconds from the
/// recording's first joint state; points and forces are in the world frame, the force on the robot.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Labels {
    /// Name of the set.
    pub set: String,
    /// By recording.
    pub recordings: BTreeMap<String, RecordingLabels>,
}

/// The labels of one recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingLabels {
    role: Role,
    duration: f64,
    rate: f64,
    events: Vec<EventLabel>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct EventLabel {
    t_on: f64,
    t_off: f64,
    kind: String,
    link: String,
    point: [f64; 3],
    force: [f64; 3],
    peak_force: f64,
    direction: [f64; 3],
    ignore: bool,
}

impl RecordingLabels {
    pub(super) fn new(spec: &RecordingSpec, rate_hz: f64, events: &[Event]) -> Self {
        let events = events.iter().map(|event| {
            let peak_n = event.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
            let length_n = peak_n.max(f64::MIN_POSITIVE);
            EventLabel {
                t_on: round(event.on_s),
                t_off: round(event.off_s),
                kind: event.kind.clone(),
                link: event.link.clone(),
                point: event.point_m.map(round),
                force: event.force_n.map(round),
                peak_force: round(peak_n),
                direction: event.force_n.map(|f| round(f / length_n)),
                ignore: peak_n < WEAK_N,
            }
        });
        Self {
            role: spec.role,
            duration: spec.duration_s,
            rate: rate_hz,
            events: events.collect(),
        }
    }
}

/// To four digits: nobody knows a push better.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
