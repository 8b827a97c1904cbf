//! Search for an arm at rest: temporary effects are identifiable, lasting ones are not.

use tauscope_dynamics::terms::TermError;
use tauscope_dynamics::terms::words::number;

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::track::BEGINNING_S;
use crate::explain::judged::{Judged, Stop};
use crate::fit::fitted::Fit;
use crate::inference;
use crate::physics::active::{Hypothesis, TimeKind};
use crate::propose::times;
use crate::read::audit;
use crate::read::recording::Recording;
use crate::report::findings;
use tauscope_dynamics::kinematic_tree::bearing;

/// Smallest residual of a push over all joints, in standard deviations at the start of the recording.
/// Tuned: by hand, on no recorded seeds; not swept.
const STANDS_OUT: f64 = 8.0;
/// Smallest residual of a push, relative to its peak within [`NEAR_S`], because friction retains part of a push for a
/// long time.
/// Tuned: by hand, on no recorded seeds; not swept.
const SHARE_OF_PEAK: f64 = 0.3;
/// Time on either side within which the peak is searched \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const NEAR_S: f64 = 1.0;
/// Shortest push, and shortest time between two pushes \[s\].
/// Derived: a shorter one is not resolved below the cutoff of the comparison, whose period is 0.125 s at 8 Hz.
const SHORTEST_S: f64 = 0.15;
/// Smallest mean residual of a joint loaded by a push, in standard deviations at the start of the recording.
/// Statistical: Gaussian noise goes beyond four standard deviations once in 16 000 samples.
const FELT: f64 = 4.0;
/// Smallest mean residual of a joint loaded by a push, relative to the most loaded joint.
/// Tuned: by hand, on no recorded seeds; not swept.
const FELT_SHARE: f64 = 0.015;
/// Share of the time above which a large residual is not a push. The effort then changes while the positions do not,
/// as when a driver does not publish them.
/// Tuned: by hand, on no recorded seeds; not swept.
const MOST_OF_TIME: f64 = 0.7;

/// Returns the standard deviation of the residual at each joint over the start of a problem's only recording
/// \[N m or N\]. If a push cuts the start short, it is the median over parts of the recording of that length, each
/// about its own mean.
fn deviations(problem: &Problem, fit: &Fit) -> Vec<f64> {
    let track = &problem.tracks[0];
    let time = |k: usize| track.track.time_s[track.compared[k]];
    let rows = track.compared.len();
    let is_cut = track.track.quiet_s < BEGINNING_S;
    let of = |j: usize| {
        let first = problem.joint_rows(j).start;
        let about = |from_s: f64, to_s: f64, own_mean: bool| {
            let inside = |k: &usize| (from_s..to_s).contains(&time(*k));
            let counted = (0..rows).filter(|k| inside(k) && problem.weight[first + k] > 0.0);
            let left: Vec<f64> = counted.map(|k| fit.residual[first + k]).collect();
            let count = left.len().max(1) as f64;
            let mean = if own_mean {
                left.iter().sum::<f64>() / count
            } else {
                0.0
            };
            (left.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
        };
        let deviation = if is_cut {
            let end_s = track.track.time_s.last().copied().unwrap_or(0.0);
            let parts = (end_s / BEGINNING_S) as usize;
            let part = |k: usize| {
                let from_s = BEGINNING_S * k as f64;
                about(from_s, from_s + BEGINNING_S, true)
            };
            let mut all: Vec<f64> = (0..parts).map(part).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        } else {
            about(0.0, BEGINNING_S, false)
        };
        deviation.max(problem.white_noise[j])
    };
    (0..problem.joints).map(of).collect()
}

/// Returns the intervals with a large residual in a problem's only recording \[s of recording time\].
fn stands_out(problem: &Problem, fit: &Fit, deviations: &[f64]) -> Vec<(f64, f64)> {
    let track = &problem.tracks[0];
    let times: Vec<f64> = (track.compared.iter())
        .map(|&k| track.track.time_s[k])
        .collect();
    // In N m: divided by the noise, friction at the joint with the finest sensor would dominate.
    let norm: Vec<f64> = (0..times.len())
        .map(|row| {
            let of = |j: usize| {
                let at = problem.joint_rows(j).start + row;
                problem.weight[at] * fit.residual[at].powi(2)
            };
            (0..problem.joints).map(of).sum::<f64>().sqrt()
        })
        .collect();
    let noise = deviations.iter().map(|d| d * d).sum::<f64>().sqrt();
    // The peak since the residual was last small: what friction retains of a push is not another push.
    let held = norm.iter().scan(0.0_f64, |most, x| {
        *most = if *x > STANDS_OUT * noise {
            most.max(*x)
        } else {
            0.0
        };
        Some(*most)
    });
    let held: Vec<f64> = held.collect();
    let stands_out = |k: usize| {
        let first = times.partition_point(|t| *t < times[k] - NEAR_S);
        let last = times.partition_point(|t| *t <= times[k] + NEAR_S);
        let near = norm[first..last].iter();
        let peak = near.fold(held[k], |most, x| most.max(*x));
        norm[k] > (STANDS_OUT * noise).max(SHARE_OF_PEAK * peak)
    };
    let mut found: Vec<(f64, f64)> = Vec::new();
    for (k, &t) in times.iter().enumerate().filter(|(k, _)| stands_out(*k)) {
        // A sample represents the time until the next one.
        let until = times.get(k + 1).copied().unwrap_or(t);
        match found.last_mut() {
            Some((_, end)) if t - *end < SHORTEST_S => *end = until,
            _ => found.push((t, until)),
        }
    }
    found.retain(|(from, to)| to - from >= SHORTEST_S);
    found
}

/// Returns the joint furthest from the base that is loaded in an interval. A push does not load the joints beyond the
/// link on which it acts.
fn last_to_feel(
    problem: &Problem,
    fit: &Fit,
    deviations: &[f64],
    (from_s, to_s): (f64, f64),
) -> Option<usize> {
    let track = &problem.tracks[0];
    let within = |k: &usize| (from_s..to_s).contains(&track.track.time_s[*k]);
    let inside: Vec<bool> = track.compared.iter().map(within).collect();
    let count = inside.iter().filter(|inside| **inside).count().max(1) as f64;
    let mean = |j: usize| {
        let left = fit.residual[problem.joint_rows(j)].iter().zip(&inside);
        let sum: f64 = left.filter(|(_, inside)| **inside).map(|(e, _)| e).sum();
        (sum / count).abs()
    };
    let means: Vec<f64> = (0..problem.joints).map(mean).collect();
    let most = means.iter().fold(0.0_f64, |most, x| most.max(*x));
    let feels = |j: &usize| means[*j] > (FELT * deviations[*j]).max(FELT_SHARE * most);
    (0..problem.joints)
        .filter(feels)
        .max_by_key(|j| order(problem, *j))
}

/// Returns the number of joints from the base to `joint`, itself included.
fn order(problem: &Problem, joint: usize) -> usize {
    let model = &problem.model;
    bearing(model, model.joints()[joint].child_link).len()
}

/// Fits one push for each interval with a large residual. Its link is the one where a constant force explains most of
/// the residual, among the links next to the last loaded joint.
fn pushes(problem: &Problem, hypotheses: &[Hypothesis], bodies: bool) -> Fit {
    let none = Fit::new(problem, Vec::new());
    let deviations = deviations(problem, &none);
    let intervals = stands_out(problem, &none, &deviations);
    let length_s: f64 = intervals.iter().map(|(from, to)| to - from).sum();
    let whole_s = problem.tracks[0]
        .track
        .time_s
        .last()
        .map_or(0.0, |end| end - BEGINNING_S);
    if length_s > MOST_OF_TIME * whole_s {
        return none;
    }
    let push = |interval: (f64, f64)| {
        let last = last_to_feel(problem, &none, &deviations, interval);
        let near = |h: &&Hypothesis| match (last, problem.model.links()[h.place.link].joint) {
            (Some(last), Some(joint)) => order(problem, last).abs_diff(order(problem, joint)) <= 1,
            _ => true,
        };
        let gain = |h: &Hypothesis| times::gain(problem, &none, *h, 0, interval);
        let best = hypotheses.iter().filter(near);
        let best = best.max_by(|a, b| gain(a).total_cmp(&gain(b)));
        best.map(|best| times::within(problem, *best, 0, interval))
    };
    let actives = intervals.into_iter().filter_map(push).collect();
    inference::estimated(problem, actives, &[], bodies).fit
}

impl Context<'_> {
    /// Searches each recording separately for temporary effects. Returns the reason if there is no verdict.
    pub fn at_rest(
        &self,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Result<Result<Judged, Stop>, TermError> {
        let input = self.input;
        let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
        let rests_count = vec![true; joints.len()];
        let mut hypotheses = self.hypotheses();
        // An effect that lasts for a whole recording or longer is part of the load.
        let passes = |h: &Hypothesis| {
            let stays = h.effect.traits.fills_recording || h.effect.traits.in_session;
            h.time_kind() == TimeKind::Once && !stays
        };
        hypotheses.retain(passes);
        progress(0.1, "looking for pushes");
        let (mut actives, mut undetectable) = (Vec::new(), Vec::new());
        let mut named = findings::Named::default();
        let known = |recording: &&Recording| !audit::is_frozen(recording, joints.len());
        for recording in input.fit.iter().filter(known) {
            let problem = self.problem(std::slice::from_ref(recording), &rests_count)?;
            let before = Fit::new(&problem, Vec::new());
            let found = pushes(&problem, &hypotheses, input.bodies);
            let inferred = inference::around(&problem, &hypotheses, found, input.bodies);
            let mut own = findings::of(&problem, &inferred, &before, self, &joints);
            // No further motion adds information on a push that is over.
            own.next_motions.clear();
            own.trajectories.clear();
            named.extend(own);
            if undetectable.is_empty() {
                undetectable = findings::undetectable(&inferred.smallest, self, &joints);
            }
            actives.extend(inferred.fit.actives);
        }
        if named.findings.is_empty() {
            let reason = "no joint moves far enough to separate friction from load";
            return Ok(Err(Stop::Reason(reason.to_owned())));
        }
        named.notes.push(format!(
            "No joint moves, so lasting effects cannot be distinguished from the load. The effort in the first {BEGINNING_S} s of each \
             recording, or until it changes, is treated as the load of that pose."
        ));
        if !self.unscaled.is_empty() {
            let of =
                |&(j, _): &(usize, f64)| format!("{} {} N m/A", joints[j], number(self.unit_nm[j]));
            let taken: Vec<String> = self.unscaled.iter().map(of).collect();
            named.notes.push(format!(
                "The torque constants of these drives are unknown. Forces are only as accurate as these assumed values: {}.",
                taken.join(", ")
            ));
        }
        let problem = self.problem(&input.fit, &rests_count)?;
        Ok(Ok(Judged {
            before: Fit::new(&problem, Vec::new()),
            found: Fit::new(&problem, actives),
            named,
            undetectable,
            problem,
            kept: Vec::new(),
            remaining: Vec::new(),
        }))
    }
}
