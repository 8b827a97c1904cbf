//! Evaluation request: the set file and the command-line options, with all names and paths resolved.

mod arm;
mod labelled;
mod twins;

use std::path::{Path, PathBuf};

use tauscope_archive::recordings_at;
use tauscope_detect::{DETECTORS, Entry};
use tauscope_dynamics::Model;
use tauscope_ingest::Topics;
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::files::SetFile;
use tauscope_pipeline::replay::stem;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;
use tauscope_pipeline::yaml::{self, Located, Place};
use tauscope_session::{Joints, Look, SessionError};
use tauscope_twin::TwinFile;

use crate::labels::{self, LabelsFile, Truth};
use crate::recording::{Named, Role};
use crate::registry::Facts;

/// Source of the expected effort.
#[derive(Debug, Clone)]
pub enum TwinSource {
    /// The rigid-body model of the URDF.
    Rigid,
    /// The rigid-body model with a gain and an offset per joint, fitted on the set's train recordings.
    Regression,
    /// An external twin on a topic, with a gain and an offset per joint.
    Topic,
    /// A corrected twin from a file.
    File(Box<TwinFile>),
}

/// A twin whose expected effort the evaluated detectors use.
#[derive(Debug, Clone)]
pub struct TwinChoice {
    /// Name in tables and folders.
    pub name: String,
    /// Source of the expected effort.
    pub source: TwinSource,
    /// The file it came from.
    pub path: Option<PathBuf>,
}

/// Evaluation request.
#[derive(Debug)]
pub struct Request {
    /// The set.
    pub set: SetFile,
    /// The file it came from.
    pub path: PathBuf,
    /// The arm.
    pub cell: Cell,
    /// Recordings in the order of the session: train, validation, test.
    pub recordings: Vec<Named>,
    /// Detectors to evaluate.
    pub detectors: Vec<&'static Entry>,
    /// Whether the user named the detectors; then a detector that cannot run is an error.
    pub explicit: bool,
    /// Twins with each of which the detectors are evaluated.
    pub twins: Vec<TwinChoice>,
    /// Cutoff frequencies of the low-passes on velocity and on efforts \[Hz\]; `None` for those of the twin.
    pub cutoffs_hz: [Option<f64>; 2],
    /// Number of detectors that run in parallel.
    pub jobs: usize,
    /// Remarks for the reader of the tables.
    pub notes: Vec<String>,
}

/// Command-line options in addition to the set.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Names of detectors; empty for those that suit the set, `all` for all.
    pub detectors: Vec<String>,
    /// `rigid`, `regression`, `topic`, or paths of twins; empty for the default.
    pub twins: Vec<String>,
    /// See [`Request::cutoffs_hz`].
    pub cutoffs_hz: [Option<f64>; 2],
    /// See [`Request::jobs`].
    pub jobs: usize,
}

impl Request {
    /// Topics of the recordings; `reference` includes that of the external twin.
    pub fn topics(&self, reference: bool) -> Topics {
        let topics = &self.set.topics;
        Topics {
            state: topics.state.clone(),
            command: topics.command.clone(),
            twin: topics.twin.clone().filter(|_| reference),
            tool: None,
            learn: None,
            commands: None,
        }
    }

    /// Returns the index of the joint that moves a link. Links that are fixed to each other have the same index.
    pub fn place(&self, link: &str) -> Option<usize> {
        let model: &Model = self.cell.model.as_ref()?;
        model.links()[model.link_index(link)?].joint
    }
}

/// Reads the set at `path` and resolves everything that the set and the command line name.
///
/// # Errors
/// All problems found.
pub fn load(path: &Path, options: &Options) -> Result<Request, Report> {
    let file: Located<SetFile> = yaml::load(path)?;
    let set = file.value.clone();
    let root = Place::root();
    let mut report = Report::default();
    let mut notes = Vec::new();
    let cell = arm::cell(&file, &mut notes, &mut report)?;
    let labels = labelled::find(&file, &mut notes, &mut report);
    let recordings = recordings(&file, labels.as_ref(), &mut report);
    notes.extend(labelled::doubts(labels.as_ref(), &recordings, &cell));
    if set.test.is_empty() && set.validation.is_empty() {
        let problem = file.at_key(&root, "neither `test` nor `validation` recordings");
        report.push(problem.help("name the recordings that are to be scored under `test`"));
    }
    learnt_here(&file, &mut report);
    let facts = Facts::of(&set, &recordings);
    let detectors = detectors(&options.detectors, facts, &mut report);
    let twins = twins::choices(&file, &cell, &options.twins, &mut report);
    report.into_result(Request {
        set,
        path: path.to_owned(),
        cell,
        recordings,
        detectors,
        explicit: !(options.detectors.is_empty() || options.detectors == ["all"]),
        twins,
        cutoffs_hz: options.cutoffs_hz,
        jobs: options.jobs.max(1),
        notes,
    })
}

/// The set's recordings with their labelled contacts.
fn recordings(
    file: &Located<SetFile>,
    labels: Option<&LabelsFile>,
    report: &mut Report,
) -> Vec<Named> {
    let set = &file.value;
    let mut all: Vec<Named> = Vec::new();
    for (role, paths) in [
        (Role::Train, &set.train),
        (Role::Validation, &set.validation),
        (Role::Test, &set.test),
    ] {
        let given = paths.iter().enumerate().flat_map(|(index, path)| {
            let path = file.resolve(path);
            // A path that is no data set is reported when it is opened.
            let all = recordings_at(&path).unwrap_or_else(|_| vec![path]);
            all.into_iter().map(move |path| (index, path))
        });
        for (index, path) in given {
            let place = Place::root().key(role.as_str()).index(index);
            let name = stem(&path);
            if all.iter().any(|other| other.name == name) {
                let problem = file.at(&place, format!("a second recording named `{name}`"));
                report.push(problem.help("results and labels go by the name: give each its own"));
                continue;
            }
            let contact = set.topics.contact.as_deref().filter(|_| labels.is_none());
            match open(&path, &set.topics.state, contact) {
                Ok((start_ns, flagged)) => {
                    let labelled = labels.and_then(|labels| labels.recordings.get(&name));
                    all.push(Named {
                        truth: labelled.cloned().or(flagged),
                        name,
                        path,
                        role,
                        start_ns,
                    });
                }
                Err(wrong) => report.push(file.at(&place, wrong)),
            }
        }
    }
    all
}

/// Returns the stamp of a recording's first joint state and the contacts of its contact topic.
fn open(path: &Path, state: &str, contact: Option<&str>) -> Result<(i64, Option<Truth>), String> {
    let wrong = |error: SessionError| error.to_string();
    let recording = tauscope_session::open(path).map_err(|error| wrong(error.into()))?;
    let look = Look::at(&recording, Some(state), Joints::default()).map_err(wrong)?;
    let (start_ns, start_log_ns) = look
        .start_ns(&recording)
        .map_err(wrong)?
        .ok_or_else(|| format!("{}: no joint state on `{state}`", path.display()))?;
    let truth = match contact {
        Some(topic) => labels::from_topic(&recording, topic, start_log_ns)
            .map_err(|error| wrong(error.into()))?,
        None => None,
    };
    Ok((start_ns, truth))
}

/// Rejects detector settings that the evaluation determines itself.
fn learnt_here(file: &Located<SetFile>, report: &mut Report) {
    let found = file.value.detectors.all().flat_map(|settings| {
        let keys = settings.found_by_evaluation().into_iter();
        keys.map(|key| (settings.name(), key))
    });
    for (detector, key) in found {
        let place = Place::root().key("detectors").key(detector).key(key);
        let title = format!("`{key}` of {detector}: an evaluation lets every detector learn anew");
        report.push(
            file.at_key(&place, title)
                .help(format!("leave `{key}` out")),
        );
    }
}

fn detectors(names: &[String], facts: Facts, report: &mut Report) -> Vec<&'static Entry> {
    if names.is_empty() {
        let usual = DETECTORS.iter().filter(|entry| facts.suit(entry));
        return usual.collect();
    }
    if names == ["all"] {
        return DETECTORS.iter().collect();
    }
    let mut found: Vec<&'static Entry> = Vec::new();
    for name in names {
        match DETECTORS.iter().find(|entry| entry.name == name) {
            Some(entry) if found.iter().any(|other| other.name == entry.name) => {}
            Some(entry) => found.push(entry),
            None => {
                let known = DETECTORS.iter().map(|entry| entry.name);
                let help = suggest::help(name, "the detectors are", known);
                let title = format!("--detectors: there is no detector `{name}`");
                report.push(Problem::new(title).maybe_help(help));
            }
        }
    }
    found
}
