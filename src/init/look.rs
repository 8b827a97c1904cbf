//! What the recordings are: which topic holds the joint states, whose joints they are, in which unit the effort is.

mod slopes;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use tauscope_archive::ros::JointStateType;
use tauscope_archive::{Info, Recording};
use tauscope_dynamics::effort_scale::EffortScale;
use tauscope_dynamics::{Joint, Model};
use tauscope_ingest::Topics;
use tauscope_pipeline::calibrate::Job;
use tauscope_pipeline::cell::{Cell, ConstantSpot, EffortUnit, first_joint_names};
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::suggest;

use self::slopes::{Slopes, signs, telling, turned_in_some};
use crate::exit::Failure;

/// A joint's torque constant is below this \[N m/A\].
/// Physical: 1 N m/A of a large motor behind a gear of 300.
const MOST_NM_PER_A: f64 = 300.0;

/// The arm and its recordings, before anything is fitted.
#[derive(Debug)]
pub struct Looked {
    /// The arm, with the unit that its effort is in.
    pub cell: Cell,
    /// Where the joint states are.
    pub state_topic: String,
    /// What was found, a sentence each.
    pub sentences: Vec<String>,
    /// By recording, how far its joints move in all \[rad or m\].
    travel: Vec<(PathBuf, f64)>,
}

impl Looked {
    /// The recordings to fit, and those that nothing is fitted on: of every four or less one, those in the middle by how
    /// far the joints move, so that neither a standing arm nor the liveliest motion is kept from the fit.
    pub fn parted(&self) -> (Vec<PathBuf>, Vec<PathBuf>) {
        const FOR_ONE_HELD_OUT: usize = 4;
        let mut sorted: Vec<_> = self.travel.iter().collect();
        sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
        let count = sorted.len();
        let held = if count < 2 {
            0
        } else {
            count.div_ceil(FOR_ONE_HELD_OUT).min(count / 2)
        };
        let from = (count - held) / 2;
        let is_held = |path: &&PathBuf| sorted[from..from + held].iter().any(|one| one.0 == **path);
        let all = || self.travel.iter().map(|one| &one.0);
        let fit = all().filter(|path| !is_held(path)).cloned().collect();
        (fit, all().filter(is_held).cloned().collect())
    }
}

/// What is told on the command line.
#[derive(Debug)]
pub struct Told<'a> {
    /// The URDF.
    pub robot: &'a Path,
    /// The recordings.
    pub recordings: &'a [PathBuf],
    /// The topic of the joint states, where it is told.
    pub state_topic: Option<&'a str>,
    /// The unit of the effort, where it is told.
    pub effort_unit: Option<EffortUnit>,
}

impl Told<'_> {
    /// Looks at the recordings.
    ///
    /// # Errors
    /// If they are not those of the robot, or nobody can tell the unit.
    pub fn look(&self) -> Result<Looked, Failure> {
        let [_, _, ..] = self.recordings else {
            let problem = Problem::new(
                "one recording is too few: one is fitted and another shows whether the fit holds",
            );
            let help = "record the arm at least twice, better five times, with different motions and nothing touching it";
            return Err(Failure::Rejected(problem.help(help).into()));
        };
        let cell = self.cell()?;
        let state_topic = match self.state_topic {
            Some(topic) => topic.to_owned(),
            None => self.find_topic(&cell)?,
        };
        let recorded = first_joint_names(&self.recordings[0], &state_topic);
        let (mut cell, fixed) = cell.without_unrecorded(&recorded.unwrap_or_default());
        self.check_joints(&cell, &state_topic)?;
        let mut sentences = vec![format!(
            "{} joints of {} on {state_topic} in {} recording(s).",
            cell.facts.joint_names.len(),
            cell.facts.name,
            self.recordings.len()
        )];
        sentences.extend(fixed.map(|note| format!("{note}.")));
        sentences.extend(coupled(&cell));
        sentences.extend(unlimited(&cell));
        let mut travel = Vec::new();
        for path in self.recordings {
            let (far, remarks) = oddities(path, &state_topic)?;
            travel.push((path.clone(), far));
            let name = path.display();
            sentences.extend(
                remarks
                    .into_iter()
                    .map(|remark| format!("{name}: {remark}.")),
            );
        }
        let slopes = self.slopes(&cell, &state_topic)?;
        sentences.extend(slopes.notes.iter().map(|note| format!("{note}.")));
        let (unit, sentence) = self.unit(&EffortScale::of(&slopes.all))?;
        sentences.push(sentence);
        sentences.extend(signs(&slopes.all));
        cell.facts.effort_unit = unit;
        Ok(Looked {
            cell,
            state_topic,
            sentences,
            travel,
        })
    }

    /// The robot. Its effort is taken for a current until the unit is known: that needs no torque constants.
    fn cell(&self) -> Result<Cell, Report> {
        let problem = |_: ConstantSpot<'_>, title| Problem::new(title);
        Cell::from_urdf(self.robot, EffortUnit::A, &BTreeMap::new(), &problem)
    }

    /// The topic of joint states with positions whose messages name most of the robot's joints.
    fn find_topic(&self, cell: &Cell) -> Result<String, Report> {
        let first = &self.recordings[0];
        let recording = Recording::open(first).map_err(|error| Problem::new(error.to_string()))?;
        let topics = recording.topics().iter();
        let topics = topics.filter(|topic| topic.joint_state_type().is_some());
        let named = topics.filter_map(|topic| {
            let names = first_joint_names(first, &topic.name).ok()?;
            let wanted = &cell.facts.joint_names;
            let known = wanted.iter().filter(|name| names.contains(name)).count();
            let (position, effort) = given(&recording, &topic.name);
            let name = Reverse(topic.name.clone());
            Some((position, effort, known, topic.message_count, name))
        });
        match named.max() {
            Some((true, .., name)) => Ok(name.0),
            Some((false, .., name)) => {
                let title = format!(
                    "{}: no joint states with positions; {} has none",
                    first.display(),
                    name.0
                );
                let help = "record the topic that holds the joints' positions and efforts";
                Err(Problem::new(title).help(help).into())
            }
            None => {
                let title = format!("{} holds no {}", first.display(), JointStateType::names());
                let topics = recording.topics().iter().map(|topic| topic.name.as_str());
                let help = format!("its topics are {}", suggest::list(topics));
                Err(Problem::new(title).help(help).into())
            }
        }
    }

    /// Every recording must have every joint of the robot.
    fn check_joints(&self, cell: &Cell, topic: &str) -> Result<(), Report> {
        let mut report = Report::default();
        let mut said = BTreeSet::new();
        for recording in self.recordings {
            let comparable = Recording::open_comparable(recording, &cell.facts.joint_names);
            if let Err(error) = comparable {
                let title = error.to_string();
                // What a data set lacks, all of its episodes lack.
                if said.insert(title.clone()) {
                    report.push(Problem::new(title));
                }
                continue;
            }
            let names = match first_joint_names(recording, topic) {
                Ok(names) => names,
                Err(problems) => {
                    report.append(problems);
                    continue;
                }
            };
            let joints = cell.facts.joint_names.iter();
            let missing: Vec<&str> = joints
                .filter(|joint| !names.contains(joint))
                .map(String::as_str)
                .collect();
            if missing.is_empty() {
                continue;
            }
            let title = format!(
                "{}: {topic} does not name {} of the robot {}",
                recording.display(),
                suggest::some(&missing),
                cell.facts.name
            );
            let recorded: Vec<&str> = names.iter().map(String::as_str).collect();
            let help = format!(
                "it names {}; give the URDF of the arm that was recorded, or --state-topic",
                suggest::some(&recorded)
            );
            report.push(Problem::new(title).help(help));
        }
        report.into_result(())
    }

    /// The slopes of measured over expected effort, and what is odd in the recordings.
    fn slopes(&self, cell: &Cell, state_topic: &str) -> Result<Slopes, Failure> {
        let topics = Topics {
            state: state_topic.to_owned(),
            command: None,
            twin: None,
            tool: None,
            learn: None,
            commands: None,
        };
        let twin = tauscope_twin::Config::default();
        let fit = |recordings: &[PathBuf]| {
            let job = Job {
                cell,
                topics: &topics,
                twin: &twin,
                fit: recordings,
                validation: &[],
            };
            job.fit(&|_, _| true, &|_, _| {})
        };
        // Signs first: a joint that is turned in some recordings only has no slope over all of them.
        let each = self.recordings.iter().filter_map(|recording| {
            // What is wrong with one that cannot be fitted is found with all of them.
            let fitted = fit(std::slice::from_ref(recording)).ok()?;
            Some((recording.as_path(), telling(&fitted.file)))
        });
        if let Some(problem) = turned_in_some(&each.collect::<Vec<_>>()) {
            return Err(Failure::Rejected(problem.into()));
        }
        let fitted = fit(self.recordings);
        let fitted = fitted.map_err(|error| Failure::rejected(error.to_string()))?;
        Ok(Slopes {
            all: telling(&fitted.file),
            notes: fitted.notes,
        })
    }

    /// The unit and how it is known.
    fn unit(&self, scale: &EffortScale) -> Result<(EffortUnit, String), Failure> {
        if let Some(unit) = self.effort_unit {
            let fault = match unit {
                EffortUnit::Nm => scale.fault_in_nm(),
                EffortUnit::A => scale.fault_in_a(),
            };
            if let Some(fault) = fault {
                return Err(Failure::rejected(fault.to_string()));
            }
            return Ok((unit, format!("Effort is in {}, as told.", words(unit))));
        }
        match scale {
            EffortScale::Torque { slope, sure: true } => {
                let sentence = format!(
                    "Effort is in N m: the joints that bear weight measure {slope:.2} times what the robot's weight requires."
                );
                Ok((EffortUnit::Nm, sentence))
            }
            EffortScale::Current { nm_per_unit, .. } if *nm_per_unit > MOST_NM_PER_A => {
                let problem = Problem::new(format!(
                    "the unit of the effort cannot be told: the robot's weight requires {nm_per_unit:.0} N m for each unit, \
                     more than any motor gives for an ampere"
                ));
                let help = "the masses of a URDF are in kg, not in g; efforts are in N m or A, not in kN m. Or give --effort-unit";
                Err(Failure::Rejected(problem.help(help).into()))
            }
            EffortScale::Current {
                nm_per_unit,
                joints,
            } => {
                let sentence = format!(
                    "Effort is in A, motor current: {joints} joint(s) that bear weight measure {:.3} per N m that the \
                     robot's weight requires, which is a torque constant of {nm_per_unit:.1} N m/A. If that is \
                     wrong, give --effort-unit Nm.",
                    1.0 / nm_per_unit
                );
                Ok((EffortUnit::A, sentence))
            }
            other => Err(Failure::Rejected(undecided(other).into())),
        }
    }
}

/// A sentence for each joint that follows another.
fn coupled(cell: &Cell) -> Vec<String> {
    let model = cell.model.iter();
    let sentences = model.flat_map(|model| {
        model.followers().iter().map(|follower| {
            let (joint, leader) = (&follower.name, &model.joints()[follower.joint].name);
            format!("Joint {joint} follows {leader}: what it carries is effort of {leader}, and its own effort is not read.")
        })
    });
    sentences.collect()
}

/// A sentence for each joint whose limits count as none.
fn unlimited(cell: &Cell) -> Vec<String> {
    let joints = cell.model.iter().flat_map(Model::joints);
    let remarks = joints.filter_map(Joint::remark);
    remarks
        .map(|remark| format!("{}.", remark.replacen("joint", "Joint", 1)))
        .collect()
}

/// How far the joints move in a recording, and what is odd about its messages.
fn oddities(path: &Path, topic: &str) -> Result<(f64, Vec<String>), Report> {
    let failed =
        |error: tauscope_archive::ArchiveError| Report::from(Problem::new(error.to_string()));
    let info = Info::read(&Recording::open(path).map_err(failed)?).map_err(failed)?;
    let mut topics = info.topics.into_iter();
    let joints = topics
        .find(|info| info.topic.name == topic)
        .and_then(|info| info.joints);
    let joints = joints.unwrap_or_default();
    Ok((
        joints.joints.iter().map(|joint| joint.travel).sum(),
        joints.row_remarks(),
    ))
}

/// Why the recordings do not tell the unit, and what to do.
fn undecided(scale: &EffortScale) -> Problem {
    let give = "give --effort-unit Nm or --effort-unit A";
    match scale {
        EffortScale::Torque { slope, .. } => Problem::new(format!(
            "the unit of the effort is in doubt: the joints that bear weight measure {slope:.2} times what the robot's \
             weight requires"
        ))
        .help(format!(
            "a payload, or a URDF with other masses, would do that to N m; {give}"
        )),
        EffortScale::TooLarge { .. } | EffortScale::Turned { .. } => {
            let fault = scale.fault_in_nm();
            Problem::new(fault.map_or_else(String::new, |fault| fault.to_string()))
        }
        EffortScale::Untold | EffortScale::Current { .. } => {
            Problem::new("the unit of the effort cannot be told: no joint bears weight in these recordings").help(format!(
                "{give}, or add a recording in which the arm moves through poses that its weight loads"
            ))
        }
    }
}

/// Whether the first message on a topic has positions, and efforts.
fn given(recording: &Recording, topic: &str) -> (bool, bool) {
    let states = recording.joint_states(topic).ok();
    let first = states.and_then(|mut states| {
        states.next_state()?.ok().map(|state| {
            let message = &state.message;
            (!message.position.is_empty(), !message.effort.is_empty())
        })
    });
    first.unwrap_or_default()
}

/// The unit in words.
pub fn words(unit: EffortUnit) -> &'static str {
    match unit {
        EffortUnit::Nm => "N m",
        EffortUnit::A => "A",
    }
}
