//! The recordings before anything is fitted: read as by `explain`, split into those to fit and those held out.

use std::path::{Path, PathBuf};

use tauscope_dynamics::effort_scale::{EffortScale, ScaleFault};
use tauscope_dynamics::{Joint, Model};
use tauscope_explain::{Input, Recording};
use tauscope_ingest::Topics;
use tauscope_pipeline::calibrate::Job;
use tauscope_pipeline::cell::{Cell, EffortUnit};
use tauscope_pipeline::report::{Problem, Report};
use tauscope_session::{Effect, by_recording};
use tauscope_twin::telling_slopes_of;

use crate::exit::Failure;
use crate::explain::{self, Arguments, Kept, Named, Request};

/// Largest torque constant of a joint \[N m/A\].
/// Physical: 1 N m/A of a large motor behind a gear of 300.
const MOST_NM_PER_A: f64 = 300.0;

/// The arm and its recordings, before anything is fitted.
#[derive(Debug)]
pub struct Looked {
    /// Request to `explain`, with the unit of the effort.
    pub request: Request,
    /// Input of `explain`.
    pub input: Input,
    /// Facts about the input that are needed after the engine has taken it.
    pub kept: Kept,
    /// Findings about the robot, a sentence each.
    pub of_robot: Vec<String>,
    /// Findings about the recordings, a sentence each.
    pub of_recordings: Vec<String>,
    /// Why a gain and an offset per joint cannot correct the twin, if they cannot.
    pub no_line: Option<ScaleFault>,
}

/// Arguments of the command line.
#[derive(Debug)]
pub struct Told<'a> {
    /// The URDF.
    pub robot: &'a Path,
    /// The recordings.
    pub recordings: &'a [PathBuf],
    /// The topic of the joint states, if given.
    pub state_topic: Option<&'a str>,
    /// The unit of the effort, if given.
    pub effort_unit: Option<EffortUnit>,
    /// Effects and faults of recordings that are excluded from the explanation.
    pub without: &'a std::collections::BTreeSet<String>,
}

impl Told<'_> {
    /// Reads the recordings, holds some of them out and chooses the unit that the explanation begins with.
    ///
    /// # Errors
    /// If they are not recordings of the robot, or one of them has a fault that makes anything learnt from it wrong.
    pub fn look(&self, progress: &dyn Fn(f64, &str)) -> Result<Looked, Failure> {
        let [_, _, ..] = self.recordings else {
            let problem = Problem::new(
                "one recording is too few: one is fitted and another shows whether the fit holds",
            );
            let help = "record the arm at least twice, better five times, with different motions and nothing touching it";
            return Err(Failure::Rejected(problem.help(help).into()));
        };
        let mut request = self.request()?;
        let mut input = explain::read(&request, progress)?;
        refuse_faults(&input)?;
        let cell = &request.cell;
        let mut of_robot = explain::of_robot(&request);
        of_robot.extend(coupled(cell));
        of_robot.extend(unlimited(cell));
        let on = match &request.topic_of_messages {
            Some(topic) => format!(" on {topic}"),
            None => String::new(),
        };
        let mut of_recordings = vec![format!(
            "{} joints of {}{on} in {} recordings.",
            cell.facts.joint_names.len(),
            cell.facts.name,
            self.recordings.len()
        )];
        let found: Vec<_> = (input.fit.iter())
            .map(|recording| {
                (
                    recording.path.display().to_string(),
                    recording.findings.clone(),
                )
            })
            .collect();
        of_recordings.extend(by_recording(&found));
        let scale = scale(&request);
        let (unit, sentence) = self.unit(scale.as_ref());
        let no_line = scale.and_then(|scale| match unit {
            EffortUnit::Nm => scale.fault_in_nm(),
            EffortUnit::A => scale.fault_in_a(),
        });
        of_recordings.push(sentence);
        request.cell.facts.effort_unit = unit;
        unit.as_str().clone_into(&mut input.effort_unit);
        let kept = Kept::of(&input);
        hold_out(&mut request, &mut input);
        Ok(Looked {
            request,
            input,
            kept,
            of_robot,
            of_recordings,
            no_line,
        })
    }

    /// Creates the request: all recordings are to be fitted, with efforts in N m until the unit is known.
    fn request(&self) -> Result<Request, Report> {
        let arguments = Arguments {
            robot: Some(self.robot),
            effort_unit: self.effort_unit.unwrap_or_default(),
            torque_constants_nm_per_a: std::collections::BTreeMap::new(),
            twin: None,
            twin_topic: None,
            state_topic: self.state_topic,
            command_topic: None,
            fit: self.recordings,
            holdout: &[],
        };
        explain::from_arguments(&arguments, self.without.clone())
    }

    /// Chooses the unit that the explanation begins with, and describes the choice: motor current if joints that bear
    /// weight measure far less than the weight requires, else N m. The explanation revises it.
    fn unit(&self, scale: Option<&EffortScale>) -> (EffortUnit, String) {
        if let Some(unit) = self.effort_unit {
            return (unit, format!("Effort is in {}, as given.", words(unit)));
        }
        let in_nm = || {
            let sentence = "Effort is assumed to be in N m; the explanation below verifies this.";
            (EffortUnit::Nm, sentence.to_owned())
        };
        match scale {
            Some(EffortScale::Torque { slope, sure: true }) => (
                EffortUnit::Nm,
                format!(
                    "Effort is assumed to be in N m: on joints that carry weight it is {slope:.2} times what the robot's weight \
                     requires."
                ),
            ),
            Some(EffortScale::Current {
                nm_per_unit,
                joints,
            }) if *nm_per_unit <= MOST_NM_PER_A => {
                let plural = if *joints == 1 { "" } else { "s" };
                let sentence = format!(
                    "Effort is in A, motor current: {joints} joint{plural} that bear weight measure {:.3} per N m that the \
                     robot's weight requires, which is a torque constant of {nm_per_unit:.1} N m/A. If that is \
                     wrong, give --effort-unit Nm.",
                    1.0 / nm_per_unit
                );
                (EffortUnit::A, sentence)
            }
            _ => in_nm(),
        }
    }
}

/// Returns the slopes of measured over expected effort, of the joints whose motion explains most of their effort.
fn scale(request: &Request) -> Option<EffortScale> {
    let topics = Topics {
        state: request.state_topic.clone(),
        ..Topics::default()
    };
    let mut cell = request.cell.clone();
    // A fit in A needs no torque constants, and rejects no slope.
    cell.facts.effort_unit = EffortUnit::A;
    let fit: Vec<PathBuf> = request.fit.iter().map(|named| named.path.clone()).collect();
    let job = Job {
        cell: &cell,
        topics: &topics,
        twin: &tauscope_twin::Config::default(),
        fit: &fit,
        validation: &[],
    };
    // Without a fitted line the explanation gives the reason.
    let fitted = job.fit(&|_, _| true, &|_, _| {}).ok()?;
    Some(EffortScale::of(&telling_slopes_of(&fitted.file)))
}

/// Holds out some of the recordings, as `explain` does, in the request as in the input.
fn hold_out(request: &mut Request, input: &mut Input) {
    input.hold_out_some();
    let is_held = |named: &Named| input.holdout.iter().any(|held| held.name == named.name);
    let all = std::mem::take(&mut request.fit).into_iter();
    (request.holdout, request.fit) = all.partition(is_held);
}

/// Rejects recordings with faults that make anything learnt from them wrong.
fn refuse_faults(input: &Input) -> Result<(), Report> {
    let mut report = Report::default();
    let faults = |recording: &Recording| {
        let name = recording.path.display().to_string();
        let faults = recording.findings.iter().cloned();
        let faults = faults.filter(|finding| finding.effect() == Effect::Fault);
        (name, faults.collect())
    };
    let faults: Vec<_> = input.fit.iter().map(faults).collect();
    for fault in by_recording(&faults) {
        report.push(Problem::new(fault));
    }
    for recording in input.fit.iter().filter(|it| it.effort.is_empty()) {
        let title = "no joint state has an effort";
        let help = "record the topic that has efforts, with the drives on";
        report.push(Problem::of_file(&recording.path, title.to_owned()).help(help));
    }
    report.into_result(())
}

/// Returns a sentence for each joint that follows another.
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

/// Returns a sentence for each joint whose limits are treated as absent.
fn unlimited(cell: &Cell) -> Vec<String> {
    let joints = cell.model.iter().flat_map(Model::joints);
    let remarks = joints.filter_map(Joint::remark);
    remarks
        .map(|remark| format!("{}.", remark.replacen("joint", "Joint", 1)))
        .collect()
}

/// Returns the unit in words.
pub fn words(unit: EffortUnit) -> &'static str {
    match unit {
        EffortUnit::Nm => "N m",
        EffortUnit::A => "A",
    }
}
