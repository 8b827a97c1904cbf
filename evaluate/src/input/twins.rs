//! Choice of the twins behind which a set is evaluated.

use std::path::Path;

use tauscope_pipeline::cell::{Cell, EffortUnit};
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::replay::stem;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;
use tauscope_pipeline::yaml::{self, Located, Place};
use tauscope_twin::TwinFile;

use super::{TwinChoice, TwinSource};

/// Returns the twins that `names` lists, or the default twin.
pub fn choices(
    file: &Located<SetFile>,
    cell: &Cell,
    names: &[String],
    report: &mut Report,
) -> Vec<TwinChoice> {
    let set = &file.value;
    if set.robot.is_none() && set.topics.twin.is_none() {
        let problem = file.at_key(
            &Place::root(),
            "neither a `robot` nor the topic of another twin",
        );
        report.push(problem.help("give `robot: <URDF>`, or `topics: {twin: <topic>}`"));
        return Vec::new();
    }
    let usual = if set.topics.twin.is_some() {
        "topic"
    } else if set.impedance.is_some() && cell.facts.effort_unit == EffortUnit::Nm {
        // An arm under impedance control measures torque behind its gears: a fitted gain would only absorb friction.
        "rigid"
    } else {
        "regression"
    };
    let usual = [usual.to_owned()];
    let names = if names.is_empty() { &usual } else { names };
    let mut all: Vec<TwinChoice> = Vec::new();
    for name in names {
        let source = match name.as_str() {
            "rigid" | "regression" if set.robot.is_none() => {
                let problem = Problem::new(format!("--twin {name}: the set names no `robot`"));
                report.push(problem.help("give `robot: <URDF>` in the set, or use --twin topic"));
                continue;
            }
            "rigid" => TwinSource::Rigid,
            "regression" => TwinSource::Regression,
            "topic" if set.topics.twin.is_some() => TwinSource::Topic,
            "topic" => {
                let problem = Problem::new("--twin topic: the set names no `topics.twin`");
                report.push(problem.help("use --twin rigid or --twin regression"));
                continue;
            }
            path => match twin_file(Path::new(path), cell) {
                Ok(file) => TwinSource::File(Box::new(file)),
                Err(problems) => {
                    report.append(problems);
                    continue;
                }
            },
        };
        let path = Path::new(name);
        // `explain` names every twin twin.yaml, so only the folder distinguishes them.
        let mut short = match &source {
            TwinSource::File(_) if stem(path) == "twin" => {
                path.parent().and_then(Path::file_name).map_or_else(
                    || "twin".to_owned(),
                    |name| name.to_string_lossy().into_owned(),
                )
            }
            TwinSource::File(_) => stem(path),
            _ => name.clone(),
        };
        let alike = all.iter().filter(|other| other.name == short).count();
        if alike > 0 {
            short = format!("{short}_{}", all.len() + 1);
        }
        let from_file = matches!(source, TwinSource::File(_));
        all.push(TwinChoice {
            name: short,
            path: from_file.then(|| path.to_owned()),
            source,
        });
    }
    all
}

fn twin_file(path: &Path, cell: &Cell) -> Result<TwinFile, Report> {
    if !path.is_file() {
        let known = ["rigid", "regression", "topic"];
        let title = format!("--twin: there is no file {}", path.display());
        let help = "give rigid, regression, topic, or the path of a twin.yaml".to_owned();
        let near = suggest::nearest(&path.to_string_lossy(), known);
        let help = near.map_or(help, |near| format!("did you mean `{near}`?"));
        return Err(Problem::new(title).help(help).into());
    }
    let file: Located<TwinFile> = yaml::load(path)?;
    let facts = &cell.facts;
    if let Some(robot) = &cell.model
        && let Some(title) = file.value.made_for_other(robot.name())
    {
        let help = "calibrate one for this robot: `tauscope calibrate`, or --twin regression";
        return Err(Problem::of_file(path, title).help(help).into());
    }
    (file.value)
        .resolve(&facts.joint_names, facts.effort_unit.as_str())
        .map_err(|error| Problem::of_file(path, error.to_string()))?;
    Ok(file.value)
}
