//! A cell: its robot, and the properties that its stages need.

mod constants;
mod joints;

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use tauscope_bus::EffortUnit;
use tauscope_bus::MAX_JOINTS;
use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{TermSpec, of_drives};

pub use constants::{ConstantSpot, torque_constants};
pub use joints::{Fixed, recorded_joint_names};

use crate::report::{Problem, Report};
use crate::urdf;

/// A cell with all names resolved.
#[derive(Debug, Clone)]
pub struct Cell {
    /// Properties that can be sent to another process.
    pub facts: CellFacts,
    /// The robot.
    pub model: Option<Model>,
    /// Findings about the robot's file, a sentence each.
    pub findings: Vec<String>,
}

/// Properties of a cell that its stages need.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct CellFacts {
    /// The cell's name.
    pub name: String,
    /// The robot's URDF as text.
    pub urdf: Option<String>,
    /// The joints, in the order of the samples' arrays.
    pub joint_names: Vec<String>,
    /// Unit of the measured effort.
    pub effort_unit: EffortUnit,
    /// Torque constants by joint \[N m/A\], if the effort is a current and they are known.
    pub torque_constants_nm_per_a: Option<Vec<f64>>,
    /// The tool.
    pub tool: Option<ToolEntry>,
    /// The impedance of a Cartesian controller at the tool.
    pub impedance: Option<tauscope_detect::Impedance>,
}

impl Cell {
    /// Builds the cell from its properties.
    ///
    /// # Errors
    /// If the URDF is invalid, which the check of the file excludes.
    pub fn from_facts(facts: CellFacts) -> Result<Self, tauscope_dynamics::ModelError> {
        let model = facts.urdf.as_deref().map(Model::from_urdf).transpose()?;
        Ok(Self {
            facts,
            model,
            findings: Vec::new(),
        })
    }

    /// Builds a cell of the robot at `path`, without a pipeline file. `constants` are the torque constants by joint
    /// \[N m/A\], empty if unknown; `problem` reports an error in them at its place.
    ///
    /// # Errors
    /// If the URDF cannot be read or used, or the constants do not match its joints.
    pub fn from_urdf(
        path: &Path,
        effort_unit: EffortUnit,
        constants: &BTreeMap<String, f64>,
        problem: &dyn Fn(ConstantSpot<'_>, String) -> Problem,
    ) -> Result<Self, Report> {
        let robot = urdf::read(path).map_err(|error| Problem::of_file(path, error.to_string()))?;
        let joint_names = robot.model.joint_names().map(str::to_owned).collect();
        let name = robot.model.name().to_owned();
        let mut cell = Self::from_joints(name, joint_names, effort_unit, constants, problem)?;
        cell.facts.urdf = Some(robot.urdf);
        cell.model = Some(robot.model);
        cell.findings = robot.findings;
        Ok(cell)
    }

    /// Builds a cell of which only the joints are known; otherwise as [`Cell::from_urdf`].
    ///
    /// # Errors
    /// If there are too many joints, or the constants do not match them.
    pub fn from_joints(
        name: String,
        joint_names: Vec<String>,
        effort_unit: EffortUnit,
        constants: &BTreeMap<String, f64>,
        problem: &dyn Fn(ConstantSpot<'_>, String) -> Problem,
    ) -> Result<Self, Report> {
        if joint_names.len() > MAX_JOINTS {
            return Err(Problem::new(too_many(joint_names.len())).into());
        }
        let mut report = Report::default();
        let mut by_joint = None;
        if !constants.is_empty() {
            by_joint = torque_constants(constants, &joint_names, effort_unit, problem, &mut report);
        }
        let facts = CellFacts {
            name,
            urdf: None,
            joint_names,
            effort_unit,
            torque_constants_nm_per_a: by_joint,
            tool: None,
            impedance: None,
        };
        report.into_result(Self {
            facts,
            model: None,
            findings: Vec::new(),
        })
    }

    /// Effort limits of the robot file by joint \[N m or N\]; empty without a robot.
    pub fn effort_limits(&self) -> Vec<Option<f64>> {
        let joints = self.model.iter().flat_map(Model::joints);
        joints.map(|joint| joint.limits.effort).collect()
    }

    /// Friction, rotor inertias and springs of the robot's file, if the measured unit is N m or torque constants are
    /// known.
    pub fn stated_terms(&self) -> Vec<TermSpec> {
        let facts = &self.facts;
        let is_told =
            facts.effort_unit == EffortUnit::Nm || facts.torque_constants_nm_per_a.is_some();
        let model = self.model.as_ref().filter(|_| is_told);
        model.map_or_else(Vec::new, of_drives)
    }

    /// Index of the link that the tool is attached to.
    pub fn tool_link(&self) -> Option<usize> {
        self.model
            .as_ref()?
            .link_index(&self.facts.tool.as_ref()?.link)
    }

    /// Contact point of the tool in its link's frame \[m\].
    pub fn contact_point_on_tool_m(&self) -> Option<[f64; 3]> {
        self.facts.tool.as_ref()?.contact_point_m
    }
}

/// Error message for a cell with too many joints.
pub(crate) fn too_many(joints: usize) -> String {
    format!("{joints} joints, at most {MAX_JOINTS} are supported")
}

/// A rigid body attached to a link.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolEntry {
    /// The link it is attached to.
    pub link: String,
    /// Its mass \[kg\]; 0 if only a topic reports the tool.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub mass_kg: f64,
    /// Its centre of mass in the link's frame \[m\].
    #[serde(default)]
    pub com_m: [f64; 3],
    /// Its inertia about its centre of mass, axes of the link: xx, xy, xz, yy, yz, zz \[kg m²\].
    #[serde(default)]
    pub inertia_kgm2: [f64; 6],
    /// Its contact point in the link's frame \[m\]; by default the link's origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_point_m: Option<[f64; 3]>,
}
