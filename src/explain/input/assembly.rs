//! Assembly of a request from its parts, with all errors in them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::Metadata;
use std::path::{Path, PathBuf};

use tauscope_archive::{is_there, name_of, recordings_at};
use tauscope_dynamics::Model;
use tauscope_pipeline::cell::{Cell, CellFacts, ConstantSpot, EffortUnit, Fixed, torque_constants};
use tauscope_pipeline::provenance::sha256_of_file;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::urdf::Robot;
use tauscope_pipeline::{urdf, yaml};
use tauscope_session::{Joints, Look, SessionError, by_reason};
use tauscope_twin::TwinFile;

use super::{Named, Request, StartFile};

/// Part of the input to which an error refers.
pub enum Spot<'a> {
    /// The path of the robot.
    Robot,
    /// The path of the twin to start from.
    Twin,
    /// The torque constants.
    Constants(ConstantSpot<'a>),
    /// A recording to fit.
    Fit(usize),
    /// A recording to hold out.
    Holdout(usize),
}

/// The parts of a request: paths are resolved, files are not opened.
pub struct Assembly<'a> {
    /// The URDF.
    pub robot: Option<PathBuf>,
    /// Unit of the measured effort.
    pub effort_unit: EffortUnit,
    /// Torque constant by joint \[N m/A\].
    pub constants: Option<BTreeMap<String, f64>>,
    /// The joints, if there is no robot that has them.
    pub joint_names: Option<Vec<String>>,
    /// The robot, if it has been read already.
    pub model: Option<Model>,
    /// The corrected twin to start from.
    pub twin: Option<PathBuf>,
    /// Topic of an external twin.
    pub twin_topic: Option<String>,
    /// Topic of the measured joint states; by default the one with efforts of most joints.
    pub state_topic: Option<String>,
    /// Topic of the commanded positions.
    pub command_topic: Option<String>,
    /// Recordings to fit.
    pub fit: Vec<PathBuf>,
    /// Recordings that are held out from the fit.
    pub holdout: Vec<PathBuf>,
    /// Returns the problem with a title at a spot.
    pub problem: &'a dyn Fn(Spot<'_>, String) -> Problem,
}

impl Assembly<'_> {
    /// Opens the files and creates the request.
    ///
    /// # Errors
    /// All errors in the parts.
    pub fn request(
        self,
        case: Option<String>,
        without: BTreeSet<String>,
    ) -> Result<Request, Report> {
        let mut report = Report::default();
        let (fit, holdout) = self.recordings(&mut report);
        let robot = self.robot(&mut report);
        let start = self.start(&mut report);
        report.into_result(())?;

        let mut report = Report::default();
        let (robot, findings) = match robot {
            Some(robot) => (Some((robot.urdf, robot.model)), robot.findings),
            None => (None, Vec::new()),
        };
        let known = robot
            .as_ref()
            .map(|(_, model)| model)
            .or(self.model.as_ref());
        let known: Vec<String> = match (known, &self.joint_names) {
            (Some(model), _) => model.joint_names().map(str::to_owned).collect(),
            (None, Some(names)) => names.clone(),
            (None, None) => Vec::new(),
        };
        let look = self.look(&known, &fit)?;
        let (robot, fixed) = as_recorded(robot, &look.recorded());
        let (urdf, model) = robot.unzip();
        let joint_names = match &model {
            Some(model) => model.joint_names().map(str::to_owned).collect(),
            None if known.is_empty() => look.recorded(),
            None => known,
        };
        let constants = self.torque_constants(&joint_names, &mut report);
        if let Some(start) = &start {
            let model = model.as_ref().or(self.model.as_ref());
            self.twin_fits(&start.file, model, &joint_names, &mut report);
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
            impedance: None,
        };
        report.into_result(Request {
            case: name,
            cell: Cell {
                facts,
                model,
                findings,
            },
            robot_path: self.robot,
            topic_of_messages: look.topic_of_messages().map(str::to_owned),
            state_topic: look.topic,
            twin_topic: self.twin_topic,
            command_topic: self.command_topic,
            start,
            fit,
            holdout,
            without,
            note: fixed,
            longest_s: f64::INFINITY,
        })
    }

    /// Returns the recordings, each once and with a unique name.
    fn recordings(&self, report: &mut Report) -> (Vec<Named>, Vec<Named>) {
        let mut seen = BTreeSet::new();
        let mut names = BTreeSet::new();
        let mut all_paths: Vec<PathBuf> = Vec::new();
        let mut named = |paths: &[PathBuf], spot: fn(usize) -> Spot<'static>| {
            let mut all = Vec::new();
            let given = paths.iter().enumerate();
            let given = given.flat_map(|(index, path)| match recordings_at(path) {
                Ok(recordings) => recordings.into_iter().map(|path| (index, path)).collect(),
                // The error is reported when the recording is opened.
                Err(_) => vec![(index, path.clone())],
            });
            for (index, path) in given {
                // An episode of a data set has no file of its own.
                let absolute = || is_there(&path).then(|| std::path::absolute(&path).ok());
                let canonical = path.canonicalize().ok().or_else(|| absolute().flatten());
                let Some(canonical) = canonical else {
                    let title = format!("there is no recording {}", path.display());
                    report.push((self.problem)(spot(index), title));
                    continue;
                };
                if !seen.insert(canonical) {
                    let title = format!(
                        "{} is named twice: a recording is fitted or held out, and once",
                        path.display()
                    );
                    report.push((self.problem)(spot(index), title));
                    continue;
                }
                if let Some(same) = same_bytes(&path, &all_paths) {
                    let title = format!(
                        "{} holds the same bytes as {}: a copy shows nothing that the other does not",
                        path.display(),
                        same.display()
                    );
                    report.push((self.problem)(spot(index), title));
                    continue;
                }
                all_paths.push(path.clone());
                let stem = name_of(&path);
                let mut name = stem.clone();
                let mut number = 2;
                while !names.insert(name.clone()) {
                    name = format!("{stem}_{number}");
                    number += 1;
                }
                all.push(Named { name, path });
            }
            all
        };
        let fit = named(&self.fit, Spot::Fit);
        let holdout = named(&self.holdout, Spot::Holdout);
        (fit, holdout)
    }

    fn robot(&self, report: &mut Report) -> Option<Robot> {
        let path = self.robot.as_ref()?;
        match urdf::read(path) {
            Ok(robot) => Some(robot),
            Err(error) => {
                let title = format!("{}: {error}", path.display());
                report.push((self.problem)(Spot::Robot, title));
                None
            }
        }
    }

    /// Reads the topic and the joints of the first recording to fit.
    fn look(&self, joints: &[String], fit: &[Named]) -> Result<Look, Report> {
        let Some(first) = fit.first() else {
            return Err(Problem::new("there is no recording to fit").into());
        };
        let wanted = Joints {
            names: joints,
            effort_limits: &[],
        };
        let look = |named: &Named| -> Result<Look, SessionError> {
            let recording = tauscope_session::open(&named.path)?;
            Look::at(&recording, self.state_topic.as_deref(), wanted)
        };
        look(first).map_err(|error| {
            // The others may have the same fault.
            let others = fit[1..].iter().filter_map(|named| look(named).err());
            let errors: Vec<SessionError> = std::iter::once(error).chain(others).collect();
            let mut report = Report::default();
            for reason in by_reason(&errors, fit.len()) {
                report.push((self.problem)(Spot::Fit(0), reason));
            }
            report
        })
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

    fn torque_constants(&self, joints: &[String], report: &mut Report) -> Option<Vec<f64>> {
        let constants = self.constants.as_ref()?;
        let problem = |spot: ConstantSpot<'_>, title| (self.problem)(Spot::Constants(spot), title);
        torque_constants(constants, joints, self.effort_unit, &problem, report)
    }

    /// Checks that the twin to start from is one of this robot, in this unit.
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
        let model = match model {
            Some(model) if self.twin_topic.is_none() => model,
            // Of an external twin only the joints are known.
            _ => {
                stand_in = Model::massless(joints);
                &stand_in
            }
        };
        for term in &file.terms {
            if let Err(error) = term.build(model) {
                report.push((self.problem)(Spot::Twin, error.to_string()));
            }
        }
    }
}

/// Returns the robot without the joints that no recording contains, and a note on this.
fn as_recorded(
    robot: Option<(String, Model)>,
    recorded: &[String],
) -> (Option<(String, Model)>, Option<String>) {
    let fixed = robot
        .as_ref()
        .and_then(|(urdf, model)| Fixed::unrecorded(urdf, model, recorded));
    match fixed {
        Some(fixed) => {
            let note = fixed.note();
            (Some((fixed.urdf, fixed.model)), Some(note))
        }
        None => (robot, None),
    }
}

/// Returns the file among `others` that is a copy of `path`. A file that cannot be read is reported when it is
/// opened.
fn same_bytes<'a>(path: &Path, others: &'a [PathBuf]) -> Option<&'a PathBuf> {
    let size = |path: &Path| {
        path.metadata()
            .ok()
            .filter(Metadata::is_file)
            .map(|it| it.len())
    };
    let own = size(path)?;
    let mut alike = others.iter().filter(|other| size(other) == Some(own));
    let hash = |path: &Path| sha256_of_file(path).ok();
    alike.find(|other| hash(other).is_some_and(|theirs| Some(theirs) == hash(path)))
}
