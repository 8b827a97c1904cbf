//! The whole method: from recordings to a report.

mod at_rest;
mod in_motion;
mod judged;

use std::collections::BTreeMap;

use tauscope_dynamics::terms::TermError;

use crate::context::Context;
use crate::data::noise::white_noise;
use crate::data::units::scales;
use crate::data::{other_simulation, remedies};
use crate::outcome::Outcome;
use crate::read::audit;
use crate::read::excerpt::excerpts;
use crate::read::input::Input;
use crate::read::start::Start;
use crate::report::schema::{Finding, Remaining, Report, Verdict};
use crate::report::slips::Slips;
use crate::report::{locate, notes, remainder, summary, verdict, without_law};

use judged::{Judged, Stop};

/// Explains the input. `progress` receives the completed share, 0 to 1, and the name of the step.
///
/// # Errors
/// If a term of the start cannot be built for the robot.
pub fn explain(
    mut input: Input,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Outcome, TermError> {
    let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
    progress(0.0, "checking the recordings for faults");
    if let Some(reason) = audit::before(&input) {
        return Ok(not_evaluated(&input, joints, reason));
    }
    let at_rest = audit::at_rest(&input);
    let is_parted = input.is_parted() && !at_rest;
    if input.holdout.is_empty() && !at_rest {
        input.hold_out_some();
    }
    let excerpts = if at_rest {
        None
    } else {
        excerpts(&mut input.fit)
    };
    let n = joints.len();
    let mut slips = if at_rest {
        Slips::default()
    } else {
        let mut all = remedies::of_velocity(&input.fit, n);
        all.extend(remedies::of_unmeasured(&input.fit, n));
        all.extend(remedies::of_dropouts(&input.fit, &joints));
        all.retain(|slip| !slip.remedy.is_without(&input.without));
        Slips::new(all)
    };
    input.mend(&slips.all);
    loop {
        let (stop, errors) = match attempt(&mut input, at_rest, &slips, &joints, progress)? {
            Attempt::Done(mut outcome) => {
                let notes = &mut outcome.report.notes;
                notes.extend(excerpts.map(notes::in_excerpts));
                notes.extend(is_parted.then(notes::is_parted));
                return Ok(*outcome);
            }
            Attempt::Stopped(stop, errors) => (stop, errors),
        };
        match stop {
            Stop::Slips(found) if slips.all.len() < MOST_SLIPS_PER_JOINT * n => {
                input.mend(&found);
                slips.add(found, errors);
            }
            Stop::Slips(_) => {
                let reason = "these recordings need too many corrections: they are probably of another robot";
                return Ok(not_evaluated(&input, joints, reason.to_owned()));
            }
            Stop::Reason(reason) => return Ok(not_evaluated(&input, joints, reason)),
        }
    }
}

/// Largest number of faults of the recordings per joint; more indicate another robot.
/// Resolution: each joint may be in another's place, turned, and have another unit.
const MOST_SLIPS_PER_JOINT: usize = 3;

/// Result of one attempt to explain.
enum Attempt {
    Done(Box<Outcome>),
    /// The reason against a verdict, and the error of the twin on the uncorrected held-out recordings.
    Stopped(Stop, Vec<f64>),
}

/// Explains recordings in which `slips` are corrected.
fn attempt(
    input: &mut Input,
    at_rest: bool,
    slips: &Slips,
    joints: &[String],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Attempt, TermError> {
    let constants = input
        .torque_constants_nm_per_a
        .clone()
        .unwrap_or_else(|| vec![1.0; joints.len()]);
    let (unit_nm, unscaled) = scales(input, &constants, at_rest);
    let session_start_ns = input
        .fit
        .iter()
        .chain(&input.holdout)
        .map(|recording| recording.start_ns)
        .min()
        .unwrap_or(0);
    let twin_late_s = if input.bodies || at_rest {
        0.0
    } else {
        other_simulation::put_on_clock(input, &constants, &unit_nm)
    };
    let mut context = Context {
        input,
        constants: &constants,
        unit_nm: &unit_nm,
        unscaled,
        loads: Vec::new(),
        session_start_ns,
        at_rest,
        twin_late_s,
    };
    let mut judged = if at_rest {
        context.at_rest(progress)?
    } else {
        context.in_motion(progress)?
    };
    if let Ok(first) = &judged
        && context.input.start.as_ref().is_some_and(Start::needs_load)
    {
        context.loads = context.bodies(&first.found);
        if !context.loads.is_empty() && !at_rest {
            judged = context.in_motion(progress)?;
        }
    }
    match judged {
        Ok(judged) => {
            let outcome = conclude(&context, judged, slips, joints, progress)?;
            Ok(Attempt::Done(Box::new(outcome)))
        }
        Err(stop) => Ok(Attempt::Stopped(stop, context.rigid_errors()?)),
    }
}

/// Evaluates the held-out recordings and writes the report on the result of a search.
fn conclude(
    context: &Context<'_>,
    judged: Judged,
    slips: &Slips,
    joints: &[String],
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Outcome, TermError> {
    let input = context.input;
    progress(0.95, "checking on held-out recordings");
    let mut proof = context.proof(
        &judged.problem,
        [&judged.before, &judged.found],
        judged.kept.clone(),
    )?;
    let unit = if input.effort_unit == "A" { "A" } else { "N m" };
    let noise_floor = noise_floor(input);
    let units = (&noise_floor[..], context.unit_nm, unit);
    let remaining = remainder::remaining(&input.model, &judged.found, &judged.remaining, units);
    let Judged {
        problem,
        before,
        found,
        mut named,
        undetectable,
        ..
    } = judged;
    let mut notes = named.notes;
    notes.extend(context.notes());
    notes.extend(notes::not_handed_out(&proof, &found, &input.model, unit));
    notes.extend(notes::notes(
        input,
        &problem,
        &found,
        context.at_rest,
        &remaining,
    ));
    let mut findings = slips.findings(joints, unit, context.unit_nm);
    notes.splice(0..0, slips.note());
    findings.append(&mut named.findings);
    slips.undo(&mut proof);
    let verdict = verdict::verdict(&findings, &remaining, !input.bodies);
    let errors = [&proof.before[..], &proof.after[..]];
    let has_changed = input.found_before().is_some();
    let summary = summary::summary(verdict, &findings, &remaining, joints, errors, has_changed);
    findings.extend(without_law(input, &remaining, &findings));
    let report = Report {
        case: input.case.clone(),
        verdict,
        reason: None,
        summary,
        effort_unit: input.effort_unit.clone(),
        located: locate::located(&problem, &before, joints),
        undetectable,
        findings,
        rejected: named.rejected,
        next_motions: named.next_motions,
        remaining,
        notes,
        joints: joints.to_vec(),
        sliding_joints: sliding_joints(input),
        holdout_rms_before: proof.before,
        holdout_rms_after: proof.after,
        noise_floor,
        holdout_predictions: BTreeMap::new(),
        simulated: None,
    };
    progress(1.0, "writing the report");
    let (gain, gain_deviation) = context.final_gains(&found, &named.gain_deviation);
    Ok(Outcome {
        report,
        terms: context.lasting_terms(&found, &proof.kept),
        gain,
        gain_deviation,
        predictions: proof.predictions,
        pictures: proof.pictures,
        trajectories: named.trajectories,
    })
}

/// Returns findings for the remaining residual of a joint. None for an external twin, whose own errors may cause it.
fn without_law(input: &Input, remaining: &[Remaining], said: &[Finding]) -> Vec<Finding> {
    if !input.bodies {
        return Vec::new();
    }
    let in_amperes = input.effort_unit == "A";
    without_law::findings(remaining, said, &sliding_joints(input), in_amperes)
}

impl Context<'_> {
    /// Returns notes on the comparison with the twin.
    fn notes(&self) -> impl Iterator<Item = String> {
        notes::late_twin(self.twin_late_s).into_iter()
    }
}

fn sliding_joints(input: &Input) -> Vec<String> {
    let sliding = input.model.joints().iter().filter(|joint| joint.slides());
    sliding.map(|joint| joint.name.clone()).collect()
}

/// Returns the white noise of the measured effort, by joint \[effort unit\].
fn noise_floor(input: &Input) -> Vec<f64> {
    let n = input.model.dof();
    (0..n).map(|j| white_noise(&input.fit, j, n)).collect()
}

fn not_evaluated(input: &Input, joints: Vec<String>, reason: String) -> Outcome {
    let nan = vec![f64::NAN; joints.len()];
    Outcome {
        report: Report {
            case: input.case.clone(),
            verdict: Verdict::NotEvaluated,
            summary: format!("Nothing was evaluated: {reason}."),
            reason: Some(reason),
            effort_unit: input.effort_unit.clone(),
            findings: Vec::new(),
            rejected: Vec::new(),
            located: Vec::new(),
            undetectable: Vec::new(),
            next_motions: Vec::new(),
            remaining: Vec::new(),
            notes: audit::losses(input),
            sliding_joints: sliding_joints(input),
            joints,
            holdout_rms_before: nan.clone(),
            holdout_rms_after: nan.clone(),
            noise_floor: nan,
            holdout_predictions: BTreeMap::new(),
            simulated: None,
        },
        terms: Vec::new(),
        gain: Vec::new(),
        gain_deviation: Vec::new(),
        predictions: Vec::new(),
        pictures: Vec::new(),
        trajectories: Vec::new(),
    }
}
