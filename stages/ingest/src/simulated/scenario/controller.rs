//! How the arm is driven.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the arm is driven: in its joints by PD, an integral part, and the effort of the nominal model ahead;
/// or as a Cartesian impedance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerSettings {
    /// Natural frequency of the position loop \[Hz\].
    #[schemars(range(min = 0.1, max = 50.0))]
    pub natural_hz: f64,
    /// Its damping ratio.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub damping: f64,
    /// Time in which the integral part takes over a lasting error; 0 for no integral part \[s\].
    #[schemars(range(min = 0.0, max = 100.0))]
    pub integral_time_s: f64,
    /// In place of all that, a Cartesian impedance: the tool gives way as on a spring and a damper.
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
/// The reference is where the motion would have the tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImpedanceSpec {
    /// The link that is held; by default the one that holds tools.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The point of it that is held, in its frame \[m\].
    pub point_m: [f64; 3],
    /// Stiffness against displacement \[N/m\].
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub translational_n_per_m: f64,
    /// Stiffness against rotation, by the vector part of the rotation's unit quaternion, as in the paper:
    /// that is half the angle, so a small rotation meets half of this \[N m/rad\].
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub rotational_nm_per_rad: f64,
    /// The damping is `2 damping_ratio sqrt(stiffness)` in SI units, as for a unit mass, where none is given.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub damping_ratio: f64,
    /// Damping of displacement \[N s/m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub translational_ns_per_m: Option<f64>,
    /// Damping of rotation, by the derivative of the quaternion's vector part \[N m s/rad\].
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub rotational_nms_per_rad: Option<f64>,
    /// What is damped.
    pub damps: Damps,
    /// Stiffness of the joints, about where the motion would have them, in what motion leaves the tool
    /// where it is \[N m/rad\].
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub null_space_nm_per_rad: f64,
    /// Damping there; by default as for the others \[N m s/rad\].
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
    /// That of the variation from the reference: the tool keeps up with a reference that moves.
    #[default]
    Variation,
    /// The tool's own: it follows its reference as a first-order system does, damping over stiffness behind.
    Motion,
}
