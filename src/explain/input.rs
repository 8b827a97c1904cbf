//! Requests to explain recordings, from a case file or from arguments.

mod assembly;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use tauscope_dynamics::terms::{EFFECTS, UNKNOWN};
use tauscope_pipeline::cell::{Cell, EffortUnit};
use tauscope_pipeline::files::CaseFile;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;
use tauscope_pipeline::yaml::{self, Located, Place};
use tauscope_twin::TwinFile;

use self::assembly::{Assembly, Spot};

/// A request to explain recordings, with all names resolved. Of the recordings, only names of topics and joints have
/// been read.
#[derive(Debug)]
pub struct Request {
    /// Name of the case.
    pub case: String,
    /// The arm; without a model if the twin is a topic and no URDF is given.
    pub cell: Cell,
    /// Path of the URDF.
    pub robot_path: Option<PathBuf>,
    /// Topic of the measured joint states.
    pub state_topic: String,
    /// `state_topic`, or `None` if the first recording is a table.
    pub topic_of_messages: Option<String>,
    /// Topic of an external twin.
    pub twin_topic: Option<String>,
    /// Topic of the commanded positions.
    pub command_topic: Option<String>,
    /// A corrected twin to start from.
    pub start: Option<StartFile>,
    /// Recordings to fit.
    pub fit: Vec<Named>,
    /// Recordings that are held out from the fit.
    pub holdout: Vec<Named>,
    /// Effects that are excluded from the library.
    pub without: BTreeSet<String>,
    /// Note on a change of the input, for the report.
    pub note: Option<String>,
    /// Longest part of a recording that is read, from its start \[s\].
    pub longest_s: f64,
}

impl Request {
    /// Creates the request for recordings of a cell, with its twin if it has one.
    ///
    /// # Errors
    /// Everything that is wrong with the files.
    pub fn of_cell(
        cell: Cell,
        state_topic: &str,
        twin: Option<PathBuf>,
        recordings: &[PathBuf],
    ) -> Result<Self, Report> {
        let assembly = Assembly {
            robot: None,
            effort_unit: cell.facts.effort_unit,
            constants: None,
            joint_names: Some(cell.facts.joint_names.clone()),
            model: cell.model.clone(),
            twin,
            twin_topic: None,
            state_topic: Some(state_topic.to_owned()),
            command_topic: None,
            fit: recordings.to_vec(),
            holdout: Vec::new(),
            problem: &|_, title| Problem::new(title),
        };
        let name = cell.facts.name.clone();
        let request = assembly.request(Some(name), BTreeSet::new())?;
        Ok(Self { cell, ..request })
    }
}

/// A recording and its unique name.
#[derive(Debug, Clone)]
pub struct Named {
    /// Stem of the file, with a number appended if another recording has the same.
    pub name: String,
    /// Path of the recording.
    pub path: PathBuf,
}

/// A `twin.yaml` to start from.
#[derive(Debug)]
pub struct StartFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Content of the file.
    pub file: TwinFile,
}

/// Arguments in place of a case file.
#[derive(Debug)]
pub struct Arguments<'a> {
    /// The URDF.
    pub robot: Option<&'a Path>,
    /// Unit of the measured effort.
    pub effort_unit: EffortUnit,
    /// Torque constants by joint \[N m/A\].
    pub torque_constants_nm_per_a: BTreeMap<String, f64>,
    /// A corrected twin to start from.
    pub twin: Option<&'a Path>,
    /// Topic of an external twin.
    pub twin_topic: Option<&'a str>,
    /// Topic of the measured joint states; by default the one with efforts of most joints.
    pub state_topic: Option<&'a str>,
    /// Topic of the commanded positions.
    pub command_topic: Option<&'a str>,
    /// Recordings to fit.
    pub fit: &'a [PathBuf],
    /// Recordings that are held out from the fit.
    pub holdout: &'a [PathBuf],
}

/// Checks the names of effects and recording faults to exclude.
///
/// # Errors
/// The names that are unknown.
pub fn without(effects: &[String]) -> Result<BTreeSet<String>, Report> {
    let mut report = Report::default();
    let known = || {
        let named = EFFECTS.iter().filter(|effect| ***effect != UNKNOWN);
        let named = named.map(|effect| effect.name);
        named.chain(tauscope_explain::report::slip_words::recording_faults())
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

/// Creates a request from a case file.
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
        model: None,
        twin: model.map(|model| file.resolve(model)),
        twin_topic,
        state_topic: Some(case.topics.state.clone()),
        command_topic: case.topics.command.clone(),
        fit: case.fit.iter().map(|path| file.resolve(path)).collect(),
        holdout: case.holdout.iter().map(|path| file.resolve(path)).collect(),
        problem: &|spot, title| match spot {
            Spot::Robot => file.at(&root.key("robot"), title),
            Spot::Twin => file.at(&root.key("twin").key("model"), title),
            Spot::Constants(spot) => spot.problem(&file, &root, title),
            Spot::Fit(index) => file.at(&root.key("fit").index(index), title),
            Spot::Holdout(index) => file.at(&root.key("holdout").index(index), title),
        },
    };
    assembly.request(Some(case.case.clone()), without)
}

/// Creates a request from arguments.
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
        model: None,
        twin: arguments.twin.map(Path::to_owned),
        twin_topic: arguments.twin_topic.map(str::to_owned),
        state_topic: arguments.state_topic.map(str::to_owned),
        command_topic: arguments.command_topic.map(str::to_owned),
        fit: arguments.fit.to_vec(),
        holdout: arguments.holdout.to_vec(),
        problem: &|_, title| Problem::new(title),
    };
    assembly.request(None, without)
}
