//! Periodic excitation: a sum of sines, as Swevers et al. (1997) propose for identification.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{JointArray, MAX_JOINTS};

use super::{JointRange, Target, quintic};
use crate::simulated::error::ScenarioError;
use crate::simulated::scenario::FourierSpec;

/// Number of instants per period at which the limits are checked.
/// Resolution: of a period; at most 50 harmonics leave 20 instants for the fastest.
const STEPS_PER_PERIOD: f64 = 1000.0;
/// Duration of the blend at either end, so that the arm begins and ends at rest \[s\].
/// Chosen: for simulated cells only; long enough for the blend to add little acceleration, short against a recording.
const BLEND_S: f64 = 2.0;

/// The motion `q0 + s(t) Σ a sin(k ω t) + b cos(k ω t)`, with s(t) the blend.
#[derive(Debug)]
pub(in crate::simulated) struct Fourier {
    about: JointArray,
    /// Coefficients of the sine and of the cosine of each harmonic, by joint.
    waves: Vec<(JointArray, JointArray)>,
    omega: f64,
    joint_count: usize,
    duration_s: f64,
    blend_s: f64,
}

impl Fourier {
    /// Creates a motion of `duration_s` with random coefficients, as large as the limits allow.
    pub fn new(
        spec: &FourierSpec,
        joints: &[JointRange],
        duration_s: f64,
        mut rng: ChaCha8Rng,
    ) -> Result<Self, ScenarioError> {
        let mut about = [0.0; MAX_JOINTS];
        for (value, joint) in about.iter_mut().zip(joints) {
            *value = joint.middle();
        }
        if let Some(given) = &spec.about {
            super::super::check::position("motion.fourier.about", given, joints)?;
            about[..joints.len()].copy_from_slice(given);
        }
        let omega = std::f64::consts::TAU / spec.period_s;
        let waves = (1..=spec.harmonics)
            .map(|k| {
                // Equal velocity amplitudes for all harmonics.
                let scale = 1.0 / f64::from(k);
                let mut draw = || {
                    let mut wave = [0.0; MAX_JOINTS];
                    for value in &mut wave[..joints.len()] {
                        *value = scale * (2.0 * rng.random::<f64>() - 1.0);
                    }
                    wave
                };
                (draw(), draw())
            })
            .collect();
        let mut fourier = Self {
            about,
            waves,
            omega,
            joint_count: joints.len(),
            duration_s,
            blend_s: BLEND_S.min(0.5 * duration_s),
        };
        fourier.scale(spec, joints);
        Ok(fourier)
    }

    /// Scales each joint's motion to its limits; position, velocity and acceleration are linear in the coefficients.
    fn scale(&mut self, spec: &FourierSpec, joints: &[JointRange]) {
        let mut peaks = [[0.0_f64; MAX_JOINTS]; 3];
        // All extremes occur within the blend and one period at either end.
        let window_s = (self.blend_s + spec.period_s).min(self.duration_s);
        let step_s = spec.period_s / STEPS_PER_PERIOD;
        for i in 0..=(window_s / step_s).ceil() as usize {
            let into_s = (i as f64 * step_s).min(window_s);
            for t_s in [into_s, self.duration_s - into_s] {
                let target = self.at(t_s);
                for (j, about) in self.about.iter().enumerate() {
                    let swing = target.position[j] - about;
                    peaks[0][j] = peaks[0][j].max(swing.abs());
                    peaks[1][j] = peaks[1][j].max(target.velocity[j].abs());
                    peaks[2][j] = peaks[2][j].max(target.acceleration[j].abs());
                }
            }
        }
        for (j, joint) in joints.iter().enumerate() {
            let [position, velocity, acceleration] = peaks.map(|peak| peak[j]);
            let range = spec.range * joint.half();
            let room = (range - (self.about[j] - joint.middle()).abs()).max(0.0);
            let factor = (room / position)
                .min(spec.speed * joint.velocity / velocity)
                .min(spec.acceleration_rad_s2 / acceleration);
            // Margin of 1 %, since the peak may lie between two instants of the grid.
            let factor = if factor.is_finite() {
                0.99 * factor
            } else {
                0.0
            };
            for (sine, cosine) in &mut self.waves {
                sine[j] *= factor;
                cosine[j] *= factor;
            }
        }
    }

    /// Returns position, velocity and acceleration of the sum of sines alone.
    fn swing(&self, t_s: f64) -> [JointArray; 3] {
        let mut swing = [[0.0; MAX_JOINTS]; 3];
        for (k, (sine, cosine)) in self.waves.iter().enumerate() {
            let rate = self.omega * (k + 1) as f64;
            let (s, c) = (rate * t_s).sin_cos();
            for j in 0..self.joint_count {
                let wave = sine[j] * s + cosine[j] * c;
                swing[0][j] += wave;
                swing[1][j] += rate * (sine[j] * c - cosine[j] * s);
                swing[2][j] -= rate * rate * wave;
            }
        }
        swing
    }

    pub fn at(&self, t_s: f64) -> Target {
        let [position, velocity, acceleration] = self.swing(t_s);
        let left_s = self.duration_s - t_s;
        let (u, direction) = if t_s <= left_s {
            (t_s, 1.0)
        } else {
            (left_s, -1.0)
        };
        let [s, ds, dds] = quintic(u / self.blend_s);
        let (ds, dds) = (
            direction * ds / self.blend_s,
            dds / self.blend_s / self.blend_s,
        );
        let mut target = Target::default();
        for j in 0..self.joint_count {
            target.position[j] = self.about[j] + s * position[j];
            target.velocity[j] = s * velocity[j] + ds * position[j];
            target.acceleration[j] =
                s * acceleration[j] + 2.0 * ds * velocity[j] + dds * position[j];
        }
        target
    }
}
