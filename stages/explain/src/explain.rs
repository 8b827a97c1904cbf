//! From recordings to a report: the whole way.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Layer, TermError, TermSpec, Time};

use crate::physics::active::{Active, Hypothesis};
mod at_rest;
mod in_motion;
use crate::data::problem::Problem;
use crate::data::track::Track;
use crate::fit::fitted::Fit;
use crate::physics::friction;
use crate::physics::library;
use crate::physics::start::{Start, scales};
use crate::physics::torque_scale;
use crate::read::audit;
use crate::read::recording::Recording;
use crate::report::findings::{self, Named};
use crate::report::locate;
use crate::report::verdict;
use crate::report::{RecordingPicture, Report, Undetectable, Verdict};

/// What is to be explained.
#[derive(Debug)]
pub struct Input {
    /// Name of the case.
    pub case: String,
    /// The robot; massless joints where the twin is a topic.
    pub model: Model,
    /// Whether the robot's bodies are known: not where the twin is a topic.
    pub bodies: bool,
    /// Unit of the recordings' effort: `Nm` or `A`.
    pub effort_unit: String,
    /// By joint, where the unit is `A` and they are known \[N m/A\].
    pub torque_constants_nm_per_a: Option<Vec<f64>>,
    /// Recordings that may be fitted.
    pub fit: Vec<Recording>,
    /// Recordings that nothing is fitted on.
    pub holdout: Vec<Recording>,
    /// A corrected twin to start from, if there is one.
    pub start: Option<Start>,
    /// Effects that are left out of the library.
    pub without: BTreeSet<String>,
}

/// What came of it.
#[derive(Debug)]
pub struct Outcome {
    /// What is said.
    pub report: Report,
    /// The physics of the corrected twin that lasts: what the start had and what was found.
    pub terms: Vec<TermSpec>,
    /// Gain of each joint's bodies \[effort unit per model unit\].
    pub gain: Vec<f64>,
    /// Standard deviation of each gain that stands for a torque constant; 0 where none does.
    pub gain_deviation: Vec<f64>,
    /// The corrected twin's effort on each hold-out recording: row-major, one row per recorded row \[effort unit\].
    pub predictions: Vec<(String, Vec<f64>)>,
    /// What is drawn.
    pub pictures: Vec<RecordingPicture>,
    /// Trajectories to record next: file name and CSV text.
    pub trajectories: Vec<(String, String)>,
}

/// Explains. `progress` is told the share that is done, 0 to 1, and what is being done.
///
/// # Errors
/// If a term of the start cannot be built for the robot.
pub fn explain(
    mut input: Input,
    progress: &(dyn Fn(f64, &str) + Sync),
) -> Result<Outcome, TermError> {
    let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
    progress(0.0, "audit");
    if let Some(reason) = audit::before(&input) {
        return Ok(not_evaluated(&input, joints, reason));
    }
    let at_rest = audit::at_rest(&input);
    if input.holdout.is_empty() && !at_rest {
        hold_out_some(&mut input);
    }
    let constants = input
        .torque_constants_nm_per_a
        .clone()
        .unwrap_or_else(|| vec![1.0; joints.len()]);
    let (unit_nm, unscaled) = scales(&input, &constants, at_rest);
    let session_start_ns = input
        .fit
        .iter()
        .chain(&input.holdout)
        .map(|recording| recording.start_ns)
        .min()
        .unwrap_or(0);
    let mut setup = Setup {
        input: &input,
        constants: &constants,
        unit_nm: &unit_nm,
        unscaled,
        loads: Vec::new(),
        session_start_ns,
        at_rest,
    };
    let mut judged = if at_rest {
        setup.at_rest(progress)?
    } else {
        setup.in_motion(progress)?
    };
    if let Ok(first) = &judged
        && input.start.as_ref().is_some_and(Start::needs_load)
    {
        setup.loads = setup.bodies(&first.found);
        if !setup.loads.is_empty() && !at_rest {
            judged = setup.in_motion(progress)?;
        }
    }
    let judged = match judged {
        Ok(judged) => judged,
        Err(reason) => return Ok(not_evaluated(&input, joints, reason)),
    };
    let Judged {
        problem,
        before,
        found,
        mut named,
        undetectable,
        rests_count,
    } = judged;
    progress(0.95, "proof");
    let proof = setup.proof(&problem, &before, &found)?;
    let noise_floor: Vec<f64> = (0..joints.len())
        .map(|j| audit::white_noise(&input.fit, j, joints.len()))
        .collect();
    let left_elsewhere = verdict::left_elsewhere(&proof, &noise_floor);
    let verdict = verdict::verdict(&found, &named.findings, &left_elsewhere);
    if !left_elsewhere.is_empty() {
        findings::doubt_patches(&mut named.findings);
    }
    let mut notes = named.notes;
    let unit = if input.effort_unit == "A" { "A" } else { "N m" };
    notes.extend(verdict::note(&proof, &left_elsewhere, &joints, unit));
    notes.extend(audit::notes(&input, &problem, &found, &rests_count));
    let report = Report {
        case: input.case.clone(),
        verdict,
        reason: None,
        summary: findings::summary(verdict, &named.findings, &proof.before, &proof.after),
        effort_unit: input.effort_unit.clone(),
        located: locate::located(&problem, &before, &joints),
        undetectable,
        findings: named.findings,
        rejected: named.rejected,
        next_motions: named.next_motions,
        notes,
        joints,
        holdout_rms_before: proof.before,
        holdout_rms_after: proof.after,
        noise_floor,
        holdout_predictions: BTreeMap::new(),
    };
    progress(1.0, "done");
    let (gain, gain_deviation) = setup.final_gains(&found, &named.gain_deviation);
    Ok(Outcome {
        report,
        terms: setup.lasting_terms(&found),
        gain,
        gain_deviation,
        predictions: proof.predictions,
        pictures: proof.pictures,
        trajectories: named.trajectories,
    })
}

/// What a search came to.
pub(crate) struct Judged {
    /// The recordings that were fitted.
    pub problem: Problem,
    /// The twin as it was, its scales fitted where nobody knows them.
    pub before: Fit,
    /// The twin as it should be.
    pub found: Fit,
    /// What is said of it.
    pub named: Named,
    /// The smallest effects that would have been found.
    pub undetectable: Vec<Undetectable>,
    /// By joint, whether its standstills count.
    pub rests_count: Vec<bool>,
}

/// Without hold-out recordings some of those to be fitted are held out: about a third, the last ones, so that
/// what lasts only for a while may be met in both.
fn hold_out_some(input: &mut Input) {
    let out = (input.fit.len() / 3).max(usize::from(input.fit.len() > 1));
    input.holdout = input.fit.split_off(input.fit.len() - out);
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
            notes: audit::losses(input),
            joints,
            holdout_rms_before: nan.clone(),
            holdout_rms_after: nan.clone(),
            noise_floor: nan,
            holdout_predictions: BTreeMap::new(),
        },
        terms: Vec::new(),
        gain: Vec::new(),
        gain_deviation: Vec::new(),
        predictions: Vec::new(),
        pictures: Vec::new(),
        trajectories: Vec::new(),
    }
}

/// What every step needs.
pub(crate) struct Setup<'a> {
    pub input: &'a Input,
    /// Torque constants by joint \[N m/A\]; 1 where there are none.
    constants: &'a [f64],
    /// N m per recorded unit by joint; 1 where nobody knows it.
    pub unit_nm: &'a [f64],
    /// Joints of which nobody knows the scale between the recordings' unit and N m, and the gain of their bodies at first.
    pub unscaled: Vec<(usize, f64)>,
    /// New bodies that were found and that the start's physics has to bear.
    loads: Vec<TermSpec>,
    session_start_ns: i64,
    /// Whether no joint moves.
    pub at_rest: bool,
}

impl Setup<'_> {
    pub fn hypotheses(&self) -> Vec<Hypothesis> {
        let input = self.input;
        let mut all = library::hypotheses(&input.model, input.bodies, &input.without);
        // The scale of such a joint is free as it is.
        let unscaled = |joint: usize| self.unscaled.iter().any(|(other, _)| *other == joint);
        all.retain(|h| !h.effect.traits.is_scale || !unscaled(h.place.joint));
        all
    }

    pub fn track(&self, recording: &Recording, motion_cutoff_hz: f64) -> Result<Track, TermError> {
        let session_s = (recording.start_ns - self.session_start_ns) as f64 * 1e-9;
        let model = &self.input.model;
        let mut track = Track::new(
            recording,
            session_s,
            model,
            motion_cutoff_hz,
            self.constants,
        );
        if let Some(start) = &self.input.start {
            start.apply(
                &mut track,
                model,
                &self.loads,
                self.constants,
                &self.first_gains(),
            )?;
        }
        // Not of recordings held out: what is predicted for them comes from the motion alone.
        let fitted = self
            .input
            .fit
            .iter()
            .any(|own| std::ptr::eq(own, recording));
        if self.at_rest && fitted {
            at_rest::start_at_measured(&mut track, recording, self.unit_nm);
        }
        Ok(track)
    }

    /// What there is of some recordings, compared as those are that are fitted.
    pub fn problem(
        &self,
        recordings: &[Recording],
        rests_count: &[bool],
    ) -> Result<Problem, TermError> {
        let cutoff_hz = Problem::cutoff_hz(&self.input.fit);
        let motion_cutoff_hz = Problem::motion_cutoff_hz(cutoff_hz);
        let tracks = recordings
            .iter()
            .map(|recording| self.track(recording, motion_cutoff_hz))
            .collect::<Result<Vec<_>, _>>()?;
        let mut problem = Problem::new(
            &self.input.model,
            recordings,
            tracks,
            cutoff_hz,
            self.unit_nm,
            rests_count,
        );
        if let Some(start) = &self.input.start {
            problem.known_friction = start.friction(&self.input.model);
            if self.input.torque_constants_nm_per_a.is_none() {
                for (known, unit) in problem.known_friction.iter_mut().zip(self.unit_nm) {
                    known.values_mut().for_each(|value| *value *= unit);
                }
            }
        }
        Ok(problem)
    }

    /// What the bodies of each joint are taken by at first, from the model's unit into the recording's.
    fn first_gains(&self) -> Vec<f64> {
        let mut gains: Vec<f64> = self.unit_nm.iter().map(|unit| 1.0 / unit).collect();
        if !self.at_rest {
            for &(joint, gain) in &self.unscaled {
                gains[joint] = gain;
            }
        }
        gains
    }

    /// Gain of each joint's bodies in the corrected twin, and its standard deviation, given those of the gains that were fitted.
    fn final_gains(&self, found: &Fit, fitted: &[(usize, f64)]) -> (Vec<f64>, Vec<f64>) {
        let n = self.unit_nm.len();
        let start = self.input.start.as_ref();
        let mut gain = start.map_or_else(|| vec![1.0; n], |start| start.gain.clone());
        let mut deviation =
            start.map_or_else(|| vec![0.0; n], |start| start.gain_deviation.clone());
        let of_fit = torque_scale::gains(&found.actives, n);
        for &(joint, of_gain) in fitted {
            (gain[joint], deviation[joint]) = (of_fit[joint], of_gain);
        }
        (gain, deviation)
    }

    /// A piece of physics as files hold it.
    fn spec(&self, active: &Active) -> TermSpec {
        let model = &self.input.model;
        let site = active.hypothesis.place.site(model);
        TermSpec::of(&*active.term_for(model), &site)
    }

    /// The bodies of an explanation that its gears bear for long.
    fn bodies(&self, found: &Fit) -> Vec<TermSpec> {
        let of_bodies = |active: &&Active| {
            let hypothesis = active.hypothesis;
            let lasts = !matches!(hypothesis.effect.time(), Time::Once);
            hypothesis.effect.layer == Layer::Body && !torque_scale::is_drive(&hypothesis) && lasts
        };
        let bodies = found.actives.iter().filter(of_bodies);
        bodies.map(|active| self.spec(active)).collect()
    }

    /// What a corrected twin keeps: not what came and went.
    fn lasting_terms(&self, found: &Fit) -> Vec<TermSpec> {
        let mut terms = self
            .input
            .start
            .as_ref()
            .map_or_else(Vec::new, |start| start.terms.clone());
        for active in &found.actives {
            if torque_scale::is_drive(&active.hypothesis) || !active.hypothesis.effect.lasts() {
                continue;
            }
            let term = self.spec(active);
            // With torque constants the terms of a twin are in N m, else in what was recorded.
            let term = if self.input.torque_constants_nm_per_a.is_none() {
                friction::in_recorded_units(&term, &self.input.model, self.unit_nm)
            } else {
                term
            };
            friction::add(term, &mut terms);
        }
        terms
    }
}
