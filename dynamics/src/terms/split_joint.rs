//! A term that splits its joint into rotor and link, with an exchangeable transmission between the two.

use std::sync::Arc;

use super::law::array;
use super::two_masses::{Transmission, TwoMasses};
use super::{Effect, Expansion, MotionSample, Site, Term};

/// A joint with a rotor of the inertia J, the first coordinate, and a transmission between it and the link.
#[derive(Debug)]
struct SplitJoint<T> {
    effect: &'static Effect,
    joint: usize,
    coordinates: [f64; 2],
    between: T,
    masses: TwoMasses,
}

/// Builds the term at a site.
pub(super) fn split_joint<T>(
    effect: &'static Effect,
    site: &Site<'_>,
    coordinates: &[f64],
    between: T,
) -> Box<dyn Term>
where
    T: Transmission + std::fmt::Debug + Send + 'static,
{
    Box::new(SplitJoint {
        effect,
        joint: site.joint,
        coordinates: array(coordinates),
        between,
        masses: TwoMasses::new(site),
    })
}

impl<T: Transmission + std::fmt::Debug + Send> Term for SplitJoint<T> {
    fn effect(&self) -> &'static Effect {
        self.effect
    }

    fn coordinates(&self) -> &[f64] {
        &self.coordinates
    }

    fn expand(&mut self, along: &Arc<Expansion>) {
        self.masses.expand(along);
    }

    fn reset(&mut self) {
        self.masses.reset();
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        self.masses.act(at, &self.between, effort);
        effort[self.joint] += self.coordinates[0] * at.acceleration[self.joint];
    }
}
