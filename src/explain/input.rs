//! What is to be explained: from a case file, or from arguments.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::EFFECTS;
use tauscope_twin::TwinFile;

use crate::files::CaseFile;
use crate::pipeline::{Cell, CellFacts, EffortUnit};
use crate::report::{Problem, Report};
use crate::suggest;
use crate::yaml::{self, Located, Place};

use super::read;

/// What is to be explained, everything named looked up; nothing but names has been read from recordings.
#[derive(Debug)]
pub struct Request {
    /// Name of the case.
    pub case: String,
    /// The arm; without a model where the twin is a topic and no URDF was given.
    pub cell: Cell,
    /// Where the URDF lies.
    pub robot_path: Option<PathBuf>,
    /// Topic of the measured joint states.
    pub state_topic: String,
    /// Topic of somebody else's twin.
    pub twin_topic: Option<String>,
    /// A corrected twin to start from.
    pub start: Option<StartFile>,
    /// Recordings that may be fitted.
    pub fit: Vec<Named>,
    /// Recordings that nothing is fitted on.
    pub holdout: Vec<Named>,
    /// Effects that are left out of the library.
    pub without: BTreeSet<String>,
}

/// A recording and the name it goes by, which no other has.
#[derive(Debug, Clone)]
pub struct Named {
    /// The file's stem; with a number behind it where others have the same.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
}

/// A `twin.yaml` to start from.
#[derive(Debug)]
pub struct StartFile {
    /// Where it lies.
    pub path: PathBuf,
    /// What it says.
    pub file: TwinFile,
}

/// What arguments say in place of a case file.
#[derive(Debug)]
pub struct Arguments<'a> {
    /// The URDF.
    pub robot: Option<&'a Path>,
    /// Unit of the measured effort.
    pub effort_unit: EffortUnit,
    /// By joint \[N m/A\].
    pub torque_constants_nm_per_a: BTreeMap<String, f64>,
    /// A corrected twin to start from.
    pub twin: Option<&'a Path>,
    /// Topic of somebody else's twin.
    pub twin_topic: Option<&'a str>,
    /// Topic of the measured joint states.
    pub state_topic: &'a str,
    /// Recordings that may be fitted.
    pub fit: &'a [PathBuf],
    /// Recordings that nothing is fitted on.
    pub holdout: &'a [PathBuf],
}

/// The effects to leave out, which must be known.
///
/// # Errors
/// Those that are not.
pub fn without(effects: &[String]) -> Result<BTreeSet<String>, Report> {
    let mut report = Report::default();
    let known = || {
        let names = EFFECTS.iter().map(|effect| effect.name);
        names.filter(|name| *name != "unknown")
    };
    for effect in effects {
        if !known().any(|name| name == effect) {
            let help = suggest::nearest(effect, known()).map_or_else(
                || format!("the effects are {}", suggest::list(known())),
                |name| format!("did you mean `{name}`?"),
            );
            let problem = Problem::new(format!("--without: there is no effect `{effect}`"));
            report.push(problem.help(help));
        }
    }
    report.into_result(effects.iter().cloned().collect())
}

/// From a case file.
///
/// # Errors
/// Everything that is wrong with it or with the files that it names.
pub fn from_case(path: &Path, without: BTreeSet<String>) -> Result<Request, Report> {
    let file: Located<CaseFile> = yaml::load(path)?;
    let case = &file.value;
    let root = Place::root();
    let twin = case.twin.as_ref();
    let twin_topic = twin.and_then(|twin| twin.topic.clone());
    if twin.is_some_and(|twin| twin.topic.is_none() && twin.model.is_none()) {
        let problem = file.at_key(
            &root.key("twin"),
            "a twin that is neither a topic nor a model",
        );
        return Err(problem
            .help("give `topic` or `model`, or leave `twin` out")
            .into());
    }
    if case.robot.is_none() && twin_topic.is_none() {
        let problem = file.at_key(&root, "neither a `robot` nor the topic of another twin");
        return Err(problem
            .help("give `robot: <URDF>`, or `twin: {topic: <topic>}`")
            .into());
    }
    let constants = case.torque_constants_nm_per_a.clone();
    let model = twin.and_then(|twin| twin.model.as_ref());
    let assembly = Assembly {
        robot: case.robot.as_ref().map(|robot| file.resolve(robot)),
        effort_unit: case.effort_unit,
        constants,
        joint_names: case.joint_names.clone(),
        twin: model.map(|model| file.resolve(model)),
        twin_topic,
        state_topic: case.topics.state.clone(),
        fit: case.fit.iter().map(|path| file.resolve(path)).collect(),
        holdout: case.holdout.iter().map(|path| file.resolve(path)).collect(),
        problem: &|spot, title| match spot {
            Spot::Robot => file.at(&root.key("robot"), title),
            Spot::Twin => file.at(&root.key("twin").key("model"), title),
            Spot::Constants => file.at_key(&root.key("torque_constants_nm_per_a"), title),
            Spot::Constant(joint) => {
                file.at_key(&root.key("torque_constants_nm_per_a").key(joint), title)
            }
            Spot::Fit(index) => file.at(&root.key("fit").index(index), title),
            Spot::Holdout(index) => file.at(&root.key("holdout").index(index), title),
        },
    };
    assembly.request(Some(case.case.clone()), without)
}

/// From arguments.
///
/// # Errors
/// Everything that is wrong with them or with the files that they name.
pub fn from_arguments(
    arguments: &Arguments<'_>,
    without: BTreeSet<String>,
) -> Result<Request, Report> {
    if arguments.robot.is_none() && arguments.twin_topic.is_none() {
        let problem = Problem::new("neither a robot nor the topic of another twin");
        return Err(problem
            .help("give --robot URDF, or --twin-topic TOPIC")
            .into());
    }
    let constants = &arguments.torque_constants_nm_per_a;
    let assembly = Assembly {
        robot: arguments.robot.map(Path::to_owned),
        effort_unit: arguments.effort_unit,
        constants: (!constants.is_empty()).then(|| constants.clone()),
        joint_names: None,
        twin: arguments.twin.map(Path::to_owned),
        twin_topic: arguments.twin_topic.map(str::to_owned),
        state_topic: arguments.state_topic.to_owned(),
        fit: arguments.fit.to_vec(),
        holdout: arguments.holdout.to_vec(),
        problem: &|_, title| Problem::new(title),
    };
    assembly.request(None, without)
}

/// Where in the input something stands that may be wrong.
enum Spot<'a> {
    Robot,
    Twin,
    Constants,
    Constant(&'a str),
    Fit(usize),
    Holdout(usize),
}

/// The parts of a request, paths resolved, nothing looked up.
struct Assembly<'a> {
    robot: Option<PathBuf>,
    effort_unit: EffortUnit,
    constants: Option<BTreeMap<String, f64>>,
    joint_names: Option<Vec<String>>,
    twin: Option<PathBuf>,
    twin_topic: Option<String>,
    state_topic: String,
    fit: Vec<PathBuf>,
    holdout: Vec<PathBuf>,
    problem: &'a dyn Fn(Spot<'_>, String) -> Problem,
}

impl Assembly<'_> {
    fn request(self, case: Option<String>, without: BTreeSet<String>) -> Result<Request, Report> {
        let mut report = Report::default();
        let (fit, holdout) = self.recordings(&mut report);
        let robot = self.robot(&mut report);
        let start = self.start(&mut report);
        report.into_result(())?;

        let mut report = Report::default();
        let (urdf, model) = robot.unzip();
        let joint_names = self.joint_names(model.as_ref(), &fit)?;
        let constants = self.torque_constants(&joint_names, &mut report);
        if let Some(start) = &start {
            self.twin_fits(&start.file, model.as_ref(), &joint_names, &mut report);
        }
        let name = case.unwrap_or_else(|| {
            let of_robot = model.as_ref().map(|model| model.name().to_owned());
            of_robot
                .filter(|name| !name.is_empty())
                .unwrap_or_else(|| "case".to_owned())
        });
        let facts = CellFacts {
            name: name.clone(),
            urdf,
            joint_names,
            effort_unit: self.effort_unit,
            torque_constants_nm_per_a: constants,
            tool: None,
        };
        report.into_result(Request {
            case: name,
            cell: Cell { facts, model },
            robot_path: self.robot,
            state_topic: self.state_topic,
            twin_topic: self.twin_topic,
            start,
            fit,
            holdout,
            without,
        })
    }

    /// The recordings, each once and by a name of its own.
    fn recordings(&self, report: &mut Report) -> (Vec<Named>, Vec<Named>) {
        let mut seen = BTreeMap::new();
        let mut names = BTreeSet::new();
        let mut named = |paths: &[PathBuf], spot: fn(usize) -> Spot<'static>| {
            let mut all = Vec::new();
            for (index, path) in paths.iter().enumerate() {
                let Ok(canonical) = path.canonicalize() else {
                    let title = format!("there is no recording {}", path.display());
                    report.push((self.problem)(spot(index), title));
                    continue;
                };
                if seen.insert(canonical, ()).is_some() {
                    let title = format!(
                        "{} is named twice: a recording is fitted or held out, and once",
                        path.display()
                    );
                    report.push((self.problem)(spot(index), title));
                    continue;
                }
                let stem = path
                    .file_stem()
                    .unwrap_or(path.as_os_str())
                    .to_string_lossy();
                let mut name = stem.clone().into_owned();
                let mut number = 2;
                while !names.insert(name.clone()) {
                    name = format!("{stem}_{number}");
                    number += 1;
                }
                let path = path.clone();
                all.push(Named { name, path });
            }
            all
        };
        let fit = named(&self.fit, Spot::Fit);
        let holdout = named(&self.holdout, Spot::Holdout);
        (fit, holdout)
    }

    fn robot(&self, report: &mut Report) -> Option<(String, Model)> {
        let path = self.robot.as_ref()?;
        let read = std::fs::read_to_string(path)
            .map_err(|error| format!("cannot read the URDF {}: {error}", path.display()))
            .and_then(|text| {
                let model = Model::from_urdf(&text)
                    .map_err(|error| format!("cannot use the URDF {}: {error}", path.display()))?;
                Ok((text, model))
            });
        match read {
            Ok(robot) => Some(robot),
            Err(title) => {
                report.push((self.problem)(Spot::Robot, title));
                None
            }
        }
    }

    fn start(&self, report: &mut Report) -> Option<StartFile> {
        let path = self.twin.as_ref()?;
        if !path.exists() {
            let title = format!("there is no twin {}", path.display());
            report.push((self.problem)(Spot::Twin, title));
            return None;
        }
        match yaml::load::<TwinFile>(path) {
            Ok(file) => Some(StartFile {
                path: path.clone(),
                file: file.value,
            }),
            Err(problems) => {
                report.append(problems);
                None
            }
        }
    }

    /// Those of the robot, of the case, or of the first recording's first message, whose order they keep.
    fn joint_names(&self, model: Option<&Model>, fit: &[Named]) -> Result<Vec<String>, Report> {
        if let Some(model) = model {
            return Ok(model.joint_names().map(str::to_owned).collect());
        }
        if let Some(names) = &self.joint_names {
            return Ok(names.clone());
        }
        let Some(first) = fit.first() else {
            return Err(Problem::new("there is no recording to fit").into());
        };
        read::first_joint_names(&first.path, &self.state_topic)
    }

    fn torque_constants(&self, joints: &[String], report: &mut Report) -> Option<Vec<f64>> {
        let constants = self.constants.as_ref()?;
        let problem = self.problem;
        if self.effort_unit == EffortUnit::Nm {
            let title = "torque constants, but the effort is in Nm".to_owned();
            let help = "say that the effort unit is A, or leave them out";
            report.push(problem(Spot::Constants, title).help(help));
        }
        for (joint, constant) in constants {
            if !joints.contains(joint) {
                let help =
                    suggest::help(joint, "the joints are", joints.iter().map(String::as_str));
                let title = format!("the robot has no joint `{joint}`");
                report.push(problem(Spot::Constant(joint), title).maybe_help(help));
            }
            if !(constant.is_finite() && *constant > 0.0) {
                let title = format!("a torque constant is more than 0, found {constant}");
                report.push(problem(Spot::Constant(joint), title));
            }
        }
        let is_missing = |joint: &&String| !constants.contains_key(*joint);
        let missing: Vec<&str> = joints
            .iter()
            .filter(is_missing)
            .map(String::as_str)
            .collect();
        if !missing.is_empty() {
            let title = format!("no torque constant for {}", suggest::list(missing));
            let help = "torque constants are wanted for all joints or for none";
            report.push(problem(Spot::Constants, title).help(help));
        }
        joints
            .iter()
            .map(|joint| constants.get(joint).copied())
            .collect()
    }

    /// A twin to start from must be one of this robot, in this unit.
    fn twin_fits(
        &self,
        file: &TwinFile,
        model: Option<&Model>,
        joints: &[String],
        report: &mut Report,
    ) {
        let made_for = &file.robot.name;
        if let Some(model) = model
            && !made_for.is_empty()
            && made_for != model.name()
        {
            let name = model.name();
            let title = format!("this twin was made for the robot `{made_for}`, not for `{name}`");
            report.push((self.problem)(Spot::Twin, title));
        }
        if let Err(error) = file.resolve(joints, self.effort_unit.as_str()) {
            report.push((self.problem)(Spot::Twin, error.to_string()));
            return;
        }
        let stand_in;
        let model = if let Some(model) = model {
            model
        } else {
            stand_in = Model::massless(joints);
            &stand_in
        };
        for term in &file.terms {
            if let Err(error) = term.build(model) {
                report.push((self.problem)(Spot::Twin, error.to_string()));
            }
        }
    }
}
