//! Resolution of a cell's entry against its URDF.

use std::collections::BTreeMap;

use tauscope_bus::MAX_JOINTS;
use tauscope_dynamics::Model;

use super::file::{CellEntry, PipelineFile};
use crate::cell::{Cell, CellFacts, ConstantSpot, too_many, torque_constants};
use crate::report::{Problem, Report};
use crate::suggest;
use crate::urdf;
use crate::yaml::{Located, Place};

/// Resolves every cell; invalid ones are left out and reported.
pub fn resolve(file: &Located<PipelineFile>, report: &mut Report) -> BTreeMap<String, Cell> {
    let mut cells = BTreeMap::new();
    for (name, entry) in &file.value.cells {
        let place = Place::root().key("cells").key(name);
        match (Resolver { file, place, entry }).resolve(name) {
            Ok(cell) => {
                cells.insert(name.clone(), cell);
            }
            Err(problems) => report.append(problems),
        }
    }
    cells
}

struct Resolver<'a> {
    file: &'a Located<PipelineFile>,
    place: Place,
    entry: &'a CellEntry,
}

impl Resolver<'_> {
    fn resolve(&self, name: &str) -> Result<Cell, Report> {
        let mut report = Report::default();
        let (urdf, model, findings) = match self.robot() {
            Ok(Some(robot)) => (Some(robot.urdf), Some(robot.model), robot.findings),
            Ok(None) => (None, None, Vec::new()),
            Err(problem) => return Err(problem.into()),
        };
        let joint_names = self.joint_names(model.as_ref(), &mut report);
        let constants = self.torque_constants(&joint_names, &mut report);
        self.check_tool(model.as_ref(), &mut report);
        let facts = CellFacts {
            name: name.to_owned(),
            urdf,
            joint_names,
            effort_unit: self.entry.effort_unit,
            torque_constants_nm_per_a: constants,
            tool: self.entry.tool.clone(),
            impedance: self.entry.impedance,
        };
        report.into_result(Cell {
            facts,
            model,
            findings,
        })
    }

    fn robot(&self) -> Result<Option<urdf::Robot>, Problem> {
        let Some(robot) = &self.entry.robot else {
            return Ok(None);
        };
        let place = self.place.key("robot");
        let path = self.file.resolve(robot);
        let robot = urdf::read(&path);
        robot
            .map(Some)
            .map_err(|error| self.file.at(&place, error.to_string()))
    }

    fn joint_names(&self, model: Option<&Model>, report: &mut Report) -> Vec<String> {
        let place = self.place.key("joints");
        let names = match (model, &self.entry.joints) {
            (Some(_), Some(_)) => {
                let problem = self.file.at_key(&place, "the joints are those of the URDF");
                report.push(problem.help("leave `joints` out, or `robot`"));
                Vec::new()
            }
            (Some(model), None) => model.joint_names().map(str::to_owned).collect(),
            (None, Some(names)) => {
                for (index, name) in names.iter().enumerate() {
                    if let Some(first) = names[..index].iter().position(|other| other == name) {
                        let problem = self
                            .file
                            .at(
                                &place.index(index),
                                format!("joint `{name}` is named twice"),
                            )
                            .also(self.file.span(&place.index(first)), "the first time");
                        report.push(problem);
                    }
                }
                names.clone()
            }
            (None, None) => {
                let cell = self.place.describe();
                let problem = self.file.at_key(
                    &self.place,
                    format!("`{cell}` has neither a `robot` nor `joints`"),
                );
                report.push(problem.help(
                    "give `robot: <URDF>`, or name the `joints` if another twin's effort is on a topic",
                ));
                return Vec::new();
            }
        };
        if names.len() > MAX_JOINTS {
            let key = if model.is_some() { "robot" } else { "joints" };
            report.push(self.file.at(&self.place.key(key), too_many(names.len())));
        }
        names
    }

    fn torque_constants(&self, joints: &[String], report: &mut Report) -> Option<Vec<f64>> {
        let constants = self.entry.torque_constants_nm_per_a.as_ref()?;
        let problem = |spot: ConstantSpot<'_>, title| spot.problem(self.file, &self.place, title);
        let unit = self.entry.effort_unit;
        torque_constants(constants, joints, unit, &problem, report)
    }

    fn check_tool(&self, model: Option<&Model>, report: &mut Report) {
        let Some(tool) = &self.entry.tool else { return };
        let place = self.place.key("tool");
        let Some(model) = model else {
            let problem = self
                .file
                .at_key(&place, "a tool, but no robot that it is attached to");
            report.push(problem.help("give `robot: <URDF>`, or leave `tool` out"));
            return;
        };
        if model.link_index(&tool.link).is_none() {
            let names: Vec<&str> = model
                .links()
                .iter()
                .map(|link| link.name.as_str())
                .collect();
            let title = format!("the robot has no link `{}`", tool.link);
            let help = suggest::help(&tool.link, "the links are", names);
            report.push(self.file.at(&place.key("link"), title).maybe_help(help));
        }
    }
}
