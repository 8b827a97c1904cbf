//! Velocities for a source that gives only positions. Causal, so that a replay reproduces the live run.

use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::derivative::FilteredDerivative;

/// Longest gap across which positions or velocities are differentiated \[ns\].
/// Physical: an arm moves with frequencies of up to about 2 Hz, which needs four samples a second.
pub(crate) const MAX_GAP_NS: i64 = 250_000_000;
/// Duration from which repeated rows are treated as a standstill \[ns\]. Shorter repetitions are skipped, since many
/// drivers publish faster than they measure.
/// Physical: controllers measure at least 20 times a second; a repetition that lasts longer is not one of the
/// driver's.
const MAX_REPEAT_NS: i64 = 50_000_000;

/// Differentiates positions.
#[derive(Debug)]
pub(super) struct Differentiator {
    filters: Vec<FilteredDerivative>,
    /// Stamp and position of the last row that was not a repetition.
    last: Option<(i64, JointArray)>,
    velocity: JointArray,
}

/// Result of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Differentiated {
    pub velocity: JointArray,
    /// Whether the velocity is differentiated and restarts here, at zero.
    pub restarted: bool,
}

impl Differentiator {
    pub fn new(joint_count: usize, cutoff_hz: f64) -> Self {
        Self {
            filters: (0..joint_count)
                .map(|_| FilteredDerivative::new(cutoff_hz))
                .collect(),
            last: None,
            velocity: [0.0; MAX_JOINTS],
        }
    }

    /// Discards all earlier rows.
    pub fn reset(&mut self) {
        self.last = None;
    }

    /// Returns the velocity at `position`: `given`, if the source gives one.
    pub fn update(
        &mut self,
        stamp_ns: i64,
        position: &JointArray,
        given: Option<&JointArray>,
    ) -> Differentiated {
        if let Some(velocity) = given {
            self.last = None;
            return Differentiated {
                velocity: *velocity,
                restarted: false,
            };
        }
        let step_ns = self.last.map(|(at, _)| stamp_ns - at);
        let restarted = !step_ns.is_some_and(|step| (0..=MAX_GAP_NS).contains(&step));
        if restarted {
            self.velocity = [0.0; MAX_JOINTS];
            for (filter, &q) in self.filters.iter_mut().zip(position) {
                filter.reset(q);
            }
        } else {
            let repeats = self
                .last
                .is_some_and(|(_, before)| before.map(f64::to_bits) == position.map(f64::to_bits));
            let step_ns = step_ns.unwrap_or(0);
            if repeats && step_ns < MAX_REPEAT_NS {
                return Differentiated {
                    velocity: self.velocity,
                    restarted,
                };
            }
            let dt_s = step_ns as f64 * 1e-9;
            for ((filter, &q), velocity) in self
                .filters
                .iter_mut()
                .zip(position)
                .zip(&mut self.velocity)
            {
                *velocity = filter.update(dt_s, q);
            }
        }
        self.last = Some((stamp_ns, *position));
        Differentiated {
            velocity: self.velocity,
            restarted,
        }
    }
}
