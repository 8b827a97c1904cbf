//! Detects a driver that repeats its last measurement under new stamps: it has lost the robot, so contacts no longer
//! show.

use tauscope_bus::{JointArray, JointState, Trouble, flags};

/// Duration without any change from which a measurement is treated as frozen \[ns\].
/// Physical: currents and encoders flicker in their last bit many times a second.
const FROZEN_NS: i64 = 2_000_000_000;

/// The newest measurement, and the time since which it is unchanged.
#[derive(Debug, Default)]
pub(super) struct Frozen {
    newest: Option<[JointArray; 3]>,
    since_ns: i64,
    newest_ns: i64,
}

impl Frozen {
    /// Takes a sample.
    pub fn sample(&mut self, sample: &JointState) {
        let now_ns = sample.header.stamp_ns;
        let measured = [sample.position, sample.velocity, sample.effort];
        let has_effort = sample.header.has(flags::EFFORT_MEASURED);
        let is_same = has_effort && self.newest.as_ref() == Some(&measured);
        if !is_same || now_ns < self.newest_ns {
            self.newest = Some(measured);
            self.since_ns = now_ns;
        }
        self.newest_ns = now_ns;
    }

    /// Whether the measurement is frozen.
    pub fn is_frozen(&self) -> bool {
        self.newest_ns.saturating_sub(self.since_ns) >= FROZEN_NS
    }

    /// Describes the frozen measurement; returns `None` if it still changes.
    pub fn trouble(&self) -> Option<Trouble> {
        if !self.is_frozen() {
            return None;
        }
        let trouble = Trouble::new(
            "position, velocity and effort of all joints have been the same to the last bit for more than 2 s: \
             contacts would not show, so they are treated as not measured",
        );
        Some(trouble.likely(Some(
            "the driver has lost the robot and repeats its last measurement, the drives are off, or a simulation stands still"
                .to_owned(),
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn state(stamp_ns: i64, effort_nm: f64) -> JointState {
        let mut state = JointState::default();
        state.header.stamp_ns = stamp_ns;
        state.header.flags = flags::EFFORT_MEASURED;
        state.header.joint_count = 2;
        state.effort[1] = effort_nm;
        state
    }

    #[test]
    fn a_measurement_that_is_repeated_for_two_seconds_is_told_of_until_it_changes() {
        let mut frozen = Frozen::default();
        for ms in 0..10_000 {
            frozen.sample(&state(ms * MS, if ms % 1000 == 0 { 1.0 } else { 1.1 }));
            assert!(frozen.trouble().is_none(), "{ms}");
        }
        for ms in 10_000..13_000 {
            frozen.sample(&state(ms * MS, 1.1));
        }
        let trouble = frozen.trouble().unwrap();
        assert!(trouble.what.contains("the same to the last bit"));
        frozen.sample(&state(13_000 * MS, 1.2));
        assert!(frozen.trouble().is_none());
    }

    #[test]
    fn states_without_effort_and_a_clock_that_is_set_back_are_none() {
        let mut frozen = Frozen::default();
        for ms in 0..5000 {
            let mut state = state(ms * MS, 0.0);
            state.header.flags = 0;
            frozen.sample(&state);
        }
        assert!(frozen.trouble().is_none());
        frozen.sample(&state(9_000 * MS, 1.0));
        frozen.sample(&state(1_000 * MS, 1.0));
        assert!(frozen.trouble().is_none());
    }
}
