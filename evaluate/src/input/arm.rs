//! The arm of a set: its robot, its joints, its tool.

use tauscope_pipeline::cell::{Cell, ConstantSpot, ToolEntry, recorded_joint_names};
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;
use tauscope_pipeline::yaml::{Located, Place};

/// Builds the cell of a set; without a robot the joints are those of the first recording.
///
/// # Errors
/// If the robot, the joints or the torque constants cannot be used.
pub fn cell(
    file: &Located<SetFile>,
    notes: &mut Vec<String>,
    report: &mut Report,
) -> Result<Cell, Report> {
    let (set, root) = (&file.value, Place::root());
    let constants = set.torque_constants_nm_per_a.clone().unwrap_or_default();
    let problem = |spot: ConstantSpot<'_>, title| spot.problem(file, &root, title);
    let unit = set.effort_unit;
    let Some(robot) = &set.robot else {
        if set.tool_link.is_some() {
            notes.push("`tool_link` has no effect: the set names no `robot`".to_owned());
        }
        let joints = joint_names(file)?;
        return Cell::from_joints(String::new(), joints, unit, &constants, &problem);
    };
    let mut cell = Cell::from_urdf(&file.resolve(robot), unit, &constants, &problem)?;
    if let Some(link) = &set.tool_link
        && let Some(model) = &cell.model
        && model.link_index(link).is_none()
    {
        let names = model.links().iter().map(|link| link.name.as_str());
        let title = format!("the robot has no link `{link}`");
        let help = suggest::help(link, "the links are", names);
        report.push(file.at(&root.key("tool_link"), title).maybe_help(help));
    }
    cell.facts.tool = set.tool_link.clone().map(|link| ToolEntry {
        link,
        // The URDF contains its mass.
        mass_kg: 0.0,
        com_m: [0.0; 3],
        inertia_kgm2: [0.0; 6],
        contact_point_m: set.contact_point_on_tool_m,
    });
    Ok(cell)
}

fn joint_names(file: &Located<SetFile>) -> Result<Vec<String>, Report> {
    let set = &file.value;
    let mut recordings = set.train.iter().chain(&set.validation).chain(&set.test);
    let Some(first) = recordings.next() else {
        let problem = Problem::new("the set names neither a `robot` nor a recording");
        return Err(problem.into());
    };
    recorded_joint_names(&file.resolve(first), &set.topics.state)
}
