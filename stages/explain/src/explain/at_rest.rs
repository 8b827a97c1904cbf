//! The search where no joint moves: what comes and goes can be told, what lasts cannot.

use tauscope_dynamics::terms::TermError;
use tauscope_dynamics::terms::words::number;

use crate::context::Context;
use crate::data::problem::Problem;
use crate::data::track::BEGINNING_S;
use crate::explain::judged::Judged;
use crate::fit::fitted::Fit;
use crate::physics::active::{Hypothesis, TimeKind};
use crate::read::audit;
use crate::read::recording::Recording;
use crate::report::findings;
use crate::select::explanation::Explanation;
use crate::select::plausible::plausible;
use crate::select::propose::Base;
use crate::select::search::Search;
use tauscope_dynamics::kinematic_tree::bearing;

/// What is left stands out where it is so many times its deviation in the beginning, over all joints,
const STANDS_OUT: f64 = 8.0;
/// and this share of the most within some time on either side \[s\]: after a push friction holds some of it for long.
const SHARE_OF_PEAK: f64 = 0.3;
const NEAR_S: f64 = 1.0;
/// What is shorter than this is no push, and what is nearer together is one \[s\].
const SHORTEST_S: f64 = 0.15;
/// A joint feels a push if it bears so many times its deviation in the beginning, and this share of what the joint does that
/// bears most.
const FELT: f64 = 4.0;
const FELT_SHARE: f64 = 0.015;

/// What stands out for more than this share of the time is no push: the effort changes while the positions do not, as where a
/// driver does not publish them.
const MOST_OF_TIME: f64 = 0.7;

/// Deviation of what is left at each joint as the only recording of a problem begins \[N m or N\].
fn deviations(problem: &Problem, fit: &Fit) -> Vec<f64> {
    let track = &problem.tracks[0];
    let begins = |k: &usize| track.track.time_s[*k] < BEGINNING_S;
    let beginning = track.compared.iter().take_while(|k| begins(k)).count();
    let of = |j: usize| {
        let rows = problem.joint_rows(j);
        let left = fit.residual[rows.clone()].iter().zip(&problem.weight[rows]);
        let (sum, count) = left
            .take(beginning)
            .fold((0.0, 0.0), |(sum, n), (e, w)| (sum + w * e * e, n + w));
        (sum / f64::max(count, 1.0))
            .sqrt()
            .max(problem.white_noise[j])
    };
    (0..problem.joints).map(of).collect()
}

/// When something stands out of what is left, in the only recording of a problem \[s of recording time\].
fn stands_out(problem: &Problem, fit: &Fit, deviations: &[f64]) -> Vec<(f64, f64)> {
    let track = &problem.tracks[0];
    let times: Vec<f64> = (track.compared.iter())
        .map(|&k| track.track.time_s[k])
        .collect();
    // In N m: whitened, the joint with the finest sensor would decide, and what friction holds there.
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
    // The most since it last was back where it began: what friction holds of a push is no other push, however long it does.
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
        // A sample stands for the time until the next.
        let until = times.get(k + 1).copied().unwrap_or(t);
        match found.last_mut() {
            Some((_, end)) if t - *end < SHORTEST_S => *end = until,
            _ => found.push((t, until)),
        }
    }
    found.retain(|(from, to)| to - from >= SHORTEST_S);
    found
}

/// The joint furthest from the base that bears something in an interval: what is beyond a touch does not feel it.
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

/// How many joints there are from the base to one.
fn order(problem: &Problem, joint: usize) -> usize {
    let model = &problem.model;
    bearing(model, model.joints()[joint].child_link).len()
}

/// A push for each time that something stands out, at the link where a constant force explains most of it: one that is next to
/// the last joint that feels it.
fn pushes(search: &Search<'_>) -> Explanation {
    let problem = search.problem;
    let mut best = Explanation {
        fit: Fit::new(problem, Vec::new()),
        penalties: Vec::new(),
    };
    let deviations = deviations(problem, &best.fit);
    let intervals = stands_out(problem, &best.fit, &deviations);
    let length_s: f64 = intervals.iter().map(|(from, to)| to - from).sum();
    let whole_s = problem.tracks[0]
        .track
        .time_s
        .last()
        .map_or(0.0, |end| end - BEGINNING_S);
    if length_s > MOST_OF_TIME * whole_s {
        return best;
    }
    for interval in intervals {
        let last = last_to_feel(problem, &best.fit, &deviations, interval);
        let near = |h: &&Hypothesis| match (last, problem.model.links()[h.place.link].joint) {
            (Some(last), Some(joint)) => order(problem, last).abs_diff(order(problem, joint)) <= 1,
            _ => true,
        };
        let base = Base::new(problem, &best.fit, search.hypotheses.len());
        let within = |h: &Hypothesis| base.propose_within(*h, interval, Some(0));
        let proposals = search.hypotheses.iter().filter(near).filter_map(within);
        let possible = proposals.filter(|p| plausible(&p.active, &problem.model));
        let push = possible.max_by(|a, b| a.gain.total_cmp(&b.gain));
        if let Some(push) = push {
            // When it was is told by what stood out: a force that grows and fades has no sharper times.
            best.fit = best.fit.with(problem, push.active);
            best.penalties.push(push.penalty);
        }
    }
    best
}

impl Context<'_> {
    /// Searches each recording by itself for what comes and goes in it; the reason why nothing can be said, if there is one.
    pub fn at_rest(
        &self,
        progress: &(dyn Fn(f64, &str) + Sync),
    ) -> Result<Result<Judged, String>, TermError> {
        let input = self.input;
        let joints: Vec<String> = input.model.joint_names().map(str::to_owned).collect();
        let rests_count = vec![true; joints.len()];
        let mut hypotheses = self.hypotheses();
        let passes = |h: &Hypothesis| h.time_kind() == TimeKind::Once;
        hypotheses.retain(passes);
        let say = |text: &str| progress(0.1, text);
        let (mut actives, mut undetectable) = (Vec::new(), Vec::new());
        let mut named = findings::Named::default();
        let known = |recording: &&Recording| !audit::is_frozen(recording, joints.len());
        for recording in input.fit.iter().filter(known) {
            let problem = self.problem(std::slice::from_ref(recording), &rests_count)?;
            let search = Search {
                problem: &problem,
                unnamed_bodies: &[],
                hypotheses: &hypotheses,
                say: &say,
            };
            let before = Fit::new(&problem, Vec::new());
            let found = pushes(&search);
            let mut own = findings::of(&search, &found, &before, input, &joints);
            // No motion tells more of a push that is over.
            own.next_motions.clear();
            own.trajectories.clear();
            named.extend(own);
            if undetectable.is_empty() {
                undetectable = findings::undetectable(&search, &found, input, &joints);
            }
            actives.extend(found.fit.actives);
        }
        if named.findings.is_empty() {
            return Ok(Err(
                "no joint moves for as long as a second: standstill does not tell friction from load".to_owned(),
            ));
        }
        named.notes.push(format!(
            "No joint moves: what lasts cannot be told from the load at rest, and what the arm bears in the first {BEGINNING_S} s of \
             each recording is taken for what it always bears there."
        ));
        if !self.unscaled.is_empty() {
            let of =
                |&(j, _): &(usize, f64)| format!("{} {} N m/A", joints[j], number(self.unit_nm[j]));
            let taken: Vec<String> = self.unscaled.iter().map(of).collect();
            named.notes.push(format!(
                "Nobody knows the scales of these drives, and forces hang on what they were taken for: {}.",
                taken.join(", ")
            ));
        }
        let problem = self.problem(&input.fit, &rests_count)?;
        Ok(Ok(Judged {
            before: Fit::new(&problem, Vec::new()),
            found: Fit::new(&problem, actives),
            named,
            undetectable,
            rests_count,
            problem,
        }))
    }
}
