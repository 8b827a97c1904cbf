//! Preparation of the effort of an external twin: another simulation, whose effort comes from a topic.
//!
//! It computes the effort of the *commanded* motion. So its effort leads or lags the measured one, has spikes where
//! its solver or its transport stalls, and its friction reverses with the command while the real joint still sticks
//! or creeps. Spikes are removed, the effort is aligned with the clock of the recording, and rows in which the two
//! are in different states of friction are excluded.

mod regression;
mod states;

use crate::data::problem::Problem;
use crate::data::track::{FitTrack, Track};
use crate::read::input::Input;
use crate::read::recording::Recording;

use regression::{
    factors, independent_rows, median, plain_columns, range, regressed, rich_columns,
};
pub use states::leave_out_other_states;

/// Half width of the running median that detects spikes \[samples\].
/// Resolution: a spike of up to two samples is seen, and a step in the effort stays as it is.
const SPIKE_REACH: usize = 2;
/// Smallest deviation of a spike from the running median, in median absolute deviations.
/// Statistical: a normal variable is ten standard deviations from its mean in none of 1e22 samples.
const SPIKE_DEVIATIONS: f64 = 15.0;
/// Smallest deviation of a spike, relative to the range of the joint's effort.
/// Resolution: what is smaller than that changes no finding.
const SPIKE_SHARE: f64 = 0.01;
/// Largest delay of the external twin's effort in the search \[s\].
/// Physical: a few cycles of a bus at 50 Hz.
const LATEST_S: f64 = 0.06;
/// Step of the search, refined by a parabola through the best three steps \[s\].
/// Resolution: a quarter of a sample at 100 Hz.
const STEP_S: f64 = 0.0025;
/// Evidence required to accept a delay \[nats\].
/// Statistical: odds of 20 000 to 1.
const LATE_EVIDENCE: f64 = 10.0;
/// Number of [`TAPS_S`].
const TAPS: usize = 4;
/// Time shifts of the external twin's effort in the model of a joint that lags or leads its command \[s\].
/// Resolution: twice the comparison's fastest response, 1 / (2 pi 8 Hz) = 0.02 s, in steps of that.
const TAPS_S: [f64; TAPS] = [-0.04, -0.02, 0.02, 0.04];

/// Replaces spikes in the external twin's effort by the running median.
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

/// Estimates the delay of the external twin's effort in the recordings of `problem` \[s\]; 0 if it is early or on
/// time. A delay of the recorded effort is an effect of its own, `torque_delay`.
fn lateness_s(problem: &Problem) -> f64 {
    let columns: Vec<Vec<f64>> = plain_columns(problem);
    let on_time: Vec<f64> = (problem.measured.iter())
        .zip(problem.rigid())
        .map(|(measured, twin)| measured - twin)
        .collect();
    let rows = |joint: usize| {
        let weight = &problem.weight[problem.joint_rows(joint)];
        let left = regressed(problem, &columns, &on_time, joint, weight);
        independent_rows(&left, weight)
    };
    let rows: Vec<f64> = (0..problem.joints).map(rows).collect();
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
            0.5 * rows[joint] * (square / count.max(1.0)).max(noise).ln()
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

/// Removes the spikes of the external twin's effort and aligns it with the clock of the recordings. Returns its delay
/// \[s\]. `constants` convert the recordings' unit into the model's, and `unit_nm` into N m, by joint.
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

/// Prepares the recordings for a fit without standstills.
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

/// Returns `effort` (row-major) as the joints follow it: for each joint its weighted mean over [`TAPS_S`], by `taps`.
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

/// Estimates the response of a joint to its command as weights of the external twin's effort at [`TAPS_S`]; the
/// remaining weight applies to the instant itself. The weights are not negative, and all are zero unless they
/// increase the evidence by [`LATE_EVIDENCE`].
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
    let plain = regressed(problem, &beside, &left, joint, weight);
    let rows = independent_rows(&plain, weight);
    let gained = 0.5 * rows * (square(&beside) / square(&columns)).ln();
    if gained >= LATE_EVIDENCE {
        let whole = found.iter().sum::<f64>().max(1.0);
        for (&tap, factor) in used.iter().zip(found) {
            taps[tap] = factor / whole;
        }
    }
    taps
}

/// Returns `effort` (row-major) interpolated at `late_s` after each sample; beyond the end, the last sample.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Noise, model, problem, recording};

    /// Recordings whose twin is another simulation: `late` samples late, with friction of its own.
    fn recordings(late: usize) -> Vec<Recording> {
        let model = model();
        let mut noise = Noise(3);
        let mut all: Vec<Recording> = (1..4)
            .map(|seed| recording(&model, seed, |_, _, _| {}))
            .collect();
        for recording in &mut all {
            let exact = recording.effort.clone();
            let last = recording.len() - 1;
            recording.reference = (0..exact.len())
                .map(|at| {
                    let (k, joint) = (at / 2, at % 2);
                    let then = k.saturating_sub(late).min(last);
                    exact[then * 2 + joint] + 0.4 * recording.velocity[then * 2 + joint].signum()
                })
                .collect();
            for effort in &mut recording.effort {
                *effort += 0.02 * noise.next();
            }
        }
        all
    }

    #[test]
    fn the_lateness_of_another_simulation_is_found_and_none_where_there_is_none() {
        for late in [0, 2] {
            let found = lateness_s(&problem(&model(), &recordings(late)));
            let true_s = 0.01 * late as f64;
            assert!((found - true_s).abs() < 0.002, "{found} s for {true_s} s");
        }
    }

    #[test]
    fn a_spike_is_taken_out_and_a_step_stays() {
        let mut recording = recordings(0).remove(0);
        let exact = recording.reference.clone();
        recording.reference[2 * 700] += 60.0;
        take_out_spikes(&mut recording, 2);
        let changed = exact.iter().zip(&recording.reference);
        let most = changed.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 1.0, "{most} N m");
    }

    /// Friction that is large compared with the change of gravity's effort \[N m\].
    const FRICTION_NM: f64 = 15.0;

    #[test]
    fn rows_where_only_the_command_has_turned_are_left_out() {
        let mut all = recordings(0);
        for recording in &mut all {
            // The real friction reverses a tenth of a second after that of the command.
            for k in 10..recording.len() {
                let then = recording.velocity[2 * (k - 10)].signum();
                recording.effort[2 * k] += FRICTION_NM * then;
                recording.reference[2 * k] += FRICTION_NM * recording.velocity[2 * k].signum();
            }
        }
        let mut data = problem(&model(), &all);
        let before: f64 = data.weight.iter().sum();
        leave_out_other_states(&mut data);
        let after: f64 = data.weight.iter().sum();
        assert!(
            after < 0.98 * before && after > 0.6 * before,
            "{after} of {before}"
        );
    }
}
