//! The joints that carry a contact's torque, judged over the whole contact.

use tauscope_bus::{JointArray, MAX_JOINTS};

/// Residual from which a joint is loaded \[standard deviations of its contact-free residual\].
/// Statistical: Gaussian noise goes beyond four standard deviations once in 16 000 samples.
const LOADED_SIGMAS: f64 = 4.0;

/// A vote of the contact's samples on each joint, weighted by the score: a joint is loaded if it is loaded in samples
/// that make up more than half of the summed score. So a joint whose residual is wrong during a part of the contact,
/// for example while the joint reverses, is not listed. This is a weighted median (breakdown point one half: Huber
/// and Ronchetti, "Robust Statistics", 2009, section 3.1).
#[derive(Debug, Clone, Default)]
pub(crate) struct LoadedJoints {
    /// Summed score of the samples in which the joint is loaded, by joint.
    loaded: JointArray,
    /// Summed score of all samples.
    total: f64,
}

impl LoadedJoints {
    /// Returns whether no sample has been added.
    pub fn is_empty(&self) -> bool {
        self.total <= 0.0
    }

    /// Adds a sample with this score; `residual_and_noise` is in order of the joints \[effort unit\].
    pub fn add(&mut self, score: f64, residual_and_noise: impl Iterator<Item = (f64, f64)>) {
        let score = score.max(f64::MIN_POSITIVE);
        self.total += score;
        for (loaded, (residual, noise)) in self.loaded.iter_mut().zip(residual_and_noise) {
            if residual.abs() > LOADED_SIGMAS * noise {
                *loaded += score;
            }
        }
    }

    /// Returns a joint's residual, limited to the range of its noise if the joint is not loaded. So a few wrong
    /// samples do not outweigh the rest of the contact (Huber's function, section 4.5 of the same book).
    pub fn limit(&self, joint: usize, residual: f64, noise: f64) -> f64 {
        if self.is_loaded(joint) {
            residual
        } else {
            let most = LOADED_SIGMAS * noise;
            residual.clamp(-most, most)
        }
    }

    fn is_loaded(&self, joint: usize) -> bool {
        2.0 * self.loaded[joint] > self.total
    }

    /// Returns the loaded joints: bit j for joint j.
    pub fn mask(&self) -> u32 {
        (0..MAX_JOINTS)
            .filter(|&j| self.is_loaded(j))
            .fold(0, |mask, j| mask | 1 << j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_that_is_loaded_for_less_than_half_of_the_contact_is_not_listed() {
        let mut loaded = LoadedJoints::default();
        assert!(loaded.is_empty());
        for k in 0..20 {
            let burst = if k < 8 { 1.0 } else { 0.0 };
            let residuals = [0.01, -12.0, burst];
            loaded.add(100.0, residuals.iter().map(|residual| (*residual, 0.1)));
        }
        assert_eq!(loaded.mask(), 0b010);
        let limited = [(1, -12.0), (2, 0.7)].map(|(j, residual)| loaded.limit(j, residual, 0.1));
        assert!((limited[0] + 12.0).abs() < 1e-12 && (limited[1] - 0.4).abs() < 1e-12);
    }

    #[test]
    fn the_strongest_part_of_the_contact_counts_most() {
        let mut loaded = LoadedJoints::default();
        for (score, residual) in [(500.0, 2.0), (10.0, 0.1), (10.0, 0.1)] {
            loaded.add(score, [(residual, 0.1)].into_iter());
        }
        assert_eq!(loaded.mask(), 0b1);
    }
}
