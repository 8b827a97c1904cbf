//! Conversion of the explanation to findings with intervals, alternatives and detection limits.

mod clipping;
mod far_out;
mod lighter_body;
mod odd_robot;
mod pushes;
mod rivals;
mod scales;
mod sizes;
mod undetectable;
mod waves;

use std::collections::BTreeMap;

use serde_json::Value;
use tauscope_dynamics::terms::PlaceKind;

use crate::context::Context;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::interval::HALF_WIDTH_95;
use crate::inference::Inferred;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::physics::friction::least;
use crate::read::input::Input;
use crate::report::schema::{Finding, NextMotion, Rejected, Rival};
use crate::report::sentences;

use clipping::is_clipped;
use odd_robot::{imitates, oddities};
use scales::{Scales, StartScales};
use sizes::{effort_rms, mismatch};
pub use undetectable::undetectable;
use waves::merge_waves;

/// Standard deviation above which a time has no interval \[s\].
/// Chosen: that of a time anywhere in a pause of 17 s, 17 s / √12; an interval as wide only shows the pause.
const VAGUE_S: f64 = 5.0;

/// Coefficients of a finding's log-odds: intercept, and slope over the logarithm of one plus the size of its margin, with
/// the margin's sign. Statistical:
/// `python tests/proof/reliability.py tauscope OUT --first 20001 --cases 200 --half even --fit`, 268 findings of 100
/// cases.
const CONFIDENCE: [f64; 2] = [0.55, 0.46];

/// The findings of an explanation, with alternatives, motions and notes.
#[derive(Debug, Default)]
pub struct Named {
    /// Findings, the one that explains most first.
    pub findings: Vec<Finding>,
    /// Rejected alternatives.
    pub rejected: Vec<Rejected>,
    /// Motions that would distinguish equally likely alternatives.
    pub next_motions: Vec<NextMotion>,
    /// Files of the motions: name and text.
    pub trajectories: Vec<(String, String)>,
    /// Notes on the torque scales of drives.
    pub notes: Vec<String>,
    /// Standard deviations of the fitted gains, by joint.
    pub gain_deviation: Vec<(usize, f64)>,
}

impl Named {
    /// Adds the findings of another explanation.
    pub fn extend(&mut self, other: Self) {
        self.findings.extend(other.findings);
        self.rejected.extend(other.rejected);
        self.next_motions.extend(other.next_motions);
        self.trajectories.extend(other.trajectories);
        self.notes.extend(other.notes);
    }
}

fn place_of(
    input: &Input,
    joints: &[String],
    hypothesis: &Hypothesis,
) -> (Option<String>, Option<String>) {
    let link = |index: usize| Some(input.model.links()[index].name.clone());
    match hypothesis.effect.place {
        PlaceKind::Joint | PlaceKind::TwoJoints => {
            (Some(joints[hypothesis.place.joint].clone()), None)
        }
        PlaceKind::Link if hypothesis.is_unnamed_body() => {
            let carrier = input.model.links()[hypothesis.place.link].joint;
            let joint = carrier.map(|joint| joints[joint].clone());
            (joint, link(hypothesis.place.link))
        }
        PlaceKind::Link | PlaceKind::Tool => (None, link(hypothesis.place.link)),
        PlaceKind::Base => (None, link(input.model.base_link())),
        PlaceKind::All => (None, None),
    }
}

fn rival(input: &Input, joints: &[String], hypothesis: &Hypothesis) -> Rival {
    let (joint, link) = place_of(input, joints, hypothesis);
    Rival {
        effect: hypothesis.said().to_owned(),
        joint,
        link,
    }
}

/// Returns the findings of an inferred explanation.
pub fn of(
    problem: &Problem,
    inferred: &Inferred,
    before: &Fit,
    context: &Context<'_>,
    joints: &[String],
) -> Named {
    let (input, fit, unit_nm) = (context.input, &inferred.fit, context.unit_nm);
    let total = mismatch(before, fit, before);
    let share = |less: &Fit| (mismatch(less, fit, before) / total).clamp(0.0, 1.0);
    let scales = Scales::of(problem, fit, &inferred.covariance);
    let of_start = StartScales::of(input);
    let mut named = Named {
        notes: scales.notes(joints),
        gain_deviation: scales.deviations().collect(),
        ..Named::default()
    };
    for index in 0..fit.actives.len() {
        let parts = pushes::parts(fit, index);
        if fit.actives[index].hypothesis.is_torque_scale() || parts[0] < index {
            continue;
        }
        let (active, deviations) = pushes::joined(problem, fit, &inferred.covariance, &parts);
        let active = &active;
        let less = fit.without(problem, &parts);
        let size = effort_rms(&less, fit, unit_nm);
        // A mass at its bound of zero is not a finding; a push with an unknown force is one.
        if size == 0.0 && active.hypothesis.time_kind() == TimeKind::Always {
            continue;
        }
        let (mut parameters, mut intervals) = numbers(problem, fit, active, &deviations, joints);
        let (joint, link) = place_of(input, joints, &active.hypothesis);
        let place = link.clone().or_else(|| joint.clone()).unwrap_or_default();
        let when = when(problem, active, &mut parameters, &mut intervals);
        drop_no_force(&mut parameters, &mut intervals);
        far_out::drop_nowhere(&mut parameters, &mut intervals);
        let in_amperes = scales.to_nm(active.hypothesis, &mut parameters, &mut intervals);
        of_start.widen(active.hypothesis, &parameters, &mut intervals);
        let of = (place.as_str(), when.recording.as_deref());
        let mut sentence = sentences::sentence(active, of, &parameters, &intervals, joints);
        let slides = active.hypothesis.slides(&input.model);
        sentence = sentences::in_units(&sentence, in_amperes, slides);
        let margin = inferred.margins[index];
        let others = &inferred.alternatives[index];
        let equivalent_to = named.keep_rivals(active, margin, others, input, joints);
        named.findings.push(Finding {
            effect: active.hypothesis.said().to_owned(),
            joint,
            link,
            parameters,
            intervals_95: intervals,
            in_amperes,
            slides,
            confidence: confidence_of(margin),
            recording: when.recording,
            t_start: when.start,
            t_end: when.end,
            explains: share(&less),
            evidence_nats: margin,
            effort_rms: size,
            equivalent_to,
            sentence,
        });
    }
    for finding in &mut named.findings {
        lighter_body::tell_share(finding, &problem.model);
        finding.sentence += far_out::far_out(finding, &problem.model).unwrap_or_default();
    }
    merge_waves(&mut named.findings);
    // The errors of implausible bodies look like these effects.
    if fit.actives.iter().any(|a| imitates(a.hypothesis.effect)) {
        named.notes.extend(oddities(&input.model));
    }
    named
        .findings
        .sort_by(|a, b| b.explains.total_cmp(&a.explains));
    named
}

/// Returns the confidence of a finding from its margin: the loss of evidence without it \[nats\]. It is negative where
/// another effect in its place would be more probable.
fn confidence_of(margin: f64) -> f64 {
    let [base, slope] = CONFIDENCE;
    1.0 / (1.0 + (-base - slope * margin.signum() * margin.abs().ln_1p()).exp())
}

/// Returns the parameters of an effect by name, and their 95 % intervals.
fn numbers(
    problem: &Problem,
    fit: &Fit,
    active: &Active,
    deviations: &[f64],
    joints: &[String],
) -> (BTreeMap<String, Value>, BTreeMap<String, [f64; 2]>) {
    let (mut parameters, mut intervals) = (BTreeMap::new(), BTreeMap::new());
    let effect = active.hypothesis.effect;
    let values = active.parameters();
    let all = effect.parameters.iter().zip(&values);
    for ((parameter, value), deviation) in all.zip(deviations) {
        parameters.insert(parameter.name.to_owned(), number(*value));
        // The time of a change between two recordings is not determined more precisely.
        let vague = parameter.name.starts_with("change_time") && *deviation > VAGUE_S;
        if deviation.is_finite() && !vague {
            let half = HALF_WIDTH_95 * deviation;
            let least = least(problem, active.hypothesis, parameter.minimum);
            let low = (value - half).max(least);
            intervals.insert(parameter.name.to_owned(), [low, value + half]);
        }
    }
    if effect.place == PlaceKind::TwoJoints {
        let source = joints[active.hypothesis.place.source].clone();
        parameters.insert("source_joint".to_owned(), Value::from(source));
    }
    if effect.traits.cuts_off && is_clipped(problem, fit, active) {
        parameters.insert("mode".to_owned(), Value::from("sensor"));
    }
    if effect.traits.is_off_list {
        parameters.insert("kind".to_owned(), Value::from(effect.name));
    }
    describe_curve(active, &mut parameters);
    (parameters, intervals)
}

/// Adds the argument of a curve, and its largest value with its place.
fn describe_curve(active: &Active, parameters: &mut BTreeMap<String, Value>) {
    let Some(curve) = &active.curve else {
        return;
    };
    let against = serde_json::to_value(curve.against).unwrap_or(Value::Null);
    parameters.insert("against".to_owned(), against);
    parameters.insert("by_direction".to_owned(), Value::from(curve.by_direction));
    let values = active.values_at_knots(curve);
    let all = values.iter().zip(&curve.knots);
    if let Some((most, at)) = all.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs())) {
        parameters.insert("largest_nm".to_owned(), number(*most));
        parameters.insert("largest_at".to_owned(), number(*at));
    }
}

/// Force component below which a push at a link's frame is treated as zero \[N\].
/// Resolution: far below any force that an arm feels.
const LEAST_FORCE_N: f64 = 0.01;

/// Removes the force of a push where it is zero, and the intervals of its times, which depend on it. The force is
/// zero if the link's frame is on the axes of all joints that the push loads: then a force at the frame causes no
/// joint torque.
fn drop_no_force(
    parameters: &mut BTreeMap<String, Value>,
    intervals: &mut BTreeMap<String, [f64; 2]>,
) {
    let names = ["x", "y", "z"].map(|axis| format!("force_{axis}_n"));
    let force: Vec<f64> = (names.iter())
        .filter_map(|name| parameters.get(name)?.as_f64())
        .collect();
    if force.len() == names.len() && force.iter().all(|f| f.abs() < LEAST_FORCE_N) {
        for name in &names {
            parameters.remove(name);
        }
        intervals.clear();
    }
}

fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or(Value::Null, Value::Number)
}

#[derive(Default)]
struct When {
    recording: Option<String>,
    start: Option<f64>,
    end: Option<f64>,
}

/// Returns the times of a finding. If they hold for one recording, its parameters are converted to that recording's
/// time.
fn when(
    problem: &Problem,
    active: &Active,
    parameters: &mut BTreeMap<String, Value>,
    intervals: &mut BTreeMap<String, [f64; 2]>,
) -> When {
    let mut none = When::default();
    let known = parameters.clone();
    let get = |name: &str| known.get(name).and_then(Value::as_f64);
    match active.hypothesis.time_kind() {
        TimeKind::Always => none,
        TimeKind::Step => {
            none.start = get("change_time_session_s");
            none
        }
        TimeKind::EveryRecording => {
            (none.start, none.end) = (get("t_start_s"), get("t_end_s"));
            none
        }
        TimeKind::Once => {
            let (Some(start), Some(end)) = (get("t_start_s"), get("t_end_s")) else {
                return none;
            };
            if active.hypothesis.effect.traits.in_session {
                // An end outside the session has no interval.
                let (first_s, last_s) = problem.session_s();
                let within = |t: f64| t.clamp(first_s, last_s);
                for (name, t) in [("t_start_s", start), ("t_end_s", end)] {
                    if t < first_s || t > last_s {
                        parameters.insert(name.to_owned(), number(within(t)));
                        intervals.remove(name);
                    }
                }
                return When {
                    recording: None,
                    start: Some(within(start)),
                    end: Some(within(end)),
                };
            }
            let middle = 0.5 * (start + end);
            let track = problem
                .tracks
                .iter()
                .map(|track| &track.track)
                .filter(|track| track.session_s <= middle)
                .max_by(|a, b| a.session_s.total_cmp(&b.session_s));
            let Some(track) = track else { return none };
            if active.hypothesis.effect.traits.fills_recording {
                parameters.retain(|name, _| !name.starts_with("t_"));
                intervals.retain(|name, _| !name.starts_with("t_"));
                return When {
                    recording: Some(track.name.clone()),
                    start: Some(0.0),
                    end: track.time_s.last().copied(),
                };
            }
            for name in ["t_start_s", "t_end_s"] {
                if let Some(value) = get(name) {
                    parameters.insert(name.to_owned(), number(value - track.session_s));
                }
                if let Some(interval) = intervals.get_mut(name) {
                    *interval = interval.map(|t| t - track.session_s);
                }
            }
            When {
                recording: Some(track.name.clone()),
                start: Some(start - track.session_s),
                end: Some(end - track.session_s),
            }
        }
    }
}
