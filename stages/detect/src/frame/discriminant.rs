//! Fisher's linear discriminant (R. A. Fisher, "The use of multiple measurements in taxonomic problems", 1936)
//! between collisions and cooperations.
//!
//! The direction is `w = S⁻¹ (m_coll - m_coop)` with the within-class scatter S; the bound is half-way between the
//! means.

use nalgebra::{Matrix6, Vector6};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::lesson::ContactKind;

/// Ridge added to the scatter, relative to its trace: few contacts do not span all six directions.
/// Chosen: limits the condition number to 1000. A smaller ridge gives arbitrary weights to directions without data, a
/// larger one ignores the correlations of the measurements.
const RIDGE: f64 = 1e-3;

/// A linear discriminant: a direction and a bound.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Discriminant {
    /// Weights of the unit vectors' components: force x, y, z, velocity x, y, z.
    pub weights: [f64; 6],
    /// Weighted sum above which a contact is a collision.
    pub bound: f64,
}

/// Sufficient statistics of Fisher's discriminant, for collisions and cooperations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moments {
    /// Number of contacts of each kind.
    pub counts: [f64; 2],
    /// Means of the measurements.
    pub means: [Vector6<f64>; 2],
    /// Within-class scatter.
    pub scatter: Matrix6<f64>,
}

impl Moments {
    /// Computes the moments of measured contacts.
    pub fn of(found: &[(ContactKind, Vector6<f64>)]) -> Self {
        let mut moments = Self {
            counts: [0.0; 2],
            means: [Vector6::zeros(); 2],
            scatter: Matrix6::zeros(),
        };
        let kinds = [ContactKind::Collision, ContactKind::Cooperation];
        for (k, kind) in kinds.into_iter().enumerate() {
            let of_kind = || found.iter().filter(move |(other, _)| *other == kind);
            let count = of_kind().count() as f64;
            let mean = of_kind().map(|(_, x)| x).sum::<Vector6<f64>>() / count.max(1.0);
            for (_, x) in of_kind() {
                moments.scatter += (x - mean) * (x - mean).transpose();
            }
            (moments.counts[k], moments.means[k]) = (count, mean);
        }
        moments
    }

    /// Pools two sets of moments: scatters are added, as if the means of a kind were equal in both sets.
    pub fn and(&self, other: &Self) -> Self {
        let both = |k: usize| {
            let (own, others) = (self.counts[k], other.counts[k]);
            let sum = self.means[k] * own + other.means[k] * others;
            sum / (own + others).max(1.0)
        };
        Self {
            counts: std::array::from_fn(|k| self.counts[k] + other.counts[k]),
            means: [both(0), both(1)],
            scatter: self.scatter + other.scatter,
        }
    }

    /// Returns the direction that separates the kinds best, and the bound half-way between their means.
    pub fn discriminant(&self) -> Discriminant {
        let [collision, cooperation] = self.means;
        // Without any scatter, every direction in which the kinds differ separates them.
        let ridge = (RIDGE * self.scatter.trace()).max(f64::EPSILON);
        let scatter = self.scatter + Matrix6::identity() * ridge;
        let apart = collision - cooperation;
        let weights = scatter
            .cholesky()
            .map_or(apart, |scatter| scatter.solve(&apart));
        Discriminant {
            weights: weights.into(),
            bound: 0.5 * weights.dot(&(collision + cooperation)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_parts_two_clouds_that_a_plane_parts() {
        let mut found = Vec::new();
        for i in 0..20 {
            let wiggle = 0.3 * f64::from(i).sin();
            let x = |z: f64| Vector6::new(wiggle, 0.4 * wiggle, z, wiggle * wiggle, 0.0, -z);
            found.push((ContactKind::Collision, x(0.9 + 0.5 * wiggle)));
            found.push((ContactKind::Cooperation, x(0.2 + 0.5 * wiggle)));
        }
        let learnt = Moments::of(&found).discriminant();
        for (kind, x) in found {
            let sum = Vector6::from(learnt.weights).dot(&x);
            assert_eq!(sum > learnt.bound, kind == ContactKind::Collision);
        }
    }
}
