//! Another simulation as the twin: what its topic has that is no physics of the arm.
//!
//! It computes the effort of the *commanded* motion. So its effort is late or early against the measured one, has spikes
//! where its solver or its transport stumbles, and its friction turns when the command turns, while the real joint still
//! holds or creeps. Spikes are taken out, the effort is put on the clock of the recording, and rows where the two are in
//! different states of friction are left out.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::sign;

use crate::data::effective_samples::per_row;
use crate::data::problem::Problem;
use crate::data::track::{FitTrack, Track};
use crate::fit::least_squares::weighted_dot;
use crate::read::input::Input;
use crate::read::recording::Recording;

/// Samples to either side of one whose median tells a spike.
/// Resolution: a spike of up to two samples is seen, and a step in the effort stays as it is.
const SPIKE_REACH: usize = 2;
/// A spike is this many median deviations from its neighbours' median.
/// Statistical: a normal variable is ten standard deviations from its mean in none of 1e22 samples.
const SPIKE_DEVIATIONS: f64 = 15.0;
/// And at least this share of the range of the joint's effort.
/// Resolution: what is smaller than that changes no finding.
const SPIKE_SHARE: f64 = 0.01;
/// Latest effort of the other simulation that is looked for \[s\].
/// Physical: a few cycles of a bus at 50 Hz.
const LATEST_S: f64 = 0.06;
/// Steps of the search; between them a parabola is laid through the best three.
/// Resolution: a quarter of a sample at 100 Hz.
const STEP_S: f64 = 0.0025;
/// Evidence that a lateness needs \[nats\].
/// Statistical: odds of 20 000 to 1.
const LATE_EVIDENCE: f64 = 10.0;
/// Number of [`TAPS_S`].
const TAPS: usize = 4;
/// Times at which the other simulation's effort is weighed, to follow a joint that follows its command \[s\].
/// Resolution: twice the comparison's fastest response, 1 / (2 pi 8 Hz) = 0.02 s, in steps of that.
const TAPS_S: [f64; TAPS] = [-0.04, -0.02, 0.02, 0.04];
/// Time over which the other simulation's effort jumps when its friction turns \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_S: f64 = 0.06;
/// A jump is this many times what the effort changes just before and after.
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_TIMES: f64 = 3.0;
/// And at least this share of the range of the joint's effort.
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_SHARE: f64 = 0.02;
/// The real joint follows the command within this time \[s\].
/// Physical: a controller without integral part creeps for a second at most.
const FOLLOWS_S: f64 = 1.0;
/// A row is left out if its error is this many standard deviations of the calm half of the rows.
/// Statistical: a normal variable exceeds that once in 16 000 rows.
const LEFT_OUT: f64 = 4.0;
/// Median of the absolute value of a normal variable, in standard deviations.
/// Statistical: the 75 % quantile of the standard normal distribution.
const MEDIAN_OF_ABS_NORMAL: f64 = 0.6745;
/// A joint is fast above this share of its 90 % quantile of speed: there its friction and the command's have one sign.
/// Tuned: by hand, on no recorded seeds; not swept.
const FAST: f64 = 0.3;
/// No row is left out where the joint is faster than this share of that quantile.
/// Tuned: by hand, on no recorded seeds; not swept.
const NEVER: f64 = 0.6;
/// Rounds of the regression without the rows that it left out.
/// Resolution: further rounds change no row.
const ROUNDS: usize = 4;
/// Added to the diagonal of the scaled normal equations, which is 1.
/// Resolution: guards the inverse of dependent columns.
const RIDGE: f64 = 1e-6;

/// Takes the spikes out of the other simulation's effort.
fn take_out_spikes(recording: &mut Recording, joints: usize) {
    for joint in 0..joints {
        let own: Vec<f64> = (recording.reference.iter())
            .skip(joint)
            .step_by(joints)
            .copied()
            .collect();
        let medians: Vec<f64> = (0..own.len())
            .map(|k| {
                let (from, to) = (
                    k.saturating_sub(SPIKE_REACH),
                    (k + SPIKE_REACH).min(own.len() - 1),
                );
                median(own[from..=to].to_vec())
            })
            .collect();
        let off: Vec<f64> = own
            .iter()
            .zip(&medians)
            .map(|(x, m)| (x - m).abs())
            .collect();
        let most = SPIKE_DEVIATIONS * median(off.clone()) + SPIKE_SHARE * range(&own);
        let into = recording.reference.iter_mut().skip(joint).step_by(joints);
        for ((value, off), median) in into.zip(off).zip(medians) {
            if off > most {
                *value = median;
            }
        }
    }
}

/// By how much the other simulation's effort is late in the recordings of `problem` \[s\]; 0 if it is early or on time. A
/// recorded effort that is late is an effect of its own, `torque_delay`.
fn lateness_s(problem: &Problem) -> f64 {
    let columns: Vec<Vec<f64>> = plain_columns(problem);
    let unlikeliness = |late_s: f64| -> f64 {
        let twin: Vec<Vec<f64>> = (problem.tracks.iter())
            .map(|track| {
                earlier(
                    &track.track.time_s,
                    &track.track.rigid,
                    problem.joints,
                    late_s,
                )
            })
            .collect();
        let left: Vec<f64> = (problem.measured.iter())
            .zip(problem.signal(&twin))
            .map(|(measured, twin)| measured - twin)
            .collect();
        let of_joint = |joint: usize| {
            let weight = &problem.weight[problem.joint_rows(joint)];
            let left = regressed(problem, &columns, &left, joint, weight);
            let count: f64 = weight.iter().sum();
            let square: f64 = left.iter().zip(weight).map(|(x, w)| w * x * x).sum();
            let noise = problem.white_noise[joint].powi(2).max(f64::MIN_POSITIVE);
            let effective = problem.effective_samples[joint] * count;
            0.5 * effective * (square / count.max(1.0)).max(noise).ln()
        };
        (0..problem.joints).map(of_joint).sum()
    };
    let steps = (LATEST_S / STEP_S).round() as usize;
    let all: Vec<f64> = (0..=steps)
        .map(|k| unlikeliness(STEP_S * k as f64))
        .collect();
    let Some(best) = (0..all.len()).min_by(|a, b| all[*a].total_cmp(&all[*b])) else {
        return 0.0;
    };
    if best == 0 || all[0] - all[best] < LATE_EVIDENCE {
        return 0.0;
    }
    let Some(after) = all.get(best + 1) else {
        return STEP_S * best as f64;
    };
    let (slope, bend) = (
        after - all[best - 1],
        all[best - 1] - 2.0 * all[best] + after,
    );
    let shift = if bend > 0.0 { -0.5 * slope / bend } else { 0.0 };
    STEP_S * (best as f64 + shift.clamp(-0.5, 0.5))
}

/// Takes the spikes out of the other simulation's effort and puts it on the recordings' clock. Returns by how much it was
/// late \[s\]. `constants` convert the recordings' unit into the model's, and `unit_nm` into N m, by joint.
pub fn put_on_clock(input: &mut Input, constants: &[f64], unit_nm: &[f64]) -> f64 {
    let n = input.model.dof();
    for recording in input.fit.iter_mut().chain(&mut input.holdout) {
        take_out_spikes(recording, n);
    }
    let late_s = lateness_s(&prepared(input, constants, unit_nm));
    for recording in input.fit.iter_mut().chain(&mut input.holdout) {
        recording.reference = earlier(&recording.time_s, &recording.reference, n, late_s);
    }
    let mut problem = prepared(input, constants, unit_nm);
    leave_out_other_states(&mut problem);
    let taps: Vec<_> = (0..n).map(|joint| followed(&problem, joint)).collect();
    for recording in input.fit.iter_mut().chain(&mut input.holdout) {
        recording.reference = filtered(&recording.time_s, &recording.reference, &taps);
    }
    late_s
}

/// The data of a fit of the recordings in motion.
fn prepared(input: &Input, constants: &[f64], unit_nm: &[f64]) -> Problem {
    let cutoff_hz = Problem::cutoff_hz(&input.fit);
    let motion_hz = Problem::motion_cutoff_hz(cutoff_hz);
    let track = |recording| Track::new(recording, 0.0, &input.model, motion_hz, constants);
    let tracks = input.fit.iter().map(track).collect();
    let moving = vec![false; input.model.dof()];
    Problem::new(
        &input.model,
        &input.fit,
        tracks,
        cutoff_hz,
        unit_nm,
        &moving,
    )
}

/// `effort` (row-major) as the joints follow it: for each joint its weighted mean over [`TAPS_S`], by `taps`.
fn filtered(time_s: &[f64], effort: &[f64], taps: &[[f64; TAPS]]) -> Vec<f64> {
    let n = taps.len();
    let mut out = effort.to_vec();
    for (tap, shift_s) in TAPS_S.into_iter().enumerate() {
        let other = earlier(time_s, effort, n, shift_s);
        for (k, value) in out.iter_mut().enumerate() {
            *value += taps[k % n][tap] * (other[k] - effort[k]);
        }
    }
    out
}

/// How a joint follows its command: the weights of the other simulation's effort at [`TAPS_S`], the rest being that at the
/// instant itself. No weight is negative, and all are zero where that is no worse.
fn followed(problem: &Problem, joint: usize) -> [f64; TAPS] {
    let at = |shift_s: f64| {
        let shifted = |t: &FitTrack| {
            let time_s = &t.track.time_s;
            earlier(time_s, &t.track.rigid, problem.joints, shift_s)
        };
        problem.signal(&problem.tracks.iter().map(shifted).collect::<Vec<_>>())
    };
    let less = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x - y).collect::<Vec<_>>();
    let left = less(&problem.measured, problem.rigid());
    let beside = rich_columns(problem);
    let weight = &problem.weight[problem.joint_rows(joint)];
    let square = |columns: &[Vec<f64>]| {
        let left = regressed(problem, columns, &left, joint, weight);
        let square: f64 = left.iter().zip(weight).map(|(x, w)| w * x * x).sum();
        square.max(f64::MIN_POSITIVE)
    };
    let of_taps = TAPS_S.map(|shift_s| less(&at(shift_s), problem.rigid()));
    let mut used: Vec<usize> = (0..TAPS).collect();
    let (found, columns) = loop {
        let mut columns = beside.clone();
        columns.extend(used.iter().map(|&tap| of_taps[tap].clone()));
        let all = factors(problem, &columns, &left, joint, weight);
        let found = all.get(beside.len()..).unwrap_or_default().to_vec();
        let least = (0..found.len()).min_by(|a, b| found[*a].total_cmp(&found[*b]));
        match least {
            Some(least) if found[least] < 0.0 => {
                used.remove(least);
            }
            _ => break (found, columns),
        }
    };
    let mut taps = [0.0; TAPS];
    let effective = problem.effective_samples[joint] * weight.iter().sum::<f64>();
    let gained = 0.5 * effective * (square(&beside) / square(&columns)).ln();
    if gained >= LATE_EVIDENCE {
        let whole = found.iter().sum::<f64>().max(1.0);
        for (&tap, factor) in used.iter().zip(found) {
            taps[tap] = factor / whole;
        }
    }
    taps
}

/// `effort` (row-major) as it was `late_s` after each sample; the last one after the end.
fn earlier(time_s: &[f64], effort: &[f64], joints: usize, late_s: f64) -> Vec<f64> {
    let mut out = Vec::with_capacity(effort.len());
    let last = time_s.len().saturating_sub(1);
    let mut at = 0;
    for &t in time_s {
        while at < last && time_s[at + 1] <= t + late_s {
            at += 1;
        }
        let next = (at + 1).min(last);
        let span_s = time_s[next] - time_s[at];
        let share = if span_s > 0.0 {
            ((t + late_s - time_s[at]) / span_s).clamp(0.0, 1.0)
        } else {
            0.0
        };
        for joint in 0..joints {
            let (a, b) = (effort[at * joints + joint], effort[next * joints + joint]);
            out.push(a + share * (b - a));
        }
    }
    out
}

/// Leaves out the rows at which the other simulation's friction acts in another direction than the real one: near one of
/// its jumps, where the real joint is slow, and where no function of the joint's own state explains the error.
pub fn leave_out_other_states(problem: &mut Problem) {
    let columns = rich_columns(problem);
    let left: Vec<f64> = (problem.measured.iter())
        .zip(problem.rigid())
        .map(|(measured, twin)| measured - twin)
        .collect();
    let mut kept = problem.weight.clone();
    for joint in 0..problem.joints {
        let rows = problem.joint_rows(joint);
        let counted = problem.weight[rows.clone()].to_vec();
        let slow = slow_near_jumps(problem, joint);
        let fast = slow.speed.iter().zip(&counted);
        let mut weight: Vec<f64> = fast
            .map(|(speed, counts)| counts * f64::from(*speed > FAST * slow.usual))
            .collect();
        for _ in 0..ROUNDS {
            let own = regressed(problem, &columns, &left, joint, &weight);
            let used = own.iter().zip(&weight).filter(|(_, weight)| **weight > 0.0);
            let calm = median(used.map(|(error, _)| error.abs()).collect()) / MEDIAN_OF_ABS_NORMAL;
            let most = LEFT_OUT * calm.max(problem.white_noise[joint]);
            for (row, weight) in weight.iter_mut().enumerate() {
                let out = slow.near[row] && own[row].abs() > most;
                *weight = if out { 0.0 } else { counted[row] };
            }
        }
        kept[rows].copy_from_slice(&weight);
    }
    problem.weight = kept;
    problem.effective_samples = per_row(problem);
}

/// The rows of a joint near jumps of the other simulation's effort.
struct Slow {
    /// Whether a row is near a jump, and the joint not fast there.
    near: Vec<bool>,
    /// Speed by row \[rad/s\].
    speed: Vec<f64>,
    /// The 90 % quantile of speed where rows count \[rad/s\].
    usual: f64,
}

fn slow_near_jumps(problem: &Problem, joint: usize) -> Slow {
    let n = problem.joints;
    let (mut near, mut speed) = (vec![false; problem.rows], vec![0.0; problem.rows]);
    for track in &problem.tracks {
        let jumps = jumps_s(&track.track, joint, n);
        for (row, &k) in track.rows().zip(&track.compared) {
            let t = track.track.time_s[k];
            near[row] = jumps.iter().any(|jump| (jump - t).abs() < FOLLOWS_S);
            speed[row] = track.track.velocity[k * n + joint].abs();
        }
    }
    let weight = &problem.weight[problem.joint_rows(joint)];
    let counted = speed
        .iter()
        .zip(weight)
        .filter(|(_, weight)| **weight > 0.0);
    let mut sorted: Vec<f64> = counted.map(|(speed, _)| *speed).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() * 9 / 10).copied().unwrap_or(0.0);
    for (near, speed) in near.iter_mut().zip(&speed) {
        *near &= *speed < NEVER * usual;
    }
    Slow { near, speed, usual }
}

/// When the other simulation's effort of a joint jumps \[s\].
fn jumps_s(track: &Track, joint: usize, n: usize) -> Vec<f64> {
    let own: Vec<f64> = track.rigid.iter().skip(joint).step_by(n).copied().collect();
    let least = JUMP_SHARE * range(&own);
    let time = &track.time_s;
    let at = |t: f64| own[time.partition_point(|x| *x < t).min(own.len() - 1)];
    let change = |t: f64| (at(t + 0.5 * JUMP_S) - at(t - 0.5 * JUMP_S)).abs();
    let jumps = |t: &f64| {
        let beside = change(t - JUMP_S).max(change(t + JUMP_S));
        change(*t) > JUMP_TIMES * beside + least
    };
    time.iter().copied().filter(jumps).collect()
}

/// A number of each sample and joint as a signal.
fn signal_of(problem: &Problem, value: impl Fn(&Track, usize) -> f64) -> Vec<f64> {
    let n = problem.joints;
    let of = |track: &Track| (0..n * track.len()).map(|at| value(track, at)).collect();
    let all: Vec<Vec<f64>> = problem.tracks.iter().map(|t| of(&t.track)).collect();
    problem.signal(&all)
}

/// What two simulations of one arm may differ by at a joint: an offset, Coulomb and viscous friction.
fn plain_columns(problem: &Problem) -> Vec<Vec<f64>> {
    vec![
        signal_of(problem, |_, _| 1.0),
        signal_of(problem, |track, at| sign(track.velocity[at])),
        signal_of(problem, |track, at| track.velocity[at]),
    ]
}

/// The same with what effects in a joint depend on: acceleration, position and the twin's effort.
fn rich_columns(problem: &Problem) -> Vec<Vec<f64>> {
    let mut columns = plain_columns(problem);
    columns.push(signal_of(problem, |track, at| track.acceleration[at]));
    columns.push(signal_of(problem, |track, at| track.position[at]));
    columns.push(problem.rigid().to_vec());
    columns
}

/// What a regression on `columns` with these weights leaves of `signal` at a joint, at all rows.
fn regressed(
    problem: &Problem,
    columns: &[Vec<f64>],
    signal: &[f64],
    joint: usize,
    weight: &[f64],
) -> Vec<f64> {
    let rows = problem.joint_rows(joint);
    let mut left = signal[rows.clone()].to_vec();
    let factors = factors(problem, columns, signal, joint, weight);
    for (factor, column) in factors.into_iter().zip(columns) {
        for (left, value) in left.iter_mut().zip(&column[rows.clone()]) {
            *left -= factor * value;
        }
    }
    left
}

/// The factors of that regression; none if the columns are dependent.
fn factors(
    problem: &Problem,
    columns: &[Vec<f64>],
    signal: &[f64],
    joint: usize,
    weight: &[f64],
) -> Vec<f64> {
    let rows = problem.joint_rows(joint);
    let own: Vec<&[f64]> = columns.iter().map(|column| &column[rows.clone()]).collect();
    let signal = &signal[rows];
    let dot = |x: &[f64], y: &[f64]| weighted_dot(weight, x, y);
    let p = own.len();
    let scale: Vec<f64> = own
        .iter()
        .map(|x| dot(x, x).max(f64::MIN_POSITIVE.sqrt()).sqrt())
        .collect();
    let mut gram = DMatrix::from_fn(p, p, |a, b| dot(own[a], own[b]) / (scale[a] * scale[b]));
    for a in 0..p {
        gram[(a, a)] += RIDGE;
    }
    let right = DVector::from_fn(p, |a, _| dot(own[a], signal) / scale[a]);
    let Some(factored) = gram.cholesky() else {
        return Vec::new();
    };
    let theta = factored.solve(&right);
    (0..p).map(|a| theta[a] / scale[a]).collect()
}

/// The middle one; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// From the 1 % to the 99 % quantile.
fn range(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let last = sorted.len().saturating_sub(1) as f64;
        sorted.get((share * last) as usize).copied().unwrap_or(0.0)
    };
    at(0.99) - at(0.01)
}
