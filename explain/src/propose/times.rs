//! When an effect may have begun or ended: the most promising times, by running sums over the recordings.
//!
//! The sums take the residual of a fit as white and leave the fit's own numbers as they are, so they only rank times. The
//! objective of the inference compares the best of them.

use std::ops::Range;
use std::sync::Arc;

use tauscope_dynamics::terms::CoordinateKind;

use crate::data::column::{Column, Columns};
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::propose::intervals::{STEPS, intervals};
use crate::propose::running_sums::Sums;

/// Times that are kept of each effect. Resolution: the objective decides among them; more change the computing time.
const KEPT: usize = 3;
/// Shortest interval, in periods of the comparison's cutoff. Resolution: the filter smears what is shorter.
const SHORTEST_PERIODS: f64 = 3.0;
/// Shortest and longest step on which the ends of short intervals are searched \[s\]. Resolution: half the step costs four
/// times the time; times are refined afterwards.
const STEP_S: [f64; 2] = [0.05, 0.1];
/// Time before a recording at which an effect of the whole recording begins, and after it at which it ends \[s\].
/// Resolution: the ends lie where no row is.
const BESIDE_S: f64 = 0.02;
/// Time before and after the session at which an effect begins or ends that does not change in it \[s\].
/// Resolution: longer than any session, so that a recording that is held out lies within.
const FOR_GOOD_S: f64 = 1e6;
/// Changes that are at most this many steps apart are the same.
/// Resolution: refinement makes one time of both.
const SAME_STEPS: usize = 4;
/// The most promising shapes of an effect that depends on time, the best first: its times, with the factors at zero.
pub fn shapes(problem: &Problem, fit: &Fit, hypothesis: Hypothesis) -> Vec<Vec<f64>> {
    let count = hypothesis.effect.coordinates.len();
    let (columns, at) = always(problem, fit, hypothesis);
    let all = &columns.factors[..];
    let scan = Scan { problem, fit };
    let traits = &hypothesis.effect.traits;
    let times: Vec<Vec<f64>> = match hypothesis.time_kind() {
        TimeKind::Always => Vec::new(),
        // With the change before everything, the last factor's column is the whole effect.
        TimeKind::Step => scan.changes(&all[all.len().saturating_sub(1)..]),
        TimeKind::EveryRecording => scan.intervals(all, None),
        TimeKind::Once if traits.in_session => scan.moments(all),
        TimeKind::Once if traits.fills_recording => scan.recordings(all),
        TimeKind::Once => {
            let tracks = 0..problem.tracks.len();
            best(
                tracks.flat_map(|track| scan.ranked(all, Some(track))),
                |_, _| false,
            )
        }
    };
    let with = |times: Vec<f64>| {
        let mut shape = vec![0.0; count];
        for (c, time) in at.iter().zip(times) {
            shape[*c] = time;
        }
        shape
    };
    times.into_iter().map(with).collect()
}

/// Reduction of the squares of a fit by the best factors of an effect that acts in an interval of one recording \[s\].
pub fn gain(
    problem: &Problem,
    fit: &Fit,
    hypothesis: Hypothesis,
    track: usize,
    interval_s: (f64, f64),
) -> f64 {
    let (columns, _) = always(problem, fit, hypothesis);
    let time_s = &problem.tracks[track].track.time_s;
    let (from_s, to_s) = interval_s;
    // Before it, within it, and after it.
    let bin_of = |_, k: usize| usize::from(time_s[k] >= from_s) + usize::from(time_s[k] >= to_s);
    let sums = Sums::new((problem, fit), &columns.factors, &[track], 3, bin_of);
    sums.gain(&(1..2))
}

/// The columns of an effect that acts all the time, and which of its coordinates are times.
fn always(problem: &Problem, fit: &Fit, hypothesis: Hypothesis) -> (Arc<Columns>, Vec<usize>) {
    let count = hypothesis.effect.coordinates.len();
    let is_time = |c: &usize| {
        matches!(
            hypothesis.effect.coordinates[*c].kind,
            CoordinateKind::RecordingTime | CoordinateKind::SessionTime
        )
    };
    let at: Vec<usize> = (0..count).filter(is_time).collect();
    let mut shape = vec![0.0; count];
    for (c, value) in at.iter().zip([f64::NEG_INFINITY, f64::INFINITY]) {
        shape[*c] = value;
    }
    (fit.columns(problem, hypothesis, &shape), at)
}

/// The effect in an interval of recording time of one recording \[s\], with its factors at zero.
pub fn within(
    problem: &Problem,
    hypothesis: Hypothesis,
    track: usize,
    (from_s, to_s): (f64, f64),
) -> Active {
    let session_s = problem.tracks[track].track.session_s;
    let count = hypothesis.effect.coordinates.len();
    let mut coordinates = vec![0.0; count];
    let times = (0..count).filter(|c| !hypothesis.factors().contains(c));
    for (c, time_s) in times.zip([from_s, to_s]) {
        coordinates[c] = session_s + time_s;
    }
    hypothesis.with(coordinates)
}

/// The candidates with the largest gains, of those that are near to each other only the best.
fn best<T>(all: impl Iterator<Item = (f64, T)>, is_near: impl Fn(&T, &T) -> bool) -> Vec<T> {
    let mut all: Vec<(f64, T)> = all.collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<T> = Vec::new();
    for (_, candidate) in all {
        if kept.len() < KEPT && !kept.iter().any(|other| is_near(other, &candidate)) {
            kept.push(candidate);
        }
    }
    kept
}

/// A scan over the times of recordings for what a fit leaves.
struct Scan<'a> {
    problem: &'a Problem,
    fit: &'a Fit,
}

impl Scan<'_> {
    /// Beginning and end of intervals of recording time, in one recording or in all \[s; of one recording in session time\].
    fn intervals(&self, columns: &[Arc<Column>], only: Option<usize>) -> Vec<Vec<f64>> {
        best(self.ranked(columns, only).into_iter(), |_, _| false)
    }

    /// Such intervals with their gains, best first.
    fn ranked(&self, columns: &[Arc<Column>], only: Option<usize>) -> Vec<(f64, Vec<f64>)> {
        let problem = self.problem;
        let all: Vec<usize> = (0..problem.tracks.len()).collect();
        let tracks = only.map_or(all, |track| vec![track]);
        let longest_s = tracks.iter().map(|r| self.length_s(*r)).fold(0.0, f64::max);
        let bin_s = (longest_s / STEPS as f64).clamp(STEP_S[0], STEP_S[1]);
        let bins = (longest_s / bin_s).ceil() as usize + 1;
        let bin_of = |r: usize, k: usize| (problem.tracks[r].track.time_s[k] / bin_s) as usize;
        let sums = Sums::new((problem, self.fit), columns, &tracks, bins, bin_of);
        let shortest_s = SHORTEST_PERIODS / problem.cutoff_hz;
        let shortest = ((shortest_s / bin_s).ceil() as usize).max(1);
        let scored = intervals(bins, shortest).into_iter();
        let scored = scored.map(|steps| {
            let gain = sums.gain(&(steps.from..steps.to));
            (gain, (gain, steps))
        });
        // An interval that overlaps with the best describes the same event.
        let kept = best(scored, |a, b| a.1.overlaps(&b.1)).into_iter();
        let session_s = only.map_or(0.0, |track| problem.tracks[track].track.session_s);
        let at_s = |step: usize| session_s + step as f64 * bin_s;
        kept.map(|(gain, steps)| (gain, vec![at_s(steps.from), at_s(steps.to)]))
            .collect()
    }

    /// Times of the session at which something changed for good.
    fn changes(&self, column: &[Arc<Column>]) -> Vec<Vec<f64>> {
        let (session, sums) = self.session(column);
        let changes = (1..session.bins).map(|bin| {
            let gain = sums.gain(&(0..bin)) + sums.gain(&(bin..session.bins));
            (gain, bin)
        });
        let kept = best(changes, |a, b| a.abs_diff(*b) <= SAME_STEPS).into_iter();
        kept.map(|bin| vec![session.at_s(bin)]).collect()
    }

    /// Times of the session up to which something acts, or from which on.
    fn moments(&self, columns: &[Arc<Column>]) -> Vec<Vec<f64>> {
        let (session, sums) = self.session(columns);
        let parts = (1..session.bins).flat_map(|bin| [0..bin, bin..session.bins]);
        let parts = parts.map(|part| (sums.gain(&part), part));
        let is_near = |a: &Range<usize>, b: &Range<usize>| {
            a.start.abs_diff(b.start) + a.end.abs_diff(b.end) <= SAME_STEPS
        };
        let times = |part: Range<usize>| {
            let starts = part.start > 0;
            let ends = part.end < session.bins;
            vec![
                if starts {
                    session.at_s(part.start)
                } else {
                    -FOR_GOOD_S
                },
                if ends {
                    session.at_s(part.end)
                } else {
                    FOR_GOOD_S
                },
            ]
        };
        best(parts, is_near).into_iter().map(times).collect()
    }

    /// Beginning and end of one recording, where there are others.
    fn recordings(&self, columns: &[Arc<Column>]) -> Vec<Vec<f64>> {
        let (session, sums) = self.session(columns);
        let tracks = session.order.iter().enumerate();
        let gains = tracks.map(|(at, &track)| {
            let gain = sums.gain(&(at * STEPS..(at + 1) * STEPS));
            let session_s = self.problem.tracks[track].track.session_s;
            let end_s = session_s + self.length_s(track);
            (gain, vec![session_s - BESIDE_S, end_s + BESIDE_S])
        });
        if session.order.len() < 2 {
            return Vec::new();
        }
        best(gains, |_, _| false)
    }

    /// Bins of even length within each recording, in the order of the session, and sums over them.
    fn session(&self, columns: &[Arc<Column>]) -> (Session, Sums) {
        let tracks = &self.problem.tracks;
        let session_s = |r: usize| tracks[r].track.session_s;
        let mut order: Vec<usize> = (0..tracks.len()).collect();
        order.sort_by(|&a, &b| session_s(a).total_cmp(&session_s(b)));
        let mut place = vec![0; order.len()];
        for (at, &track) in order.iter().enumerate() {
            place[track] = at;
        }
        let step_s = |r: usize| (self.length_s(r) + BESIDE_S) / STEPS as f64;
        let bin_of = |r: usize, k: usize| {
            let step = (tracks[r].track.time_s[k] / step_s(r)) as usize;
            place[r] * STEPS + step.min(STEPS - 1)
        };
        let bins = order.len() * STEPS;
        let sums = Sums::new((self.problem, self.fit), columns, &order, bins, bin_of);
        let steps = order.iter().map(|&r| (session_s(r), step_s(r))).collect();
        (Session { order, bins, steps }, sums)
    }

    /// Duration of a recording \[s\].
    fn length_s(&self, track: usize) -> f64 {
        let time_s = &self.problem.tracks[track].track.time_s;
        time_s.last().copied().unwrap_or(0.0)
    }
}

/// Bins of a session: [`STEPS`] in each recording.
struct Session {
    /// Recordings in the order of the session.
    order: Vec<usize>,
    bins: usize,
    /// Beginning and step of each recording, in the order of the session \[s\].
    steps: Vec<(f64, f64)>,
}

impl Session {
    /// When a bin begins \[s of the session\].
    fn at_s(&self, bin: usize) -> f64 {
        let (begin_s, step_s) = self.steps[bin / STEPS];
        begin_s + (bin % STEPS) as f64 * step_s
    }
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;
    use tauscope_dynamics::{Inertia, Model};

    use super::*;
    use crate::fixture::{Noise, at_joint, model, problem, problem_with, recording};
    use crate::physics::active::Whereabouts;

    /// The best times for a load of 2 kg that the small arm carries in the first `with` of three recordings.
    fn carried(with: usize) -> [f64; 2] {
        let bare = model();
        let tool = bare.tool_link();
        let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
        let recordings: Vec<_> = (0..3)
            .map(|k| {
                let mut robot: Model = bare.clone();
                if k < with {
                    robot.attach(tool, Inertia::new(2.0, [0.0, 0.0, 0.1], [0.0; 6]));
                }
                recording(&robot, 3 + k as u64, |_, _, effort| {
                    for x in effort {
                        *x += 0.05 * noise.next();
                    }
                })
            })
            .collect();
        let problem = problem(&bare, &recordings);
        let hypothesis = Hypothesis {
            effect: effect("payload_in_session").unwrap(),
            place: Whereabouts {
                link: tool,
                ..Whereabouts::default()
            },
        };
        let nothing = Fit::new(&problem, Vec::new());
        let shape = &shapes(&problem, &nothing, hypothesis)[0];
        let [.., from_s, to_s] = shape[..] else {
            panic!("two times");
        };
        let session_s = |k: usize| problem.tracks[k].track.session_s;
        assert!(
            session_s(with - 1) < to_s && to_s <= session_s(with),
            "{to_s}"
        );
        [from_s, to_s]
    }

    #[test]
    fn what_is_put_down_between_two_recordings_is_carried_up_to_then() {
        for with in [1, 2] {
            assert!(carried(with)[0] < -1.0);
        }
    }

    #[test]
    fn what_changes_once_is_proposed_at_that_time() {
        for name in ["friction_step", "viscous_step", "bias_step", "gain_step"] {
            let mut samples = 0;
            let problem = problem_with(6, |_, qd, effort| {
                samples += 1;
                let size = [0.5, 1.5][usize::from(samples > 1200)];
                effort[1] += match name {
                    "friction_step" => size * qd[1].signum(),
                    "viscous_step" => size * qd[1],
                    "bias_step" => size,
                    _ => 0.2 * size * effort[1],
                };
            });
            let nothing = Fit::new(&problem, Vec::new());
            let shape = &shapes(&problem, &nothing, at_joint(name, 1))[0];
            let at_s = shape[shape.len() - 1];
            let truth_s = problem.tracks[0].track.session_s + 12.0;
            assert!((at_s - truth_s).abs() < 0.5, "{name}: {at_s} s");
        }
    }
}
