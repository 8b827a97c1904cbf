//! Preparation of recordings as the data of a fit.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use tauscope_dynamics::Model;

use crate::data::noise::of_effort;
use crate::data::problem::Problem;
use crate::data::smoother::LowPass;
use crate::data::track::{FitTrack, Track, moving_joints, spaced, thinned};
use crate::read::audit::is_unmeasured;
use crate::read::recording::Recording;

/// Cutoff of the comparison of efforts; [`CUTOFF_OF_RATE`] applies where recordings are slow \[Hz\].
/// Physical: above the motion of an arm, up to 2 Hz with its harmonics, and below the first resonances of its gears,
/// 10 to 30 Hz.
const CUTOFF_HZ: f64 = 8.0;
/// Upper bound of the cutoff, relative to the sample rate.
/// Derived: the motion's smoother, at twice the cutoff, then passes 1 / (1 + 2.5^6) = 0.4 % at the Nyquist frequency.
const CUTOFF_OF_RATE: f64 = 0.1;
/// Cutoff over sample rate for recordings of poses, which no filter may mix. Derived: at half the rate, the Nyquist
/// frequency, the filter's response `1 / (1 + (f / fc)^6)` is then above 0.999.
const POSES_OF_RATE: f64 = 2.0;
/// Cutoff of the motion's smoother, relative to that of the comparison.
/// Physical: a smoother with the response `1 / (1 + (f / fc)^6)` still passes 98 % at half its cutoff.
const MOTION_CUTOFF_RATIO: f64 = 2.0;
/// Range of the sample rate that recordings are thinned to for the fit \[Hz\].
/// Resolution: changes the computing time; twice the highest cutoff at the least.
const FIT_RATE_HZ: [f64; 2] = [50.0, 130.0];
/// Number of samples per joint above which a session is thinned below the upper rate.
/// Resolution: changes the computing time.
const FIT_SAMPLES: f64 = 8000.0;
/// Cutoff of the anti-aliasing filter before thinning, relative to that of the comparison.
/// Resolution: the filter passes all that the comparison does, and stops what thinning would fold.
const ALIASING_RATIO: f64 = 5.0;
/// Noise bandwidth of the comparison's filter over its cutoff.
/// Statistical: the integral of the squared response `1 / (1 + x^6)` from zero on, 5/6 of π/6 over its sine.
const NOISE_BANDWIDTH: f64 = 0.873;

/// Finest relative resolution of an effort, as a share of the largest one.
/// Resolution: that of a number in single precision.
const RESOLUTION: f64 = 1e-7;

impl Problem {
    /// Returns the frequency below which these recordings are compared \[Hz\].
    pub fn cutoff_hz(recordings: &[Recording]) -> f64 {
        let of = |recording: &Recording| {
            let share = if recording.is_of_poses() {
                POSES_OF_RATE
            } else {
                CUTOFF_OF_RATE
            };
            share * recording.rate_hz()
        };
        recordings.iter().map(of).fold(CUTOFF_HZ, f64::min)
    }

    /// Returns the half-amplitude frequency of the motion's smoother for a comparison below `cutoff_hz` \[Hz\].
    pub fn motion_cutoff_hz(cutoff_hz: f64) -> f64 {
        MOTION_CUTOFF_RATIO * cutoff_hz
    }

    /// Prepares recordings with effort, and their `tracks` at all samples, for a fit below `cutoff_hz`; `unit_nm`
    /// turns the recordings' unit into N m, by joint. Standstills of the joints in `rests_count` are compared, too.
    pub fn new(
        model: &Model,
        recordings: &[Recording],
        tracks: Vec<Track>,
        cutoff_hz: f64,
        unit_nm: &[f64],
        rests_count: &[bool],
    ) -> Self {
        let n = model.dof();
        let mut problem = Self::empty(model, cutoff_hz);
        let (mut measured, mut weight) = (Vec::new(), Vec::new());
        let mut variances = vec![Vec::new(); n];
        let total_s: f64 = recordings.iter().map(Recording::duration_s).sum();
        let fit_rate_hz = (FIT_SAMPLES / total_s).clamp(FIT_RATE_HZ[0], FIT_RATE_HZ[1]);
        let tracks: Vec<(Track, Track, Vec<usize>)> = tracks
            .into_iter()
            .map(|full| {
                let kept = thinned(&full.time_s, 1.0 / fit_rate_hz);
                (full.thin(&kept, n), full, kept)
            })
            .collect();
        let moves = moving_joints(tracks.iter().map(|(track, _, _)| track), n);
        for (recording, (track, full, kept)) in recordings.iter().zip(tracks) {
            let compared = spaced(&track.time_s, 0.5 / cutoff_hz);
            let mut filters = Vec::with_capacity(n);
            let gaps = full.gaps(cutoff_hz);
            for j in 0..n {
                let mut counts = track.counts(j, moves[j] && !rests_count[j], &gaps, cutoff_hz);
                leave_out_unmeasured(&mut counts, recording, j, n);
                let filter = LowPass::weighted(&track.time_s, cutoff_hz, |k| counts[k]);
                let of_joint = (0..full.len()).map(|k| k * n + j);
                let own = recording.effort[j..].iter().step_by(n).take(full.len());
                let largest = &mut problem.largest_effort[j];
                *largest = own.fold(*largest, |most, x| most.max((x * unit_nm[j]).abs()));
                let mut signal: Vec<f64> = of_joint
                    .map(|at| (recording.effort[at] - full.beside[at]) * unit_nm[j])
                    .collect();
                // Fourth differences between poses are caused by gravity, not noise. The inference estimates the
                // noise of poses.
                let (white, new) = if recording.is_of_poses() {
                    (0.0, 1.0)
                } else {
                    of_effort(&signal)
                };
                let rate = new * recording.rate_hz();
                let share = (cutoff_hz * NOISE_BANDWIDTH / (0.5 * rate)).min(1.0);
                variances[j].push(white * share);
                if kept.len() < full.len() {
                    // Prevents aliasing.
                    LowPass::new(&full.time_s, ALIASING_RATIO * cutoff_hz).apply(&mut signal);
                }
                let mut signal: Vec<f64> = kept.iter().map(|&k| signal[k]).collect();
                filter.apply(&mut signal);
                measured.push(compared.iter().map(|&k| signal[k]).collect::<Vec<_>>());
                let counted = compared.iter().map(|&k| f64::from(counts[k]));
                weight.push(counted.collect::<Vec<_>>());
                filters.push(filter);
            }
            let first_row = problem.rows;
            problem.rows += compared.len();
            problem.tracks.push(FitTrack {
                track,
                filters,
                compared,
                first_row,
            });
        }
        for j in 0..n {
            for r in 0..recordings.len() {
                problem.measured.extend(&measured[r * n + j]);
                problem.weight.extend(&weight[r * n + j]);
            }
            variances[j].sort_by(f64::total_cmp);
            let variance = variances[j][variances[j].len() / 2];
            problem.white_noise[j] = deviation(variance, problem.largest_effort[j]);
            problem.position_gaps[j] = middle_gap(positions(&problem.tracks, j, n));
        }
        problem
    }

    /// Creates a problem without recordings.
    fn empty(model: &Model, cutoff_hz: f64) -> Self {
        let n = model.dof();
        Self {
            model: model.clone(),
            joints: n,
            tracks: Vec::new(),
            rows: 0,
            measured: Vec::new(),
            weight: Vec::new(),
            white_noise: vec![0.0; n],
            largest_effort: vec![0.0; n],
            position_gaps: vec![0.0; n],
            cutoff_hz,
            known_friction: vec![BTreeMap::new(); n],
            states_friction: false,
            is_foreign: false,
            first_gains: vec![1.0; model.dof()],
            cache: Arc::default(),
            units: Arc::default(),
            bare: OnceLock::new(),
            rigid: OnceLock::new(),
            recorded: OnceLock::new(),
            expansions: vec![OnceLock::new(); n],
        }
    }
}

/// Excludes all rows of a joint in a recording that does not measure its effort.
fn leave_out_unmeasured(counts: &mut [bool], recording: &Recording, joint: usize, n: usize) {
    if is_unmeasured(recording, joint, n) {
        counts.fill(false);
    }
}

/// Returns the positions of a joint in all recordings.
fn positions(tracks: &[FitTrack], joint: usize, n: usize) -> Vec<f64> {
    let all = tracks
        .iter()
        .flat_map(|track| track.track.position.chunks_exact(n));
    all.map(|row| row[joint]).collect()
}

/// Returns the median gap between neighbouring positions, weighted by length: half of the joint's range has smaller
/// gaps.
fn middle_gap(mut positions: Vec<f64>) -> f64 {
    positions.sort_by(f64::total_cmp);
    let mut gaps: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_by(|a, b| b.total_cmp(a));
    let half = 0.5 * gaps.iter().sum::<f64>();
    let mut covered = 0.0;
    let reaches = |gap: &&f64| {
        covered += **gap;
        covered >= half
    };
    gaps.iter().find(reaches).copied().unwrap_or(0.0)
}

/// Returns the standard deviation of a noise, bounded below by the resolution of the effort.
fn deviation(variance: f64, largest_effort: f64) -> f64 {
    variance.sqrt().max(RESOLUTION * largest_effort)
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::{Data, gravity_effort};

    use crate::fixture::{model, problem, recording};

    #[test]
    fn the_gap_of_a_motion_is_small_and_that_of_poses_is_their_distance() {
        let motion = (0..1000).map(|k| (0.01 * f64::from(k)).sin()).collect();
        assert!(super::middle_gap(motion) < 0.005);
        let poses = (0..200).map(|k| 0.2 * f64::from(k % 10) + 1e-5 * f64::from(k));
        let gap = super::middle_gap(poses.collect());
        assert!((gap - 0.2).abs() < 0.01, "{gap}");
    }

    /// A log with one row per pose, whose time counts the rows: the effort of a pose is compared with the gravity
    /// there.
    #[test]
    fn poses_are_compared_as_they_are() {
        let model = model();
        let mut held = recording(&model, 3, |_, _, _| {});
        let mut data = Data::new(&model);
        held.time_s = (0..held.len()).map(|k| k as f64).collect();
        for (effort, position) in
            (held.effort.chunks_exact_mut(2)).zip(held.position.chunks_exact(2))
        {
            effort.copy_from_slice(gravity_effort(&model, &mut data, position));
            effort[1] += 0.4;
        }
        let problem = problem(&model, &[held]);
        let left = |joint: usize| -> Vec<f64> {
            let rows = problem.joint_rows(joint);
            let pairs = problem.measured[rows.clone()]
                .iter()
                .zip(&problem.rigid()[rows.clone()]);
            let counted = pairs
                .zip(&problem.weight[rows])
                .filter(|(_, weight)| **weight > 0.0);
            counted
                .map(|((measured, rigid), _)| measured - rigid)
                .collect()
        };
        for (joint, offset) in [(0, 0.0), (1, 0.4)] {
            let left = left(joint);
            assert!(left.len() > 1900, "{}", left.len());
            let worst = left
                .iter()
                .fold(0.0_f64, |most, x| most.max((x - offset).abs()));
            assert!(worst < 0.05, "{joint}: {worst}");
        }
    }
}
