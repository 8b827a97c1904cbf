//! Detection of recorded velocities that differ from the change of the recorded positions.

use super::{Remedy, Slip};
use crate::data::smoother::MotionSmoother;
use crate::read::recording::Recording;

/// Frequency below which both are compared \[Hz\].
/// Physical: well below the filters of drives, which begin at some 15 Hz, and above the motion of an arm.
const CUTOFF_HZ: f64 = 4.0;
/// Smallest scale error of a wrong velocity, as a factor.
/// Physical: the filter of a drive takes a tenth of the fastest motion at most.
const OFF: f64 = 1.25;
/// Smallest share of the recorded velocity's square that the factor must explain.
/// Statistical: a correlation of 0.95.
const EXPLAINS: f64 = 0.9;
/// Largest factor between the scales of joints with a common scale.
/// Physical: as [`OFF`].
const SAME: f64 = 1.1;
/// Smallest error of a scale common to all joints, and largest factor between them. No filter slows all motions
/// equally, but a wrong unit or a wrong clock does.
/// Tuned: by hand, on no recorded seeds; not swept.
const OFF_TOGETHER: f64 = 1.1;
const SAME_TOGETHER: f64 = 1.03;
/// Smallest speed of an informative joint, RMS \[rad/s or m/s\].
/// Physical: a coarse encoder of 6000 steps per turn has a noise of 0.3 mrad, which is 8 mrad/s at 4 Hz.
const LEAST_SPEED: f64 = 0.03;

/// Returns the faults of the recorded velocities of `n` joints.
pub fn of_velocity(recordings: &[Recording], n: usize) -> Vec<Slip> {
    let mut sums: Vec<Sums> = (0..n).map(|_| Sums::default()).collect();
    for recording in recordings.iter().filter(|one| has_velocity(one)) {
        let smoother = MotionSmoother::new(&recording.time_s, CUTOFF_HZ);
        for (joint, sums) in sums.iter_mut().enumerate() {
            sums.add(recording, &smoother, joint, n);
        }
    }
    let slopes = sums.iter().map(Sums::slope).enumerate();
    let told: Vec<(usize, f64)> = slopes
        .filter_map(|(joint, slope)| Some((joint, slope?)))
        .collect();
    let is_off = |slope: f64| !(1.0 / OFF..=OFF).contains(&slope);
    let off: Vec<(usize, f64)> = (told.iter().copied())
        .filter(|(_, slope)| is_off(*slope))
        .collect();
    let together = |same: f64| {
        let mut sorted: Vec<f64> = told.iter().map(|(_, slope)| *slope).collect();
        sorted.sort_by(f64::total_cmp);
        let middle = *sorted.get(sorted.len() / 2)?;
        let near = |slope: &f64| (1.0 / same..same).contains(&(slope / middle));
        (sorted.len() > 1 && sorted.iter().all(near)).then_some(middle)
    };
    let slip = |joint: Option<usize>, factor: f64, slopes: Vec<(usize, f64)>| Slip {
        remedy: Remedy::Velocity(joint, factor),
        mended: Vec::new(),
        share: 0.0,
        slopes,
    };
    let all_off = (off.len() == told.len()).then(|| together(SAME)).flatten();
    let is_off_together = |factor: &f64| !(1.0 / OFF_TOGETHER..=OFF_TOGETHER).contains(factor);
    if let Some(factor) = all_off.or_else(|| together(SAME_TOGETHER).filter(is_off_together)) {
        return vec![slip(None, factor, told)];
    }
    (off.iter().copied())
        .map(|(joint, slope)| slip(Some(joint), slope, vec![(joint, slope)]))
        .collect()
}

/// Returns the recorded velocity over the change of position, over some joints of a recording.
pub fn slope(recording: &Recording, joints: &[usize], n: usize) -> Option<f64> {
    let mut sums = Sums::default();
    if has_velocity(recording) {
        let smoother = MotionSmoother::new(&recording.time_s, CUTOFF_HZ);
        for &joint in joints {
            sums.add(recording, &smoother, joint, n);
        }
    }
    sums.slope()
}

fn has_velocity(recording: &Recording) -> bool {
    recording.velocity.len() == recording.position.len() && recording.len() > 1
}

/// Sums of products over the samples of a joint.
#[derive(Default)]
struct Sums {
    /// Squared change of position.
    own: f64,
    /// Change of position times recorded velocity.
    cross: f64,
    /// Squared recorded velocity.
    recorded: f64,
    /// Number of samples.
    count: f64,
}

impl Sums {
    fn add(&mut self, recording: &Recording, smoother: &MotionSmoother, joint: usize, n: usize) {
        let of_joint = |all: &[f64]| {
            all.iter()
                .skip(joint)
                .step_by(n)
                .copied()
                .collect::<Vec<_>>()
        };
        let own = smoother.smooth(&of_joint(&recording.position));
        let recorded = smoother.smooth(&of_joint(&recording.velocity));
        for (own, recorded) in own.iter().zip(&recorded) {
            if !recorded.x.is_finite() {
                continue;
            }
            self.own += own.y * own.y;
            self.cross += own.y * recorded.x;
            self.recorded += recorded.x * recorded.x;
            self.count += 1.0;
        }
    }

    fn slope(&self) -> Option<f64> {
        let moves = self.own > LEAST_SPEED * LEAST_SPEED * self.count.max(1.0);
        let explained = self.cross * self.cross / (self.own * self.recorded).max(f64::MIN_POSITIVE);
        (moves && explained > EXPLAINS).then_some(self.cross / self.own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{model, recording};

    /// Returns the faults of two recordings whose velocity is multiplied by `factor`, by joint, with their number of
    /// slopes.
    fn told(factor: [f64; 2]) -> Vec<(Remedy, usize)> {
        let model = model();
        let mut recordings = [1, 2].map(|seed| recording(&model, seed, |_, _, _| {}));
        for recording in &mut recordings {
            for row in recording.velocity.chunks_exact_mut(2) {
                row[0] *= factor[0];
                row[1] *= factor[1];
            }
        }
        let slips = of_velocity(&recordings, 2).into_iter();
        slips.map(|slip| (slip.remedy, slip.slopes.len())).collect()
    }

    #[test]
    fn a_velocity_that_is_no_change_of_position_is_told_with_its_factor() {
        assert!(told([1.0, 1.0]).is_empty());
        assert!(told([0.95, 1.1]).is_empty());
        let near = |remedy: &Remedy, joint: Option<usize>, factor: f64| matches!(remedy, Remedy::Velocity(of, by) if *of == joint && (by / factor - 1.0).abs() < 0.01);
        let one = told([1.0, 0.5]);
        assert!(one.len() == 1 && near(&one[0].0, Some(1), 0.5), "{one:?}");
        let all = told([57.3, 57.3]);
        assert!(all.len() == 1 && near(&all[0].0, None, 57.3), "{all:?}");
        // Within the attenuation by a filter; then a common factor, as of a wrong clock.
        assert!(told([0.85, 0.95]).is_empty());
        let slow = told([0.85, 0.86]);
        assert!(slow.len() == 1 && near(&slow[0].0, None, 0.855), "{slow:?}");
        let turned = told([-1.0, 1.0]);
        assert!(near(&turned[0].0, Some(0), -1.0), "{turned:?}");
    }
}
