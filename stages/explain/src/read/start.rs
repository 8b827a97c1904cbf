//! A corrected twin to start from.

use tauscope_dynamics::terms::{Against, TermSpec};

/// A known scale is at least this many times its own deviation.
pub const KNOWN: f64 = 5.0;

/// A corrected twin.
#[derive(Debug, Clone, Default)]
pub struct Start {
    /// Its physics.
    pub terms: Vec<TermSpec>,
    /// Gain of each joint's bodies \[effort unit per model unit\].
    pub gain: Vec<f64>,
    /// Standard deviation of each gain that stands for a torque constant: 0 where it is exact, infinite where it tells nothing.
    pub gain_deviation: Vec<f64>,
    /// Offset of each joint \[effort unit\].
    pub offset: Vec<f64>,
}

impl Start {
    /// Whether the gain of a joint tells how many N m its effort is.
    pub fn is_scale_known(&self, joint: usize) -> bool {
        self.gain[joint] > KNOWN * self.gain_deviation[joint]
    }

    /// Whether something of it depends on what the gears transmit.
    pub fn needs_load(&self) -> bool {
        let needs = |term: &TermSpec| {
            let against = term.table.as_ref().map(|table| table.against);
            let by_load = term.effect().is_ok_and(|effect| effect.traits.needs_load);
            by_load || against == Some(Against::Load)
        };
        self.terms.iter().any(needs)
    }
}
