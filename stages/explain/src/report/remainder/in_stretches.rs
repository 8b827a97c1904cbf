//! Whether a remainder follows the motion within each stretch of time, by a factor that changes from one to the next.
//!
//! No curve predicts friction that comes and goes, or a scale that drifts, from one recording to another. But within a second
//! or two the one changes its sign with the direction of motion, and the other grows with the load. Slow noise does neither:
//! shifted against the motion it fits as well.

use tauscope_dynamics::terms::{MotionSample, sign};

use crate::data::problem::Problem;

use super::Left;
use super::turns::{Series, series};

/// Length of a stretch \[s\].
/// Physical: a move of a program and the next one, between which a joint turns round.
pub(super) const STRETCH_S: f64 = 2.0;
/// A stretch has at least this share of its rows.
/// Statistical: less may be all on one side of a reversal.
const LEAST_ROWS: f64 = 0.4;
/// Surrogates: the remainder, shifted against the motion.
/// Statistical: mean and standard deviation of 39 are known to 16 % of the deviation.
const SURROGATES: usize = 39;
/// What surrogates reach at most, in standard deviations above their mean.
/// Statistical: a Gumbel variable, as the largest of several is, exceeds this once in 300.
const BEYOND_CHANCE: f64 = 4.0;
/// What is left of a signal beside a straight line, as a share, where it tells anything.
/// Resolution: a signal that turns round at the very end of a stretch leaves as much.
const LEAST_LEFT: f64 = 0.05;
/// What a remainder goes with in stretches explains at least this share of its square beyond what surrogates do.
/// Tuned: as the share that a sum must predict; not swept.
const LEAST_SHARE: f64 = 0.1;

/// What a remainder goes with, in words, and the share of its square that surrogates do not reach.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct InStretches {
    pub share: f64,
    pub with: &'static str,
}

/// What a remainder may go with at a moment.
type Reading = fn(&MotionSample<'_>, usize, f64) -> f64;

/// What may come and go.
const SIGNALS: [(&str, Reading); 3] = [
    (
        "the direction of motion: friction that comes and goes",
        |at, joint, _| sign(at.velocity[joint]),
    ),
    ("the speed: a drag that comes and goes", |at, joint, _| {
        at.velocity[joint]
    }),
    ("the load: a scale that changes", |_, _, load| load),
];

/// What the remainder of a joint goes with in stretches, if it does.
pub(super) fn in_stretches(left: Left<'_>, joint: usize) -> Option<InStretches> {
    let all = series(left, joint);
    let load = left.fit.load(left.problem);
    let tried = SIGNALS.map(|(with, read)| {
        let signals = signals(left.problem, &load, joint, read);
        let at = |number: usize| share(left.problem, &all, &signals, number);
        let shares: Vec<f64> = (0..=SURROGATES).map(at).collect();
        (with, shares)
    });
    let most = |number: usize| tried.iter().map(|(_, s)| s[number]).fold(0.0, f64::max);
    let by_chance: Vec<f64> = (1..=SURROGATES).map(most).collect();
    let count = SURROGATES as f64;
    let mean = by_chance.iter().sum::<f64>() / count;
    let variance = by_chance.iter().map(|x| (x - mean) * (x - mean));
    let limit = mean + BEYOND_CHANCE * (variance.sum::<f64>() / count).sqrt();
    let (with, shares) = (tried.iter()).max_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]))?;
    let share = shares[0] - mean;
    (shares[0] > limit && share > LEAST_SHARE).then_some(InStretches { share, with })
}

/// A reading at the rows of each recording.
fn signals(problem: &Problem, load: &[Vec<f64>], joint: usize, read: Reading) -> Vec<Vec<f64>> {
    let of_track = |(track, load): (&crate::data::track::FitTrack, &Vec<f64>)| {
        let mut values = Vec::with_capacity(track.track.time_s.len());
        track.track.each(|k, at| {
            values.push(read(at, joint, load[k * problem.joints + joint]));
        });
        track.compared.iter().map(|&k| values[k]).collect()
    };
    problem.tracks.iter().zip(load).map(of_track).collect()
}

/// Share of the squares beside a straight line that a signal explains in stretches. The remainder is shifted by a share of
/// its recording that the number of the surrogate gives; 0 is none. Only rows that count here and there are compared, so that
/// standstills cut the remainder where they would.
fn share(problem: &Problem, all: &[Series], signals: &[Vec<f64>], number: usize) -> f64 {
    let (mut explained, mut total) = (0.0, 0.0);
    for (recording, (series, signal)) in all.iter().zip(signals).enumerate() {
        let track = &problem.tracks[recording];
        let time_s = |row: usize| track.track.time_s[track.compared[row]];
        let rows = series.len();
        if rows < 2 {
            continue;
        }
        // Multiples of irrational numbers spread evenly, and are the same in every run.
        let turn = (number as f64 * 0.618_034 + recording as f64 * 0.414_214).fract();
        let shift = if number == 0 {
            0
        } else {
            (turn * rows as f64) as usize
        };
        let length = STRETCH_S * (rows - 1) as f64 / (time_s(rows - 1) - time_s(0)).max(1e-9);
        let (length, step) = (length as usize, (0.5 * length) as usize);
        let mut from = 0;
        while step > 0 && from + length <= rows {
            let pairs: Vec<[f64; 3]> = (from..from + length)
                .filter_map(|row| {
                    let here = series[row].is_some();
                    let shifted = series[(row + shift) % rows]?;
                    here.then(|| [time_s(row) - time_s(from), signal[row], shifted])
                })
                .collect();
            if pairs.len() as f64 >= LEAST_ROWS * length as f64 {
                let (gain, square) = gain(&pairs);
                explained += gain;
                total += square;
            }
            from += step;
        }
    }
    if total > 0.0 { explained / total } else { 0.0 }
}

/// Squares of a remainder beside a straight line, and how many of them a signal explains. A row is time, signal, remainder.
fn gain(rows: &[[f64; 3]]) -> (f64, f64) {
    let count = rows.len() as f64;
    let mean = [0, 1, 2].map(|of| rows.iter().map(|row| row[of]).sum::<f64>() / count);
    let product = |a: usize, b: usize| -> f64 {
        let each = rows
            .iter()
            .map(|row| (row[a] - mean[a]) * (row[b] - mean[b]));
        each.sum()
    };
    let (tt, ts, ty) = (product(0, 0), product(0, 1), product(0, 2));
    let (ss, sy, yy) = (product(1, 1), product(1, 2), product(2, 2));
    if tt <= 0.0 {
        return (0.0, 0.0);
    }
    let (own, both, square) = (ss - ts * ts / tt, sy - ts * ty / tt, yy - ty * ty / tt);
    if own <= LEAST_LEFT * rows.iter().map(|row| row[1] * row[1]).sum::<f64>() {
        return (0.0, square.max(0.0));
    }
    (both * both / own, square.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{Noise, model, problem, recording};

    /// What is said of the first joint's remainder where `add` is added to its effort, given the time, the velocity and the
    /// effort.
    fn said(seed: u64, mut add: impl FnMut(f64, f64, f64) -> f64) -> Option<InStretches> {
        let model = model();
        let mut noise = Noise(seed);
        let recordings = [1, 2, 3].map(|motion| {
            let mut k = 0.0;
            recording(&model, 3 * seed + motion, |_, qd, effort| {
                k += 1.0;
                effort[0] += add(0.01 * k, qd[0], effort[0]) + 0.05 * noise.next();
                effort[1] += 0.05 * noise.next();
            })
        });
        let problem = problem(&model, &recordings);
        let fit = Fit::new(&problem, Vec::new());
        let left = Left {
            problem: &problem,
            fit: &fit,
        };
        in_stretches(left, 0)
    }

    #[test]
    fn friction_that_is_now_more_and_now_less_goes_with_the_direction_of_motion() {
        for seed in 1..=4 {
            let found = said(seed, |t, qd, _| {
                (0.5 + (1.9 * t).sin() + (3.07 * t + 1.0).sin()) * qd.signum()
            });
            let found = found.expect("it goes with the direction");
            assert!(found.with.contains("direction of motion"), "{found:?}");
        }
    }

    #[test]
    fn a_scale_that_wanders_goes_with_the_load() {
        let found = said(5, |t, _, load| 0.05 * (0.4 * t).sin() * load);
        let found = found.expect("it goes with the load");
        assert!(found.with.contains("load"), "{found:?}");
    }

    #[test]
    fn slow_noise_goes_with_nothing() {
        for seed in 1..=24 {
            let mut noise = Noise(100 + seed);
            let mut slow = 0.0;
            let fades = [0.999, 0.99, 0.97][seed as usize % 3];
            let found = said(seed, |_, _, _| {
                slow = fades * slow + 0.2 * noise.next();
                slow
            });
            assert_eq!(found, None, "seed {seed}");
        }
    }
}
