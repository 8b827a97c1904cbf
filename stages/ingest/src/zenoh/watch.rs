//! Detects that a live source gives no usable samples, and diagnoses the reason.

use std::time::{Duration, Instant};

use tauscope_bus::{JointState, Trouble, flags};
use tauscope_session::Counts;
use zenoh::Session;

use super::diagnosis::{Expected, Fed, diagnose};
use super::frozen::Frozen;
use super::scout::Scout;
use crate::pack::Packer;

/// Silence after which a source is diagnosed; the diagnosis is available one look later.
const SILENT_AFTER: Duration = Duration::from_secs(1);
/// Grace period for samples without efforts, since a driver may begin with them.
const EFFORTS_WITHIN: Duration = Duration::from_secs(3);

/// Watch over one source.
#[derive(Debug)]
pub(super) struct Watch {
    expected: Expected,
    scout: Scout,
    fed: Fed,
    /// Counts of packed and refused messages at the newest sample.
    packed: Counts,
    first_sample: Option<Instant>,
    /// Time of the last sample with efforts.
    effort_at: Option<Instant>,
    frozen: Frozen,
}

impl Watch {
    /// Creates a watch over a source that expects this.
    pub fn new(expected: Expected) -> Self {
        Self {
            scout: Scout::new(&expected.connect),
            expected,
            fed: Fed::default(),
            packed: Counts::default(),
            first_sample: None,
            effort_at: None,
            frozen: Frozen::default(),
        }
    }

    /// Records a joint state; `fault` is the reason if it could not be decoded.
    pub fn state(&mut self, fault: Option<&str>) {
        self.fed.messages += 1;
        if let Some(fault) = fault {
            self.fed.undecodable += 1;
            self.fed.reason = Some(fault.to_owned());
        }
    }

    /// Whether the driver repeats its last measurement.
    pub fn is_frozen(&self) -> bool {
        self.frozen.is_frozen()
    }

    /// Records an emitted sample.
    pub fn sample(&mut self, sample: &JointState, packed: Counts) {
        let now = Instant::now();
        if sample.header.has(flags::EFFORT_MEASURED) {
            self.effort_at = Some(now);
        }
        self.first_sample.get_or_insert(now);
        self.frozen.sample(sample);
        self.packed = packed;
        if self.fed.messages > 0 {
            self.fed = Fed {
                was_well: true,
                ..Fed::default()
            };
        }
    }

    /// Returns the trouble of the source, `silent_for` after its last sample.
    pub fn trouble(
        &mut self,
        silent_for: Duration,
        session: &Session,
        packer: &Packer,
    ) -> Option<Trouble> {
        if silent_for < SILENT_AFTER {
            self.scout.rest();
            return self.effortless().or_else(|| self.frozen.trouble());
        }
        let packed = packer.counts();
        let seen = self.scout.look(session)?;
        let fed = Fed {
            foreign: packed.foreign - self.packed.foreign,
            incomplete: packed.incomplete - self.packed.incomplete,
            never_finite: packer.never_finite(),
            twice: packer.twice(),
            not_finite: packed.not_finite - self.packed.not_finite,
            stale: stale(packed) - stale(self.packed),
            ..self.fed.clone()
        };
        Some(diagnose(&self.expected, &fed, seen))
    }

    /// Describes the trouble of a second publisher.
    pub fn rivals(&self) -> Trouble {
        let topic = &self.expected.topic;
        let trouble = Trouble::new(format!(
            "two publishers send the same joints on {topic}: only the first one is accepted"
        ));
        trouble.likely(Some(
            "the driver was started twice, or a recording plays while the robot runs".to_owned(),
        ))
    }

    fn effortless(&self) -> Option<Trouble> {
        let since = self.effort_at.or(self.first_sample)?;
        if since.elapsed() < EFFORTS_WITHIN {
            return None;
        }
        if self.effort_at.is_some() {
            let trouble = Trouble::new(
                "the joint states hold no effort any more: there is nothing to compare",
            );
            let likely =
                "the driver was started again with other settings, or a joint's drive is off";
            return Some(trouble.likely(Some(likely.to_owned())));
        }
        let trouble = Trouble::new("the joint states hold no effort: there is nothing to compare");
        Some(
            trouble.likely(Some(
                "the driver leaves `effort` out by default, or publishes currents on another topic"
                    .to_owned(),
            )),
        )
    }
}

/// Returns the number of states whose stamps do not advance.
fn stale(counts: Counts) -> u64 {
    counts.late + counts.repeated + counts.stalled
}
