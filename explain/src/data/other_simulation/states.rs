//! Rows in which the joint of an external twin moves in one direction and the real joint in another, or not at all.

use crate::data::noise::MEDIAN_OF_ABS_NORMAL;
use crate::data::problem::Problem;
use crate::data::track::Track;

use super::regression::{median, range, regressed, rich_columns};

/// Duration of the jump of the external twin's effort when its friction reverses \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_S: f64 = 0.06;
/// Smallest ratio of a jump to the change of the effort just before and after.
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_TIMES: f64 = 3.0;
/// Smallest size of a jump, relative to the range of the joint's effort.
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_SHARE: f64 = 0.02;
/// Time within which the real joint follows the command \[s\].
/// Physical: a controller without integral part creeps for a second at most.
const FOLLOWS_S: f64 = 1.0;
/// Error above which a row is excluded, in standard deviations of the calmer half of the rows.
/// Statistical: a normal variable exceeds that once in 16 000 rows.
const LEFT_OUT: f64 = 4.0;
/// Speed, relative to the joint's 90 % quantile, above which its friction and that of the command have the same sign.
/// Tuned: by hand, on no recorded seeds; not swept.
const FAST: f64 = 0.3;
/// Speed, relative to the joint's 90 % quantile, above which no row is excluded.
/// Tuned: by hand, on no recorded seeds; not swept.
const NEVER: f64 = 0.6;
/// Iterations of the regression, each without the rows excluded by the last.
/// Resolution: further rounds change no row.
const ROUNDS: usize = 4;

/// Excludes the rows in which the external twin's friction acts in another direction than the real one: near one of
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
}

/// The rows of a joint near jumps of the external twin's effort.
struct Slow {
    /// Whether a row is near a jump and the joint is not fast there.
    near: Vec<bool>,
    /// Speed by row \[rad/s\].
    speed: Vec<f64>,
    /// 90 % quantile of the speed over the compared rows \[rad/s\].
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

/// Returns the times of the jumps of the external twin's effort at a joint \[s\].
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
