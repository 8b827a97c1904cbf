//! Validation of samples from other processes: every bit pattern is a sample, but not every one is valid.

use super::{Command, Detection, Header, Health, JointState, MAX_JOINTS, TwinState, flags};

/// Latest stamp \[ns\].
/// Physical: the stamp of a ROS 2 message counts its seconds in 31 bits.
const LATEST_NS: i64 = i32::MAX as i64 * 1_000_000_000 + 999_999_999;
/// Largest valid sequence number; beyond it, counters could overflow.
/// Resolution: 285 000 years at 1 kHz.
pub(crate) const MOST_SAMPLES: u64 = 1 << 53;

/// Reason for the refusal of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Unsound {
    /// Joint count beyond the capacity of a sample.
    #[error("{0} joints, at most {MAX_JOINTS} are possible")]
    Joints(u32),
    /// Time stamp out of range \[ns\].
    #[error("an impossible stamp of {0} ns")]
    Stamp(i64),
    /// Sequence number out of range.
    #[error("the impossible sequence number {0}")]
    Sequence(u64),
    /// Non-finite value in the named field.
    #[error("a value of `{0}` that is not finite")]
    NotFinite(&'static str),
}

impl Header {
    pub(super) fn check(&self) -> Result<(), Unsound> {
        if self.joint_count as usize > MAX_JOINTS {
            return Err(Unsound::Joints(self.joint_count));
        }
        if self.sequence > MOST_SAMPLES {
            return Err(Unsound::Sequence(self.sequence));
        }
        is_time(self.stamp_ns)?;
        is_time(self.received_ns)
    }
}

/// Checks that the difference between two such times cannot overflow.
fn is_time(stamp_ns: i64) -> Result<(), Unsound> {
    if stamp_ns.unsigned_abs() > LATEST_NS.unsigned_abs() {
        return Err(Unsound::Stamp(stamp_ns));
    }
    Ok(())
}

fn finite(name: &'static str, values: &[f64]) -> Result<(), Unsound> {
    // No early exit: without a branch per value, the loop is vectorised.
    if values
        .iter()
        .fold(true, |all, value| all & value.is_finite())
    {
        Ok(())
    } else {
        Err(Unsound::NotFinite(name))
    }
}

macro_rules! finite {
    ($sample:ident: $($field:ident),+) => {
        $(finite(stringify!($field), &$sample.$field)?;)+
    };
}

/// Validation of the values after the header.
pub(super) trait Values {
    fn check_values(&self) -> Result<(), Unsound>;
}

impl Values for JointState {
    fn check_values(&self) -> Result<(), Unsound> {
        finite!(self: position, velocity, effort, command_position, command_velocity, reference_effort,
            tool_com_m, tool_inertia_kgm2);
        finite("tool_mass_kg", &[self.tool_mass_kg])?;
        let Command { value, com_m, .. } = self.command;
        finite("command", &[value])?;
        finite("command", &com_m)
    }
}

impl Values for TwinState {
    fn check_values(&self) -> Result<(), Unsound> {
        finite!(self: position, velocity, acceleration, effort, expected_effort, filtered_effort,
            filtered_expected_effort, residual);
        Ok(())
    }
}

impl Values for Detection {
    /// Score and threshold may be infinite: they are only displayed.
    fn check_values(&self) -> Result<(), Unsound> {
        is_time(self.contact_ns)?;
        if self.header.has(flags::FORCE) {
            finite!(self: force_n, point_m);
        }
        finite!(self: content_n, rise_direction, motion_direction);
        finite("size", &[self.size])
    }
}

impl Values for Health {
    fn check_values(&self) -> Result<(), Unsound> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::Sample;

    #[test]
    fn a_sample_that_could_harm_is_refused_and_says_why() {
        let sound = JointState::default();
        assert_eq!(sound.check(), Ok(()));
        let mut joints = sound;
        joints.header.joint_count = 4_000_000_000;
        assert_eq!(joints.check(), Err(Unsound::Joints(4_000_000_000)));
        let mut late = sound;
        late.header.stamp_ns = i64::MIN;
        assert_eq!(late.check(), Err(Unsound::Stamp(i64::MIN)));
        let mut far = sound;
        far.header.sequence = u64::MAX;
        assert_eq!(far.check(), Err(Unsound::Sequence(u64::MAX)));
        let mut empty = sound;
        empty.effort[15] = f64::NAN;
        assert_eq!(empty.check(), Err(Unsound::NotFinite("effort")));
        assert_eq!(
            empty.check().unwrap_err().to_string(),
            "a value of `effort` that is not finite"
        );
    }

    #[test]
    fn the_rest_of_an_end_mark_is_void() {
        let mut end = TwinState::default();
        end.header.flags = flags::END;
        end.residual[3] = f64::INFINITY;
        assert_eq!(end.check(), Ok(()));
    }

    #[test]
    fn a_score_may_be_infinite_and_a_force_that_is_not_meant_anything() {
        let mut detection = Detection {
            score: f64::INFINITY,
            force_n: [f64::NAN; 3],
            ..Detection::default()
        };
        assert_eq!(detection.check(), Ok(()));
        detection.header.flags = flags::FORCE;
        assert_eq!(detection.check(), Err(Unsound::NotFinite("force_n")));
    }
}
