//! Two pushes instead of a long one that a second push cancels for a while.

use crate::fit::fitted::Fit;
use crate::physics::active::{Active, TimeKind};
use crate::select::evidence::TIE;
use crate::select::explanation::{Explanation, describe};

use crate::select::search::Search;

/// Two forces cancel if their sum is below this share of the larger one.
/// Tuned: by hand, on no recorded seeds; not swept.
const CANCELS: f64 = 0.3;

impl Search<'_> {
    /// Replaces a push, and one within it that cancels it, by a push before and a push after the cancelled time. This
    /// is done if the evidence falls by less than [`TIE`].
    pub fn with_split_pushes(&self, mut best: Explanation) -> Explanation {
        let pieces = best.fit.actives.len();
        for long in 0..pieces {
            for pause in 0..pieces {
                let actives = &best.fit.actives;
                let Some((first, second)) = two(&actives[long], &actives[pause]) else {
                    continue;
                };
                let mut parted = actives.clone();
                let joints = Fit::joints_of(&first.hypothesis, self.problem.joints);
                (parted[long], parted[pause]) = (first, second);
                let fit = Fit::new(self.problem, parted);
                let other = Explanation {
                    fit: fit.refined_at(self.problem, Some(&joints), best.fit.likelihood()),
                    penalties: best.penalties.clone(),
                };
                if other.ahead_of(&best, &self.problem.effective_samples) > -TIE {
                    (self.say)(&describe(&other));
                    best = other;
                }
            }
        }
        best
    }
}

/// The pushes before and after `pause`, if `pause` is within `long`, on the same link, and cancels it.
fn two(long: &Active, pause: &Active) -> Option<(Active, Active)> {
    let once = long.hypothesis.time_kind() == TimeKind::Once;
    let ([x, y, z, start, end], [u, v, w, from, to]) = (
        long.coordinates[..].try_into().ok()?,
        pause.coordinates[..].try_into().ok()?,
    );
    let size = |force: [f64; 3]| force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let left = size([x + u, y + v, z + w]);
    let cancel = left < CANCELS * size([x, y, z]).max(size([u, v, w]));
    let within = start < from && from < to && to < end;
    if !once || long.hypothesis != pause.hypothesis || !cancel || !within {
        return None;
    }
    let push = |window: [f64; 2]| {
        let mut active = long.clone();
        active.coordinates[3..].copy_from_slice(&window);
        active
    };
    Some((push([start, from]), push([to, end])))
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::physics::active::{Hypothesis, Whereabouts};

    fn push(link: usize, coordinates: [f64; 5]) -> Active {
        let place = Whereabouts {
            link,
            ..Whereabouts::default()
        };
        let effect = effect("external_push").unwrap();
        Hypothesis { effect, place }.with(coordinates.to_vec())
    }

    #[test]
    fn a_push_that_another_undoes_within_it_is_two() {
        let long = push(3, [10.0, -5.0, 2.0, 1.0, 4.0]);
        let (first, second) = two(&long, &push(3, [-9.0, 5.0, -2.0, 1.5, 3.5])).unwrap();
        assert_eq!(first.coordinates, [10.0, -5.0, 2.0, 1.0, 1.5]);
        assert_eq!(second.coordinates, [10.0, -5.0, 2.0, 3.5, 4.0]);
        // Another link, another force, or not within: these are pushes of their own.
        assert!(two(&long, &push(2, [-10.0, 5.0, -2.0, 1.5, 3.5])).is_none());
        assert!(two(&long, &push(3, [-3.0, 5.0, -2.0, 1.5, 3.5])).is_none());
        assert!(two(&long, &push(3, [-10.0, 5.0, -2.0, 1.5, 4.5])).is_none());
    }
}
