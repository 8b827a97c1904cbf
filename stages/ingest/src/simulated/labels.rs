//! `labels.json`: the contacts of the arm and their times.

use std::collections::BTreeMap;

use serde::Serialize;

use super::scenario::{ContactKind, LabelSpec, RecordingSpec, Role};
use super::simulation::Event;

/// Peak force below which a push is labelled to be ignored \[N\].
/// Chosen: for simulated cells only; of the order of the noise of forces that are estimated from joint efforts.
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
    /// Length of a cycle of the motion \[s\], if it repeats itself exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    cycle_s: Option<f64>,
    events: Vec<EventLabel>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct EventLabel {
    t_on: f64,
    t_off: f64,
    kind: ContactKind,
    link: String,
    /// Joints between the base and the link.
    joints: Vec<String>,
    /// Torque of the peak force in each of these joints.
    joint_torques: Vec<f64>,
    point: [f64; 3],
    force: [f64; 3],
    peak_force: f64,
    direction: [f64; 3],
    ignore: bool,
    /// Kind of the contact that was in progress at its begin.
    #[serde(skip_serializing_if = "Option::is_none")]
    during: Option<ContactKind>,
    #[serde(flatten)]
    label: LabelSpec,
}

impl RecordingLabels {
    pub(super) fn new(
        spec: &RecordingSpec,
        rate_hz: f64,
        cycle_s: Option<f64>,
        events: &[Event],
    ) -> Self {
        let mut events: Vec<&Event> = events.iter().collect();
        events.sort_by(|a, b| a.on_s.total_cmp(&b.on_s));
        let labels = events.iter().enumerate().map(|(i, event)| {
            let peak_n = event.peak_n();
            let length_n = peak_n.max(f64::MIN_POSITIVE);
            let before = events[..i].iter().rev();
            let under = before.copied().find(|other| event.on_s < other.off_s);
            EventLabel {
                t_on: round(event.on_s),
                t_off: round(event.off_s.min(spec.duration_s)),
                kind: event.kind,
                link: event.link.clone(),
                joints: event.joints.iter().map(|(name, _)| name.clone()).collect(),
                joint_torques: event.joints.iter().map(|(_, nm)| round(*nm)).collect(),
                point: event.point_m.map(round),
                force: event.force_n.map(round),
                peak_force: round(peak_n),
                direction: event.force_n.map(|f| round(f / length_n)),
                ignore: peak_n < WEAK_N,
                during: under.map(|other| other.kind),
                label: event.label.clone(),
            }
        });
        Self {
            role: spec.role,
            duration: spec.duration_s,
            rate: rate_hz,
            cycle_s: cycle_s.map(round),
            events: labels.collect(),
        }
    }
}

/// Rounds to four decimals, which is beyond the precision of a real push.
fn round(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
