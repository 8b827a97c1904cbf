//! The bound between collision and cooperation.

use crate::frame::{ClassSweep, ContactKind};

/// Distance of a sweep's last bound above the largest ratio, as a share of that ratio.
/// Tuned: for the picture alone.
const ABOVE: f64 = 0.1;

/// Returns sensitivity and specificity of every bound that divides the `ratios` differently from the previous bound.
/// Ratios below a bound are classified as collisions. The last bound is above all finite ratios, and at least
/// `at_least`.
pub(crate) fn sweep_class(ratios: &[(ContactKind, f64)], at_least: f64) -> Vec<ClassSweep> {
    let finite = ratios
        .iter()
        .map(|&(_, ratio)| ratio)
        .filter(|ratio| ratio.is_finite());
    let mut bounds: Vec<f64> = finite.collect();
    bounds.sort_by(f64::total_cmp);
    bounds.dedup();
    let above = bounds
        .last()
        .map_or(at_least, |last| (last + ABOVE * last.abs()).max(at_least));
    bounds.push(above);
    let share = |kind, bound: f64, below: bool| {
        let of_kind = ratios.iter().filter(|(other, _)| *other == kind);
        let (mut right, mut all) = (0, 0);
        for (_, ratio) in of_kind {
            all += 1;
            right += usize::from((*ratio < bound) == below);
        }
        right as f64 / f64::max(f64::from(all), 1.0)
    };
    let sweep = bounds.into_iter().map(|bound| ClassSweep {
        bound,
        sensitivity: share(ContactKind::Cooperation, bound, false),
        specificity: share(ContactKind::Collision, bound, true),
    });
    sweep.collect()
}

/// Returns the range of bounds with the largest 2 specificity + sensitivity: a collision classified as a cooperation
/// does more harm than the reverse. All bounds between two neighbouring ratios are equivalent.
pub(crate) fn best(sweep: &[ClassSweep]) -> [f64; 2] {
    let worth = |at: &ClassSweep| 2.0 * at.specificity + at.sensitivity;
    let most = (0..sweep.len()).max_by(|&a, &b| worth(&sweep[a]).total_cmp(&worth(&sweep[b])));
    most.map_or([f64::NEG_INFINITY, f64::INFINITY], |at| {
        [sweep[at.saturating_sub(1)].bound, sweep[at].bound]
    })
}

#[cfg(test)]
#[allow(
    clippy::float_cmp,
    clippy::unwrap_used,
    reason = "tests compare exact bits, and a failed set-up is a failed test"
)]
mod tests {
    use super::*;

    const COLLISION: ContactKind = ContactKind::Collision;
    const COOPERATION: ContactKind = ContactKind::Cooperation;

    #[test]
    fn the_best_bounds_are_those_that_part_the_kinds() {
        let ratios = [
            (COLLISION, 1.2),
            (COLLISION, 2.0),
            (COOPERATION, 8.0),
            (COOPERATION, f64::INFINITY),
        ];
        let sweep = sweep_class(&ratios, 6.2);
        assert_eq!(best(&sweep), [2.0, 8.0]);
        let shares = |bound: f64| {
            let at = sweep.iter().find(|at| at.bound >= bound).unwrap();
            [at.specificity, at.sensitivity]
        };
        assert_eq!(shares(2.0), [0.5, 1.0]);
        assert_eq!(shares(8.0), [1.0, 1.0]);
        assert_eq!(shares(8.1), [1.0, 0.5]);
    }

    #[test]
    fn a_collision_counts_more_than_a_cooperation() {
        let ratios = [
            (COLLISION, 1.0),
            (COOPERATION, 2.0),
            (COLLISION, 3.0),
            (COOPERATION, 48.0),
        ];
        assert_eq!(best(&sweep_class(&ratios, 6.2)), [3.0, 48.0]);
    }

    #[test]
    fn bounds_that_no_cooperation_limits_reach_at_least_to_the_given_one() {
        let ratios = [(COLLISION, 1.5), (COOPERATION, f64::INFINITY)];
        assert_eq!(best(&sweep_class(&ratios, 6.2)), [1.5, 6.2]);
    }
}
