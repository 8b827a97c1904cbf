//! Velocity of a joint at standstill, smoothed separately.
//!
//! A joint that breaks away has a corner in its position. A smoother rings at that corner, so the velocity of a few
//! mrad/s before it gets the wrong sign. Friction then has the wrong sign, too: an error of several N m. Therefore
//! each standstill is smoothed separately, with a lower cutoff.

use nalgebra::Vector3;

use crate::data::noise::white_variance;
use crate::data::smoother::MotionSmoother;

/// Largest creep velocity of a joint at standstill \[rad/s\].
/// Chosen: above the creep of a few mrad/s before breakaway, below the speed of compared motion, 0.01 rad/s.
const CREEP_RAD_S: f64 = 0.006;
/// Additional range of its positions, in standard deviations of the encoder's noise.
/// Statistical: five samples of Gaussian noise spread further about once in 4500.
const NOISE_SPAN: f64 = 6.0;
/// Half width of the window whose range of positions is evaluated \[samples\].
/// Tuned: by hand, on no recorded seeds; not swept.
const REACH: usize = 2;
/// Shortest standstill \[samples\].
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_SAMPLES: usize = 8;
/// Shortest standstill \[s\].
/// Derived: about a quarter of the period of [`CUTOFF_HZ`], within which the smoother cannot bend.
const LEAST_S: f64 = 0.06;
/// Cutoff of the smoother within a standstill \[Hz\].
/// Chosen: a quarter of the motion's 16 Hz, for an eighth of its noise in the velocity (4^1.5 = 8); a lower one would
/// smooth the creep away.
const CUTOFF_HZ: f64 = 4.0;

/// Smooths each standstill in `position` separately and writes its velocity into `states`. Accelerations stay
/// unchanged.
pub fn resmooth(time_s: &[f64], position: &[f64], states: &mut [Vector3<f64>]) {
    let noise = white_variance(position).sqrt();
    let stands = |k: usize| {
        let (from, to) = (k.saturating_sub(REACH), (k + REACH).min(position.len() - 1));
        let span = &position[from..=to];
        let most = span.iter().copied().fold(f64::MIN, f64::max);
        let least = span.iter().copied().fold(f64::MAX, f64::min);
        most - least <= NOISE_SPAN * noise + CREEP_RAD_S * (time_s[to] - time_s[from])
    };
    let mut from = None;
    for k in 0..=position.len() {
        match (k < position.len() && stands(k), from) {
            (true, None) => from = Some(k),
            (false, Some(start)) => {
                let long = time_s[k - 1] - time_s[start] >= LEAST_S;
                if k - start >= LEAST_SAMPLES && long {
                    let smoother = MotionSmoother::new(&time_s[start..k], CUTOFF_HZ);
                    let smooth = smoother.smooth(&position[start..k]);
                    for (state, smooth) in states[start..k].iter_mut().zip(&smooth) {
                        state.y = smooth.y;
                    }
                }
                from = None;
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_that_breaks_loose_does_not_move_the_other_way_before() {
        let time: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        // Creeps at -1 mrad/s, then accelerates at 15 rad/s².
        let position: Vec<f64> = time
            .iter()
            .map(|t| {
                -0.001 * t
                    - if *t > 2.0 {
                        7.5 * (t - 2.0) * (t - 2.0)
                    } else {
                        0.0
                    }
            })
            .collect();
        let mut states = MotionSmoother::new(&time, 16.0).smooth(&position);
        assert!(
            states[190..200].iter().any(|s| s.y > 0.0),
            "the smoother rings"
        );
        resmooth(&time, &position, &mut states);
        for state in &states[5..195] {
            assert!((state.y + 0.001).abs() < 2e-4, "{}", state.y);
        }
    }
}
