//! The part of the residual that a constant force on one of the links explains.

use super::blocks::Ring;
use super::moments::{Compared, Moments, Outer, OuterScore};
use super::rows::FORCE;
use super::usual::Usual;

/// Returns the joint on whose child link a constant force explains the most between two blocks (counted from the
/// newest), and the gain in units of noise; 0 if no force explains anything.
pub(super) fn strongest(
    ring: &Ring,
    usual: &Usual<'_>,
    newest: usize,
    oldest: usize,
) -> (usize, f64) {
    let explained = |touched: usize| {
        let mut whole = OuterScore::<FORCE>::zero();
        for (j, reference) in usual.references.iter().enumerate() {
            let Some(noise) = usual.noise[j] else {
                continue;
            };
            let mut own = Moments::ZERO;
            let mut force = Outer::<FORCE>::zero();
            for block in (newest..=oldest).map(|back| ring.back(back)) {
                if !block.excluded {
                    own.add(&block.joints[j].own, 1.0);
                    force.add(&block.joints[j].force[touched]);
                }
            }
            if let Some(compared) = Compared::new(&own, reference) {
                whole.add(&compared.outer(&force), 1.0 / noise);
            }
        }
        whole.solve().map_or(0.0, |(_, gain)| gain)
    };
    (0..usual.references.len())
        .map(|touched| (touched, explained(touched)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, 0.0))
}
