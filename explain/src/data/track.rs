//! One recording in a fit: smoothed motion, the twin's effort for it, and the samples that are compared.

use nalgebra::Vector3;
use tauscope_dynamics::terms::{MotionSample, Physics, STANDSTILL_RAD_S};
use tauscope_dynamics::{Model, gravity_rows, rnea_rows};

use crate::data::quiet_start::quiet_s;
use crate::data::smoother::{LowPass, MotionSmoother};
use crate::data::standstill;
use crate::read::recording::Recording;

/// Share of the time with motion below which a joint is compared at standstill, too.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_MOVING_SHARE: f64 = 0.2;
/// Start of a recording of an arm at rest whose effort is treated as free of temporary effects \[s\].
/// Chosen: 50 samples at 50 Hz for a standard deviation; a longer start would contain a push more often.
pub const BEGINNING_S: f64 = 1.0;
/// Smallest distance of thinned samples on an uneven clock, relative to the step.
/// Resolution: an uneven clock keeps nearly its samples.
const LEAST_OF_STEP: f64 = 0.9;

/// One recording in a fit. Matrices are row-major: one number per joint and sample.
#[derive(Debug, Clone)]
pub struct Track {
    /// The recording's name.
    pub name: String,
    /// Its start \[s from the start of the session\].
    pub session_s: f64,
    /// Time of each sample \[s from the start of the recording\].
    pub time_s: Vec<f64>,
    /// Smoothed position \[rad or m\].
    pub position: Vec<f64>,
    /// Smoothed velocity \[rad/s or m/s\].
    pub velocity: Vec<f64>,
    /// Smoothed acceleration \[rad/s² or m/s²\].
    pub acceleration: Vec<f64>,
    /// The twin's effort \[N m or N\].
    pub rigid: Vec<f64>,
    /// Effort of the corrected twin's terms that do not act on bodies \[the recording's unit\].
    pub beside: Vec<f64>,
    /// Duration of the undisturbed start of an arm at rest \[s\].
    pub quiet_s: f64,
}

impl Track {
    /// Smooths the motion of a recording at all its samples and computes the twin's effort for it. The smoother has
    /// half amplitude at `motion_cutoff_hz`. `constants` convert the recording's unit into the model's, by joint.
    pub fn new(
        recording: &Recording,
        session_s: f64,
        model: &Model,
        motion_cutoff_hz: f64,
        constants: &[f64],
    ) -> Self {
        let n = model.dof();
        let count = recording.len();
        let of_poses = recording.is_of_poses();
        let mut track = Self {
            name: recording.name.clone(),
            session_s,
            time_s: recording.time_s.clone(),
            position: recording.position.clone(),
            velocity: vec![0.0; n * count],
            acceleration: vec![0.0; n * count],
            rigid: vec![0.0; n * count],
            beside: vec![0.0; n * count],
            quiet_s: BEGINNING_S,
        };
        let smoother = MotionSmoother::new(&recording.time_s, motion_cutoff_hz);
        for j in (0..n).filter(|_| !of_poses) {
            let measured: Vec<f64> = (0..count).map(|k| recording.position[k * n + j]).collect();
            let mut states = smoother.smooth(&measured);
            standstill::resmooth(&recording.time_s, &measured, &mut states);
            for (k, state) in states.iter().enumerate() {
                track.position[k * n + j] = state.x;
                track.velocity[k * n + j] = state.y;
                track.acceleration[k * n + j] = state.z;
            }
        }
        if recording.reference.is_empty() {
            track.rigid = track.rigid_effort(model, true);
        } else {
            for (k, value) in recording.reference.iter().enumerate() {
                track.rigid[k] = value * constants[k % n];
            }
        }
        track
    }

    /// Replaces the velocity by that of positions smoothed with another cutoff \[Hz\] or, without a cutoff, by the
    /// recorded velocity. Standstills are smoothed separately. The twin's effort stays unchanged.
    pub(crate) fn sharpen_velocity(&mut self, recording: &Recording, cutoff_hz: Option<f64>) {
        if recording.is_of_poses() {
            return;
        }
        let n = self.velocity.len() / self.len().max(1);
        let smoother = cutoff_hz.map(|hz| MotionSmoother::new(&recording.time_s, hz));
        for j in 0..n {
            let of_joint = |all: &[f64]| all.iter().skip(j).step_by(n).copied().collect::<Vec<_>>();
            let measured = of_joint(&recording.position);
            let mut states = match &smoother {
                Some(smoother) => smoother.smooth(&measured),
                None => (of_joint(&recording.velocity).into_iter())
                    .map(|velocity| Vector3::new(0.0, velocity, 0.0))
                    .collect(),
            };
            standstill::resmooth(&recording.time_s, &measured, &mut states);
            for (velocity, state) in self.velocity.iter_mut().skip(j).step_by(n).zip(&states) {
                *velocity = state.y;
            }
        }
    }

    /// Shifts the twin's effort for an arm at rest so that it begins at the measured effort: load, friction and
    /// offset are indistinguishable there.
    pub fn start_at_measured(&mut self, recording: &Recording, unit_nm: &[f64]) {
        let n = unit_nm.len();
        if recording.effort.is_empty() || self.is_empty() {
            return;
        }
        let off = |(j, unit): (usize, &f64)| -> Vec<f64> {
            let at = (j..recording.effort.len()).step_by(n);
            at.map(|at| (recording.effort[at] - self.beside[at]) * unit - self.rigid[at])
                .collect()
        };
        let off: Vec<Vec<f64>> = unit_nm.iter().enumerate().map(off).collect();
        self.quiet_s = quiet_s(&self.time_s, &off, BEGINNING_S);
        let samples = self.time_s.partition_point(|t| *t < self.quiet_s).max(1);
        for (j, off) in off.iter().enumerate() {
            let mean = off[..samples].iter().sum::<f64>() / samples as f64;
            for value in self.rigid.iter_mut().skip(j).step_by(n) {
                *value += mean;
            }
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns the track with the samples at these indices.
    pub(crate) fn thin(&self, keep: &[usize], n: usize) -> Self {
        let rows = |from: &[f64]| -> Vec<f64> {
            keep.iter()
                .flat_map(|&k| from[k * n..(k + 1) * n].to_vec())
                .collect()
        };
        Self {
            name: self.name.clone(),
            session_s: self.session_s,
            time_s: keep.iter().map(|&k| self.time_s[k]).collect(),
            position: rows(&self.position),
            velocity: rows(&self.velocity),
            acceleration: rows(&self.acceleration),
            rigid: rows(&self.rigid),
            beside: rows(&self.beside),
            quiet_s: self.quiet_s,
        }
    }

    /// Computes the effort of a rigid robot over the track or, if not `moving`, the effort against gravity alone.
    pub fn rigid_effort(&self, model: &Model, moving: bool) -> Vec<f64> {
        if moving {
            rnea_rows(model, &self.position, &self.velocity, &self.acceleration)
        } else {
            gravity_rows(model, &self.position)
        }
    }

    /// Runs `physics` over the track: from `start` efforts (row-major) to recorded efforts.
    pub fn run(&self, physics: &mut Physics, start: &[f64]) -> Vec<f64> {
        let mut effort = start.to_vec();
        physics.reset();
        self.each(|k, at| {
            let n = at.position.len();
            physics.act(at, &mut effort[k * n..(k + 1) * n]);
        });
        effort
    }

    /// Calls `visit` with every sample in order.
    pub fn each(&self, mut visit: impl FnMut(usize, &MotionSample<'_>)) {
        let n = self.position.len() / self.len().max(1);
        for k in 0..self.len() {
            let row = k * n..(k + 1) * n;
            let at = MotionSample {
                dt_s: if k == 0 {
                    0.0
                } else {
                    self.time_s[k] - self.time_s[k - 1]
                },
                recording_s: self.time_s[k],
                session_s: self.session_s + self.time_s[k],
                position: &self.position[row.clone()],
                velocity: &self.velocity[row.clone()],
                acceleration: &self.acceleration[row.clone()],
                transmitted: &self.rigid[row],
            };
            visit(k, &at);
        }
    }
}

/// A track with the filter of its clock and the samples that are compared.
#[derive(Debug, Clone)]
pub struct FitTrack {
    /// The motion, thinned.
    pub track: Track,
    /// Filter by joint, without the samples that are not compared there.
    pub(crate) filters: Vec<LowPass>,
    /// Samples at which filtered signals are compared.
    pub compared: Vec<usize>,
    /// Index of the first of these samples in the rows of the problem.
    pub first_row: usize,
}

impl FitTrack {
    /// Returns the rows of the problem that belong to this track.
    pub fn rows(&self) -> std::ops::Range<usize> {
        self.first_row..self.first_row + self.compared.len()
    }

    /// Filters one joint's signal on the track's clock and writes its compared samples.
    pub fn compare(&self, joint: usize, mut signal: Vec<f64>, into: &mut [f64]) {
        self.filters[joint].apply(&mut signal);
        for (value, &k) in into.iter_mut().zip(&self.compared) {
            *value = signal[k];
        }
    }
}

/// Returns by joint whether it moves in at least [`LEAST_MOVING_SHARE`] of the time. The others are compared at
/// standstill, too.
pub(crate) fn moving_joints<'a>(tracks: impl Iterator<Item = &'a Track>, n: usize) -> Vec<bool> {
    let (mut moving, mut samples) = (vec![0_usize; n], 0);
    for track in tracks {
        samples += track.len();
        for (k, velocity) in track.velocity.iter().enumerate() {
            moving[k % n] += usize::from(velocity.abs() > 2.0 * STANDSTILL_RAD_S);
        }
    }
    let share = |count: &usize| *count as f64 > LEAST_MOVING_SHARE * samples as f64;
    moving.iter().map(share).collect()
}

/// Returns the indices of samples at least [`LEAST_OF_STEP`] times `step_s` apart.
pub(crate) fn thinned(time_s: &[f64], step_s: f64) -> Vec<usize> {
    let mut kept = Vec::new();
    let mut next = f64::NEG_INFINITY;
    for (k, &t) in time_s.iter().enumerate() {
        if t >= next {
            kept.push(k);
            next = t + LEAST_OF_STEP * step_s;
        }
    }
    kept
}

/// Returns the indices of the samples that follow the points of an even grid of `step_s`.
pub(crate) fn spaced(time_s: &[f64], step_s: f64) -> Vec<usize> {
    let mut kept = Vec::new();
    let mut at = time_s[0] + 0.5 * step_s;
    let end = time_s[time_s.len() - 1];
    while at < end {
        let k = time_s.partition_point(|t| *t < at).min(time_s.len() - 1);
        if kept.last() != Some(&k) {
            kept.push(k);
        }
        at += step_s;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::recording::Losses;

    /// A joint that creeps at 2 mrad/s for half a second and then slips at 1 rad/s.
    #[test]
    fn a_joint_that_slips_has_its_recorded_velocity_at_once_and_none_of_its_noise_at_rest() {
        let time_s: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k)).collect();
        let slips = |t: f64| (t - 0.495).max(0.0);
        let position: Vec<f64> = time_s.iter().map(|t| 0.002 * t + slips(*t)).collect();
        let noise = |k: usize| if k.is_multiple_of(2) { 0.004 } else { -0.004 };
        let velocity: Vec<f64> = (0..100)
            .map(|k| {
                if slips(time_s[k]) > 0.0 {
                    1.0
                } else {
                    0.002 + noise(k)
                }
            })
            .collect();
        let recording = Recording {
            name: String::new(),
            path: std::path::PathBuf::new(),
            start_ns: 0,
            time_s: time_s.clone(),
            position: position.clone(),
            velocity,
            effort: Vec::new(),
            reference: Vec::new(),
            sample_of_row: (0..100).map(Some).collect(),
            clock: None,
            findings: Vec::new(),
            losses: Losses::default(),
        };
        let mut track = Track {
            name: String::new(),
            session_s: 0.0,
            time_s,
            position,
            velocity: vec![0.0; 100],
            acceleration: vec![0.0; 100],
            rigid: vec![0.0; 100],
            beside: vec![0.0; 100],
            quiet_s: BEGINNING_S,
        };
        track.sharpen_velocity(&recording, None);
        assert!(
            track.velocity[5..45]
                .iter()
                .all(|v| (v - 0.002).abs() < 1e-3)
        );
        assert!(track.velocity[50..].iter().all(|v| (v - 1.0).abs() < 1e-9));
    }
}
