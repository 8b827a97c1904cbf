//! Gain and offset per joint by linear regression (Tajiri and Iwamoto, equations 3 and 4), from the
//! filtered efforts of an uncorrected twin over contact-free recordings.
//!
//! The joints do not interact in equation 3, so each is a straight-line fit, kept as running sums:
//! memory does not grow with the recordings.

use tauscope_bus::{TwinState, flags};
use tauscope_dynamics::effort_scale::{self, Slope};

use crate::twin_file::TwinFile;

/// Speed above which a joint is moving \[rad/s, m/s\].
/// Physical: above the velocity noise of encoders.
const MOVES: f64 = 0.03;
/// Minimum share of samples in motion for a gain to be identifiable.
/// Tuned: not swept.
const LEAST_MOVING: f64 = 0.01;

/// Minimum share of the measured effort's variance that a line must explain for its slope to be used as the gain.
/// Below it, friction outweighs the modelled effort.
/// Tuned: not swept.
const LEAST_EXPLAINED: f64 = 0.05;

/// Standard deviation of the model effort above which a joint carries weight \[N m\].
/// Physical: a hand of 1 kg at 10 cm.
const BEARS_WEIGHT: f64 = 1.0;

/// One joint's fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFit {
    /// Gain \[effort unit per model unit\].
    pub gain: f64,
    /// Offset \[effort unit\].
    pub offset: f64,
    /// Standard deviation of the fit's residual \[effort unit\].
    pub noise: f64,
    /// Share of the measured effort's variance that the line explains, 0 to 1.
    pub explained: f64,
    /// Range of the model's effort over the recordings, as its standard deviation \[model unit\].
    pub excitation: f64,
    /// Range of the measured effort over the recordings, as its standard deviation \[effort unit\].
    pub measured: f64,
}

/// Running means and central moments of one joint (Welford's algorithm).
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    mean_x: f64,
    mean_y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// The regression over any number of recordings.
#[derive(Debug, Clone)]
pub struct Calibration {
    joints: Vec<Moments>,
    /// Whether measured and model efforts have the same unit; an unidentifiable gain is then 1.
    alike: bool,
    samples: u64,
    moving: u64,
}

impl Calibration {
    /// Creates an empty regression for `joint_count` joints. `alike` states that measured and model efforts have the
    /// same unit, so that a gain that the recordings do not identify is set to 1.
    pub fn new(joint_count: usize, alike: bool) -> Self {
        Self {
            joints: vec![Moments::default(); joint_count],
            alike,
            samples: 0,
            moving: 0,
        }
    }

    /// Returns the number of samples in the regression.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Adds a sample of the uncorrected twin; samples without [`flags::READY`] are skipped.
    pub fn add(&mut self, sample: &TwinState) {
        if !sample.header.has(flags::READY) {
            return;
        }
        self.samples += 1;
        let n = self.samples as f64;
        let velocities = &sample.velocity[..self.joints.len()];
        self.moving += u64::from(velocities.iter().any(|velocity| velocity.abs() > MOVES));
        for (j, m) in self.joints.iter_mut().enumerate() {
            let (x, y) = (
                sample.filtered_expected_effort[j],
                sample.filtered_effort[j],
            );
            let (dx, dy) = (x - m.mean_x, y - m.mean_y);
            m.mean_x += dx / n;
            m.mean_y += dy / n;
            m.xx += dx * (x - m.mean_x);
            m.xy += dx * (y - m.mean_y);
            m.yy += dy * (y - m.mean_y);
        }
    }

    /// Returns the fit per joint, or `None` for fewer than two samples.
    ///
    /// A joint whose model effort does not vary keeps gain 1 and gets only an offset. If measured and model efforts
    /// have the same unit, two further cases keep gain 1:
    /// - all joints of an arm at standstill, because the variation of static friction between poses masks any gain;
    /// - a joint whose friction masks the modelled effort.
    pub fn fit(&self) -> Option<Vec<JointFit>> {
        if self.samples < 2 {
            return None;
        }
        let n = self.samples as f64;
        let stands = (self.moving as f64) < LEAST_MOVING * n;
        let fit = |m: &Moments| {
            let varies = m.xx > 1e-12 * n * (1.0 + m.mean_x * m.mean_x);
            let left = |gain: f64| (m.yy - 2.0 * gain * m.xy + gain * gain * m.xx).max(0.0);
            let explained = |gain| {
                let share = if m.yy > 0.0 {
                    1.0 - left(gain) / m.yy
                } else {
                    0.0
                };
                share.max(0.0)
            };
            let line = m.xy / m.xx;
            let told = varies && !(self.alike && (stands || explained(line) < LEAST_EXPLAINED));
            let gain = if told { line } else { 1.0 };
            JointFit {
                gain,
                offset: m.mean_y - gain * m.mean_x,
                noise: (left(gain) / n).sqrt(),
                explained: if varies { explained(gain) } else { 0.0 },
                excitation: (m.xx / n).sqrt(),
                measured: (m.yy / n).sqrt(),
            }
        };
        Some(self.joints.iter().map(fit).collect())
    }
}

/// Returns the slopes in a twin file of the joints whose line explains most of the measured effort.
pub fn telling_slopes_of(file: &TwinFile) -> Vec<Slope> {
    let joints = file.joints.iter();
    let telling =
        joints.filter(|(_, joint)| joint.explained.unwrap_or(0.0) >= effort_scale::TELLING);
    telling
        .map(|(name, joint)| Slope {
            joint: name.clone(),
            slope: joint.gain,
        })
        .collect()
}

/// Returns the slopes of the joints whose line explains most of the measured effort; they identify its unit. `fits`
/// are by joint in the order of `names`.
pub fn telling_slopes(names: &[String], fits: &[JointFit]) -> Vec<Slope> {
    let telling = |fit: &JointFit| fit.explained >= effort_scale::TELLING;
    let named = names.iter().zip(fits);
    let slopes = named
        .filter(|(_, fit)| telling(fit))
        .map(|(joint, fit)| Slope {
            joint: joint.clone(),
            slope: fit.gain,
        });
    slopes.collect()
}

/// Returns the ratio of the standard deviations of measured and model effort: the median over the joints that carry
/// weight. A measured torque varies at least as much as gravity makes it vary, whatever friction adds. So a small
/// ratio identifies a motor current even where friction masks every slope.
pub fn spread_scale(fits: &[JointFit]) -> Option<f64> {
    let bears = fits.iter().filter(|fit| fit.excitation > BEARS_WEIGHT);
    let mut ratios: Vec<f64> = bears.map(|fit| fit.measured / fit.excitation).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tauscope_bus::Header;

    fn sample(model: f64, measured: f64) -> TwinState {
        let mut sample = TwinState {
            header: Header {
                flags: flags::READY,
                joint_count: 1,
                ..Header::default()
            },
            ..TwinState::default()
        };
        sample.filtered_expected_effort[0] = model;
        sample.filtered_effort[0] = measured;
        sample.velocity[0] = 0.5;
        sample
    }

    proptest! {
        #[test]
        fn a_line_is_recovered(gain in -50.0..50.0f64, offset in -50.0..50.0f64, far in -1e3..1e3f64) {
            let mut calibration = Calibration::new(1, true);
            for i in 0..200 {
                let model = far + (f64::from(i) * 0.1).sin() * 3.0;
                calibration.add(&sample(model, gain * model + offset));
            }
            let fit = calibration.fit().unwrap()[0];
            prop_assert!((fit.gain - gain).abs() < 1e-6);
            prop_assert!((fit.offset - offset).abs() < 1e-3);
            prop_assert!(fit.noise < 1e-3);
        }
    }

    #[test]
    fn a_joint_whose_model_effort_never_varies_keeps_its_gain() {
        let mut calibration = Calibration::new(1, true);
        for i in 0..100 {
            calibration.add(&sample(2.0, 5.0 + f64::from(i % 2)));
        }
        let fit = calibration.fit().unwrap()[0];
        assert!((fit.gain - 1.0).abs() < f64::EPSILON);
        assert!((fit.offset - 3.5).abs() < 1e-9);
        assert!((fit.noise - 0.5).abs() < 1e-9);
        assert!(fit.explained.abs() < f64::EPSILON);
    }

    #[test]
    fn friction_that_hides_the_model_tells_no_gain_unless_the_unit_is_another() {
        for alike in [true, false] {
            let mut calibration = Calibration::new(1, alike);
            for i in 0..1000 {
                let friction = if i % 100 < 50 { 2.0 } else { -2.0 };
                let model = 0.1 * (0.3 * f64::from(i)).sin();
                calibration.add(&sample(model, 1.0 - 0.5 * model + friction));
            }
            let fit = calibration.fit().unwrap()[0];
            assert_eq!(alike, (fit.gain - 1.0).abs() < f64::EPSILON);
            assert!((fit.offset - 1.0).abs() < 0.01 && fit.explained < 0.01);
        }
    }

    #[test]
    fn an_arm_that_stands_tells_no_gain_unless_its_unit_is_another() {
        for alike in [true, false] {
            let mut calibration = Calibration::new(1, alike);
            for pose in [1.0, 2.0] {
                for _ in 0..100 {
                    let mut standing = sample(pose, 9.0 - 3.0 * pose);
                    standing.velocity[0] = 0.001;
                    calibration.add(&standing);
                }
            }
            let fit = calibration.fit().unwrap()[0];
            let (gain, offset) = if alike { (1.0, 3.0) } else { (-3.0, 9.0) };
            assert!((fit.gain - gain).abs() < 1e-9 && (fit.offset - offset).abs() < 1e-9);
        }
    }

    #[test]
    fn samples_before_the_filters_have_settled_are_passed_over() {
        let mut calibration = Calibration::new(1, true);
        calibration.add(&TwinState::default());
        assert_eq!(calibration.samples(), 0);
        assert!(calibration.fit().is_none());
    }
}
