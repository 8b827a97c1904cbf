//! Terms in a joint whose effort depends on the present instant only.

use super::{Effect, MotionSample, Site, Term};

/// Effort of the joint at an instant, from the coordinates \[N m or N\].
pub(super) type Effort<const N: usize> = fn(&[f64; N], usize, &MotionSample<'_>) -> f64;

/// A term without memory that adds to one joint's effort.
#[derive(Debug)]
struct JointLaw<const N: usize> {
    effect: &'static Effect,
    joint: usize,
    coordinates: [f64; N],
    effort: Effort<N>,
}

/// Creates a term of `effort`, a function of the first `N` of `coordinates`; missing ones are 0.
pub(super) fn joint_law<const N: usize>(
    effect: &'static Effect,
    site: &Site<'_>,
    coordinates: &[f64],
    effort: Effort<N>,
) -> Box<dyn Term> {
    Box::new(JointLaw {
        effect,
        joint: site.joint,
        coordinates: array(coordinates),
        effort,
    })
}

/// The first `N` of `values`; missing ones are 0.
pub(super) fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

impl<const N: usize> Term for JointLaw<N> {
    fn effect(&self) -> &'static Effect {
        self.effect
    }

    fn coordinates(&self) -> &[f64] {
        &self.coordinates
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        effort[self.joint] += (self.effort)(&self.coordinates, self.joint, at);
    }
}
