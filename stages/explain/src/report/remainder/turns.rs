//! Whether a remainder jumps where joints turn round, as friction does that comes and goes.
//!
//! Friction that is there for a while only, or between two joints, is predicted by no curve. But where a joint turns round,
//! what it leaves jumps. Slow noise knows nothing of the motion: between two moments it changes by as much at a reversal as
//! anywhere else.

use tauscope_dynamics::terms::words::number;

use crate::data::problem::Problem;
use crate::data::track::FitTrack;
use crate::select::curve_axes::neighbours;

use super::Left;

/// What is compared lies at least this far from a reversal on either side \[s\].
/// Resolution: 1 / (2 pi 8 Hz) = 0.02 s is the comparison's response; three times that takes 95 % of a jump.
const BESIDE_S: f64 = 0.06;
/// And at most this far.
/// Tuned: by hand, as the longest rest at a point of a program; not swept.
const REACH_S: f64 = 1.0;
/// Fewer reversals show nothing.
/// Statistical: the mean square of eight jumps is known to a half.
const LEAST_TURNS: usize = 8;
/// Surrogates: the same moments, shifted.
/// Statistical: mean and standard deviation of 39 are known to 16 % of the deviation.
const SURROGATES: usize = 39;
/// What surrogates reach at most, in standard deviations above their mean.
/// Statistical: a Gumbel variable, as the largest of several is, exceeds this once in 300.
const BEYOND_CHANCE: f64 = 4.0;
/// The jumps must also have this many times the mean square of other changes over the same time.
/// Tuned: by hand; not swept.
const LEAST_RATIO: f64 = 2.0;

/// What jumps where joints turn round.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Turns {
    /// Half of the root mean square of the jumps \[N m or N\]: what changes its sign there.
    pub half_jump: f64,
    /// Where it jumps, in words.
    pub at: String,
}

/// What a joint leaves in one recording, row by row; `None` where it does not count.
type Series = Vec<Option<f64>>;

/// A change of a series: from one row to a later one of the same recording.
#[derive(Debug, Clone, Copy)]
struct Change {
    recording: usize,
    from: usize,
    rows: usize,
}

/// Where what is left at a joint jumps, if it does.
pub(super) fn turns(left: Left<'_>, joint: usize, names: &[String]) -> Option<Turns> {
    let problem = left.problem;
    let all = series(left, joint);
    let usual = Usual::of(&all);
    let mut kinds: Vec<(String, Signal)> = vec![("it turns round".to_owned(), Signal::Own(joint))];
    for first in neighbours(problem, joint) {
        let other = if first == joint { joint + 1 } else { first };
        let name = &names[other];
        kinds.push((format!("joint {name} turns round"), Signal::Own(other)));
        kinds.push((
            format!("joint {name} begins to move faster than it, or slower"),
            Signal::Difference(first),
        ));
    }
    let tried: Vec<(String, Vec<Change>)> = (kinds.into_iter())
        .map(|(words, signal)| (words, changes(problem, &all, signal)))
        .filter(|(_, changes)| changes.len() >= LEAST_TURNS)
        .collect();
    let most = |shift: Option<usize>| {
        let each = tried
            .iter()
            .map(|(_, changes)| usual.ratio(&all, changes, shift));
        each.fold(0.0, f64::max)
    };
    let by_chance: Vec<f64> = (1..=SURROGATES).map(|number| most(Some(number))).collect();
    let count = by_chance.len() as f64;
    let mean = by_chance.iter().sum::<f64>() / count;
    let variance = by_chance
        .iter()
        .map(|x| (x - mean) * (x - mean))
        .sum::<f64>()
        / count;
    let least = (mean + BEYOND_CHANCE * variance.sqrt()).max(LEAST_RATIO);
    let ratio = |changes: &[Change]| usual.ratio(&all, changes, None);
    let best = (tried.iter()).max_by(|(_, a), (_, b)| ratio(a).total_cmp(&ratio(b)));
    let (words, changes) = best.filter(|(_, changes)| ratio(changes) > least)?;
    let squares: Vec<f64> = (changes.iter())
        .filter_map(|change| change.square(&all, 0))
        .collect();
    let half_jump = 0.5 * (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    let times = number(ratio(changes).sqrt());
    Some(Turns {
        half_jump,
        at: format!(
            "what remains jumps where {words}, by {times} times as much as it changes elsewhere in the same time"
        ),
    })
}

/// What turns round.
#[derive(Debug, Clone, Copy)]
enum Signal {
    /// The velocity of a joint.
    Own(usize),
    /// That of a joint less that of the next one.
    Difference(usize),
}

fn series(left: Left<'_>, joint: usize) -> Vec<Series> {
    let (problem, first) = (left.problem, left.problem.joint_rows(joint).start);
    let of_track = |track: &FitTrack| {
        let value = |row: usize| {
            let at = first + row;
            (problem.weight[at] > 0.0).then(|| left.fit.residual[at])
        };
        track.rows().map(value).collect()
    };
    problem.tracks.iter().map(of_track).collect()
}

/// The changes of what is left from before to after each reversal of a signal.
fn changes(problem: &Problem, all: &[Series], signal: Signal) -> Vec<Change> {
    let mut changes = Vec::new();
    let n = problem.joints;
    for (recording, (track, series)) in problem.tracks.iter().zip(all).enumerate() {
        let time_s = |row: usize| track.track.time_s[track.compared[row]];
        let read = |k: usize| match signal {
            Signal::Own(joint) => track.track.velocity[k * n + joint],
            Signal::Difference(first) => {
                track.track.velocity[k * n + first] - track.track.velocity[k * n + first + 1]
            }
        };
        for k in 1..track.track.len() {
            if read(k - 1) * read(k) >= 0.0 {
                continue;
            }
            let turn_s = track.track.time_s[k];
            let near = |row: &usize| {
                let away_s = (time_s(*row) - turn_s).abs();
                series[*row].is_some() && (BESIDE_S..REACH_S).contains(&away_s)
            };
            let from = (0..series.len())
                .filter(near)
                .rfind(|row| time_s(*row) < turn_s);
            let to = (0..series.len())
                .filter(near)
                .find(|row| time_s(*row) > turn_s);
            if let (Some(from), Some(to)) = (from, to) {
                changes.push(Change {
                    recording,
                    from,
                    rows: to - from,
                });
            }
        }
    }
    changes
}

impl Change {
    /// The square of the change, `shift` rows later, turned round at the end of the recording.
    fn square(self, all: &[Series], shift: usize) -> Option<f64> {
        let series = &all[self.recording];
        let from = (self.from + shift) % series.len();
        let (before, after) = (series[from]?, (*series.get(from + self.rows)?)?);
        Some((after - before) * (after - before))
    }
}

/// Mean square of the change of a series over so many rows, anywhere.
struct Usual {
    squares: Vec<f64>,
}

impl Usual {
    fn of(all: &[Series]) -> Self {
        let longest = all.iter().map(Vec::len).max().unwrap_or(0);
        let over = |rows: usize| {
            let (mut sum, mut count) = (0.0, 0.0);
            for series in all {
                for pair in series.windows(rows + 1) {
                    if let (Some(before), Some(after)) = (pair[0], pair[rows]) {
                        sum += (after - before) * (after - before);
                        count += 1.0;
                    }
                }
            }
            sum / f64::max(count, 1.0)
        };
        Self {
            squares: (0..longest).map(over).collect(),
        }
    }

    /// Squares of changes over what is usual in the same time; all of them shifted by a share of their recording that the
    /// `surrogate`'s number gives, if it is one.
    fn ratio(&self, all: &[Series], changes: &[Change], surrogate: Option<usize>) -> f64 {
        let (mut sum, mut usual) = (0.0, 0.0);
        for change in changes {
            // Multiples of irrational numbers spread evenly, and are the same in every run.
            let share = surrogate.map_or(0.0, |number| {
                (number as f64 * 0.618_034 + change.recording as f64 * 0.414_214).fract()
            });
            let shift = (share * all[change.recording].len() as f64) as usize;
            if let Some(square) = change.square(all, shift) {
                sum += square;
                usual += self.squares[change.rows];
            }
        }
        if usual > 0.0 { sum / usual } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, model, problem, recording};

    /// What is said of the first joint's remainder where `add` is added to its effort, given the time and the velocities.
    fn said(seed: u64, mut add: impl FnMut(f64, &[f64]) -> f64) -> Option<Turns> {
        let model = model();
        let mut noise = Noise(seed);
        let recordings = [1, 2, 3].map(|motion| {
            let mut k = 0.0;
            recording(&model, 3 * seed + motion, |_, qd, effort| {
                k += 1.0;
                effort[0] += add(0.01 * k, qd) + 0.05 * noise.next();
                effort[1] += 0.05 * noise.next();
            })
        });
        let problem = problem(&model, &recordings);
        let fit = Fit::new(&problem, Vec::new());
        let left = Left {
            problem: &problem,
            fit: &fit,
        };
        turns(left, 0, &["shoulder".to_owned(), "elbow".to_owned()])
    }

    #[test]
    fn friction_that_comes_and_goes_jumps_where_its_joint_turns_round() {
        let touches = |t: f64| (1.9 * t).sin() + (3.07 * t + 1.0).sin() > 0.3;
        let found = said(1, |t, qd| if touches(t) { qd[0].signum() } else { 0.0 });
        let found = found.expect("it jumps");
        assert!(found.at.contains("where it turns round"), "{}", found.at);
        assert!(found.half_jump > 0.2 && found.half_jump < 1.1);
    }

    #[test]
    fn friction_against_a_neighbour_jumps_where_the_one_overtakes_the_other() {
        let found = said(2, |_, qd| (qd[0] - qd[1]).signum()).expect("it jumps");
        assert!(found.at.contains("faster than it"), "{}", found.at);
    }

    #[test]
    fn slow_noise_knows_nothing_of_reversals() {
        for seed in 1..=12 {
            let mut noise = Noise(100 + seed);
            let mut slow = 0.0;
            let fades = if seed % 2 == 0 { 0.999 } else { 0.98 };
            let found = said(seed, |_, _| {
                slow = fades * slow + 0.2 * noise.next();
                slow
            });
            assert_eq!(found, None, "seed {seed}");
        }
    }
}
