//! Physics that an explanation starts from: a corrected twin, or friction, rotors and springs in the robot's file.

use tauscope_dynamics::terms::{Against, TermSpec};

/// A torque scale counts as known if it is at least this many times its standard deviation.
/// Statistical: its 95 % interval is then no wider than ±1.96 / 5 = ±39 %.
pub const KNOWN: f64 = 5.0;

/// Physics of a twin in addition to rigid bodies.
#[derive(Debug, Clone, Default)]
pub struct Start {
    /// Whether it was found on this arm before. Else the robot's file states it.
    pub was_found: bool,
    /// Its physics terms.
    pub terms: Vec<TermSpec>,
    /// Gain of each joint's bodies \[effort unit per model unit\].
    pub gain: Vec<f64>,
    /// Standard deviation of each gain that stands for a torque constant: 0 if exact, infinite if not identifiable.
    pub gain_deviation: Vec<f64>,
    /// Offset of each joint \[effort unit\].
    pub offset: Vec<f64>,
}

impl Start {
    /// Whether a joint's gain is known well enough to convert its effort into N m.
    pub fn is_scale_known(&self, joint: usize) -> bool {
        self.gain[joint] > KNOWN * self.gain_deviation[joint]
    }

    /// Whether one of its terms depends on the torque that the gears transmit.
    pub fn needs_load(&self) -> bool {
        let needs = |term: &TermSpec| {
            let against = term.table.as_ref().map(|table| table.against);
            let by_load = term.effect().is_ok_and(|effect| effect.traits.needs_load);
            by_load || against.is_some_and(Against::is_of_load)
        };
        self.terms.iter().any(needs)
    }
}
