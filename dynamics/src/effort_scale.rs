//! Unit of a measured effort, from its slope over the effort that the robot's motion requires.
//!
//! A joint that carries weight has a slope of 1 if the unit is N m. A motor current is smaller by the torque constant
//! at the joint, which is 3 to 100 N m/A for geared arms. So the slopes of the joints that carry weight determine the
//! unit, and a negative slope means a reversed sign.

use std::fmt;

/// Factor from 1, in either direction, beyond which a slope means a wrong unit rather than physics.
/// Physical: a payload or wrong masses change the torque of the joints that carry weight less than threefold, and
/// torque constants at the joint begin at 3 N m/A.
const WRONG_SCALE: f64 = 3.0;
/// Factor from 1, in either direction, within which the unit is certainly N m.
/// Physical: as `WRONG_SCALE`, for an arm whose payload weighs no more than the arm.
const SURE_SCALE: f64 = 2.0;
/// Largest measured effort per N m that may be a current in A.
/// Physical: torque constants at the joint begin at 0.1 N m/A, of small motors without a gear.
const TOO_MUCH_CURRENT: f64 = 30.0;
/// Share of the measured effort that a line over the modelled effort must explain for its slope to be used.
/// Statistical: the model then explains more than friction, noise and everything else together.
pub const TELLING: f64 = 0.5;

/// Measured effort per modelled N m of a joint that carries weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Slope {
    /// The joint.
    pub joint: String,
    /// The slope \[recorded unit per N m\].
    pub slope: f64,
}

/// Result of the slopes of an arm: the unit and sign of its effort.
#[derive(Debug, Clone, PartialEq)]
pub enum EffortScale {
    /// No joint has a usable slope.
    Untold,
    /// Joints measure with the opposite sign of the robot's model.
    Turned {
        /// Names of these joints.
        joints: Vec<String>,
        /// Number of joints that measure with the model's sign.
        others: usize,
    },
    /// N m; `sure` if the slopes leave no other explanation.
    Torque {
        /// Median slope.
        slope: f64,
        /// Whether it is within a factor of two of 1.
        sure: bool,
    },
    /// Less than a third of a N m per N m: a motor current, or a torque on the motor's side of the gear.
    Current {
        /// Median factor from the recorded unit to N m at the joint.
        nm_per_unit: f64,
        /// Number of joints with such a slope.
        joints: usize,
    },
    /// More than three units per N m: neither N m nor A of this robot.
    TooLarge {
        /// Median slope.
        slope: f64,
    },
}

impl EffortScale {
    /// Determines the scale from `slopes`.
    pub fn of(slopes: &[Slope]) -> Self {
        let turned = slopes.iter().filter(|one| one.slope < 0.0);
        let turned: Vec<String> = turned.map(|one| one.joint.clone()).collect();
        if !turned.is_empty() {
            let others = slopes.len() - turned.len();
            return Self::Turned {
                joints: turned,
                others,
            };
        }
        let all: Vec<f64> = slopes.iter().map(|one| one.slope).collect();
        Self::of_positive(&all)
    }

    /// Determines the scale from slopes that are known to be positive.
    pub fn of_positive(slopes: &[f64]) -> Self {
        let mut known = slopes.to_vec();
        known.retain(|slope| slope.is_finite() && *slope != 0.0);
        known.sort_by(f64::total_cmp);
        let Some(&slope) = known.get(known.len() / 2) else {
            return Self::Untold;
        };
        if slope < 1.0 / WRONG_SCALE {
            Self::Current {
                nm_per_unit: 1.0 / slope,
                joints: known.len(),
            }
        } else if slope > WRONG_SCALE {
            Self::TooLarge { slope }
        } else {
            let sure = (1.0 / SURE_SCALE..=SURE_SCALE).contains(&slope);
            Self::Torque { slope, sure }
        }
    }

    /// Fault if the effort is declared to be in N m; `None` if it may be.
    pub fn fault_in_nm(&self) -> Option<ScaleFault> {
        match self {
            Self::Untold | Self::Torque { .. } => None,
            Self::Turned { joints, others } => Some(ScaleFault::Turned {
                joints: joints.clone(),
                others: *others,
            }),
            Self::Current { nm_per_unit, .. } => Some(ScaleFault::WrongUnit {
                slope: 1.0 / nm_per_unit,
            }),
            Self::TooLarge { slope } => Some(ScaleFault::WrongUnit { slope: *slope }),
        }
    }

    /// Fault if the effort is declared to be in A; `None` if it may be.
    pub fn fault_in_a(&self) -> Option<ScaleFault> {
        match self {
            Self::Turned { joints, others } => Some(ScaleFault::Turned {
                joints: joints.clone(),
                others: *others,
            }),
            Self::TooLarge { slope } if *slope > TOO_MUCH_CURRENT => {
                Some(ScaleFault::NoCurrent { slope: *slope })
            }
            _ => None,
        }
    }

    /// Fault if the effort is declared to be in N m, from its variation per N m of variation of the model. Friction
    /// and noise can only increase this ratio.
    pub fn fault_of_spread_in_nm(spread: f64) -> Option<ScaleFault> {
        (spread < 1.0 / WRONG_SCALE).then_some(ScaleFault::WrongUnit { slope: spread })
    }
}

/// Reason why an effort cannot be this robot's in N m or A.
#[derive(Debug, Clone, PartialEq)]
pub enum ScaleFault {
    /// Efforts decrease while the model's increase.
    Turned {
        /// Names of these joints.
        joints: Vec<String>,
        /// Number of joints with the model's sign.
        others: usize,
    },
    /// The measured effort is a multiple of the effort that the motion requires.
    WrongUnit {
        /// Median slope of the joints that carry weight.
        slope: f64,
    },
    /// The efforts are too large for motor currents in A.
    NoCurrent {
        /// Median slope of the joints that carry weight \[recorded unit per N m\].
        slope: f64,
    },
}

impl fmt::Display for ScaleFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // A vertical axis carries no weight; its slope comes from inertia.
            Self::Turned { joints, others } if joints.len() > others + 1 => write!(
                f,
                "the effort of {} has the other sign than this robot's motion requires: either the robot hangs upside down, and \
                 the base must be turned in the URDF, or the driver turns their signs",
                joints.join(", ")
            ),
            Self::Turned { joints, .. } => write!(
                f,
                "the effort of {} has the other sign than this robot's motion requires: turn its sign in the driver, \
                 or the joint's axis in the URDF",
                joints.join(", ")
            ),
            Self::NoCurrent { slope } => write!(
                f,
                "the measured effort is {slope:.0} for each N m that this robot's motion requires, too much for a motor \
                 current in A: a driver that publishes mA must divide by 1000"
            ),
            Self::WrongUnit { slope } => {
                write!(
                    f,
                    "the measured effort is {slope:.2} times what this robot's motion requires: the unit, the torque \
                     constants or the masses of the robot file are wrong"
                )?;
                if *slope < 1.0 {
                    write!(
                        f,
                        " (a driver that publishes motor current needs --effort-unit A)"
                    )?;
                }
                Ok(())
            }
        }
    }
}

impl std::error::Error for ScaleFault {}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(slopes: &[f64]) -> EffortScale {
        let slopes = slopes.iter().enumerate().map(|(index, slope)| Slope {
            joint: format!("joint{}", index + 1),
            slope: *slope,
        });
        EffortScale::of(&slopes.collect::<Vec<_>>())
    }

    #[test]
    fn a_torque_a_current_and_a_turned_joint_are_told_apart() {
        assert_eq!(of(&[]), EffortScale::Untold);
        assert!(matches!(
            of(&[0.9, 1.1, 1.0]),
            EffortScale::Torque { sure: true, .. }
        ));
        assert!(matches!(
            of(&[2.5]),
            EffortScale::Torque { sure: false, .. }
        ));
        let said = |slopes: &[f64]| of(slopes).fault_in_nm().unwrap().to_string();
        assert!(said(&[1.0, -0.9, 1.1]).contains("or the joint's axis"));
        assert!(said(&[1.0, -0.9, -1.1, -1.0]).contains("upside down"));
        // The published constants of a UR10e's shoulder lift and elbow.
        let current = of(&[1.0 / 10.7, 1.0 / 8.46]);
        assert!(
            matches!(current, EffortScale::Current { joints: 2, nm_per_unit } if (8.0..11.0).contains(&nm_per_unit))
        );
        assert_eq!(
            of(&[1.0, -1.0, 1.0]),
            EffortScale::Turned {
                joints: vec!["joint2".to_owned()],
                others: 2
            }
        );
        assert!(matches!(of(&[1000.0]), EffortScale::TooLarge { .. }));
    }

    #[test]
    fn only_what_cannot_be_nm_is_a_fault_in_nm() {
        assert_eq!(of(&[1.0]).fault_in_nm(), None);
        assert_eq!(of(&[]).fault_in_nm(), None);
        let fault = of(&[0.1, 0.1]).fault_in_nm().map(|fault| fault.to_string());
        assert!(fault.is_some_and(|text| text.contains("0.10 times") && text.contains("--effort-unit A")));
        let fault = of(&[125.0]).fault_in_a().map(|fault| fault.to_string());
        assert!(fault.is_some_and(|text| text.contains("mA")));
        assert_eq!(of(&[0.1, 0.3]).fault_in_a(), None);
        assert_eq!(of(&[5.0]).fault_in_a(), None);
        assert_eq!(EffortScale::fault_of_spread_in_nm(0.9), None);
        assert!(EffortScale::fault_of_spread_in_nm(0.1).is_some());
        let fault = of(&[-1.0]).fault_in_nm().map(|fault| fault.to_string());
        assert!(fault.is_some_and(|text| text.contains("joint1") && text.contains("sign")));
    }
}
