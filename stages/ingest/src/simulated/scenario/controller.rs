//! Controller settings in a scenario.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Controller of the arm: joint control with PD, an integral part and feedforward of the nominal model's effort;
/// or Cartesian impedance control.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerSettings {
    /// Natural frequency of the position loop \[Hz\].
    #[schemars(range(min = 0.1, max = 50.0))]
    pub natural_hz: f64,
    /// Damping ratio of the position loop.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub damping: f64,
    /// Integral time: time in which the integral part compensates a constant error; 0 for no integral part \[s\].
    #[schemars(range(min = 0.0, max = 100.0))]
    pub integral_time_s: f64,
    /// Cartesian impedance control instead of joint control: the tool yields like a spring and a damper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub impedance: Option<ImpedanceSpec>,
}

impl Default for ControllerSettings {
    fn default() -> Self {
        Self {
            natural_hz: 5.0,
            damping: 1.0,
            integral_time_s: 0.5,
            impedance: None,
        }
    }
}

/// A Cartesian impedance after Salt Ducaju et al. (2022), equations 1 to 3; the defaults are the paper's.
/// Its reference is the tool's pose in the planned motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImpedanceSpec {
    /// The controlled link; by default the one that holds tools.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The controlled point, in the link's frame \[m\].
    pub point_m: [f64; 3],
    /// Stiffness against displacement \[N/m\].
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub translational_n_per_m: f64,
    /// Stiffness against rotation, per vector part of the rotation's unit quaternion, as in the paper \[N m/rad\].
    /// That part is half the angle, so the stiffness of a small rotation is half of this.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub rotational_nm_per_rad: f64,
    /// Damping ratio. A damping that is not given is `2 damping_ratio sqrt(stiffness)` in SI units, as for a unit
    /// mass.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub damping_ratio: f64,
    /// Damping of displacement \[N s/m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub translational_ns_per_m: Option<f64>,
    /// Damping of rotation, per derivative of the quaternion's vector part \[N m s/rad\].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub rotational_nms_per_rad: Option<f64>,
    /// The damped velocity.
    pub damps: Damps,
    /// Stiffness of the joints in the null space of the tool's motion, about their planned positions
    /// \[N m/rad\].
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub null_space_nm_per_rad: f64,
    /// Damping in the null space; by default from `damping_ratio` \[N m s/rad\].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub null_space_nms_per_rad: Option<f64>,
}

impl Default for ImpedanceSpec {
    fn default() -> Self {
        Self {
            link: None,
            point_m: [0.0; 3],
            translational_n_per_m: 150.0,
            rotational_nm_per_rad: 10.0,
            damping_ratio: 1.0,
            translational_ns_per_m: None,
            rotational_nms_per_rad: None,
            damps: Damps::Variation,
            null_space_nm_per_rad: 10.0,
            null_space_nms_per_rad: None,
        }
    }
}

/// The velocity that an impedance damps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Damps {
    /// Velocity relative to the reference: the tool follows a moving reference without lag.
    #[default]
    Variation,
    /// Absolute velocity of the tool: it follows its reference as a first-order lag with time constant damping /
    /// stiffness.
    Motion,
}
