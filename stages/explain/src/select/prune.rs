//! Backward elimination: removes effects that are no longer needed.

use crate::fit::fitted::Fit;
use crate::physics::active::TimeKind;
use crate::select::curve_shapes::repeats;
use crate::select::evidence::{
    CURVE_EVIDENCE, CURVE_SIZE, LEAST_SIZE, matters, needs, overwhelming, wald,
};
use crate::select::explanation::{Explanation, left_out};
use crate::select::parallel;
use crate::select::plausible::{is_timely, plausible};
use crate::select::search::Search;

/// Where the residual is far above the noise, share of it that an effect must explain in the end.
/// Tuned: by hand, on no recorded seeds; not swept.
const NAMED_SIZE: f64 = 0.5;
/// An effect is certain by Wald's test if it exceeds what is required this many times.
/// Tuned: by hand, on no recorded seeds; not swept.
const CERTAIN_TIMES: f64 = 4.0;
/// And, as to evidence, by so much more \[nats\].
/// Tuned: by hand, on no recorded seeds; not swept.
const CERTAIN_MORE: f64 = 60.0;

/// An effect is hidden if its effort is less than this many times the white noise, both as root mean square.
/// Tuned: by hand; not swept.
pub const HIDDEN: f64 = 0.5;

impl Search<'_> {
    /// Removes the effects that are no longer needed, one at a time.
    pub fn pruned(&self, mut best: Explanation) -> Explanation {
        'again: loop {
            let sure = self.sure(&best.fit);
            let doubtful =
                |&i: &usize| !sure[i] && !best.fit.actives[i].hypothesis.is_torque_scale();
            let doubtful: Vec<usize> = (0..sure.len()).filter(doubtful).collect();
            for some in doubtful.chunks(parallel::threads()) {
                let without = parallel::map(some, |&index| self.without(&best, index));
                for (&index, less) in some.iter().zip(without) {
                    if self.is_needed(&best, &less, index) {
                        continue;
                    }
                    (self.say)(&left_out(&best, index));
                    best = self.simpler(&best, &less, index).unwrap_or(less);
                    continue 'again;
                }
            }
            return best;
        }
    }

    /// Whether the effect at `index` is needed; `less` is the explanation without it.
    fn is_needed(&self, best: &Explanation, less: &Explanation, index: usize) -> bool {
        let active = &best.fit.actives[index];
        let repeats = active.curve.is_some() && repeats(self.problem, &less.fit, active);
        let (evidence, least) = if repeats {
            (CURVE_EVIDENCE, LEAST_SIZE)
        } else if active.is_unnamed() {
            (CURVE_EVIDENCE, CURVE_SIZE - 1.0)
        } else {
            needs(active.hypothesis, &best.fit)
        };
        let effective = &self.problem.effective_samples;
        let ahead = best.ahead_of(less, effective) >= evidence;
        let strong = ahead || repeats || overwhelming(best, less);
        let matters = matters(self.problem, &best.fit, &less.fit, least, least);
        let possible = is_timely(self.problem, active) && plausible(self.problem, active);
        possible && strong && matters
    }

    /// Which effects are certain by Wald's test, to first order and with a wide margin: these need no refit without
    /// them.
    fn sure(&self, fit: &Fit) -> Vec<bool> {
        let wald = wald(self.problem, fit);
        let effective = &self.problem.effective_samples;
        let each = fit.actives.iter().zip(wald);
        each.map(|(active, chi_square)| {
            let joints = Fit::joints_of(&active.hypothesis, self.problem.joints);
            let rows: f64 = joints.iter().map(|&j| fit.count[j]).sum();
            let effective = joints.iter().map(|&j| effective[j]).fold(1.0, f64::min);
            let (evidence, size) = needs(active.hypothesis, fit);
            is_timely(self.problem, active)
                && plausible(self.problem, active)
                && !active.is_unnamed()
                && 0.5 * effective * chi_square > CERTAIN_TIMES * evidence + CERTAIN_MORE
                && chi_square > CERTAIN_TIMES * size * rows
        })
        .collect()
    }

    /// The explanation without one of its effects, refined.
    pub fn without(&self, from: &Explanation, index: usize) -> Explanation {
        let mut penalties = from.penalties.clone();
        penalties.remove(index);
        let joints = Fit::joints_of(&from.fit.actives[index].hypothesis, self.problem.joints);
        Explanation {
            fit: from.fit.without(self.problem, index).refined_at(
                self.problem,
                Some(&joints),
                from.fit.likelihood(),
            ),
            penalties,
        }
    }

    /// Removes effects that last and whose effort the white noise of every joint hides: what is so small is what smoothing
    /// and clocks leave, however many rows speak for it. The smallest are removed first.
    pub fn without_hidden(&self, mut best: Explanation) -> Explanation {
        loop {
            let lasting: Vec<usize> = (0..best.fit.actives.len())
                .filter(|&i| {
                    let hypothesis = &best.fit.actives[i].hypothesis;
                    hypothesis.lasts() && !hypothesis.is_torque_scale()
                })
                .collect();
            let without = parallel::map(&lasting, |&i| self.without(&best, i));
            let size = |less: &Explanation| {
                let at = |j: usize| {
                    let more = (less.fit.squares[j] - best.fit.squares[j]).max(0.0);
                    let noise = self.problem.unfiltered_noise[j].max(f64::MIN_POSITIVE);
                    (more / best.fit.count[j].max(1.0)).sqrt() / noise
                };
                (0..self.problem.joints).map(at).fold(0.0, f64::max)
            };
            let sized = without.into_iter().map(|less| (size(&less), less));
            let Some((size, less)) = sized.min_by(|(a, _), (b, _)| a.total_cmp(b)) else {
                return best;
            };
            if size >= HIDDEN {
                return best;
            }
            best = less;
        }
    }

    /// Removes named effects that explain less than `NAMED_SIZE` of the residual at their joints, where that is far
    /// above the noise: an effect that the library lacks may imitate them. The smallest are removed first.
    pub fn without_small(&self, mut best: Explanation) -> Explanation {
        loop {
            let names: Vec<usize> = (0..best.fit.actives.len())
                .filter(|&i| {
                    let active = &best.fit.actives[i];
                    let once = active.hypothesis.time_kind() == TimeKind::Once;
                    !active.is_unnamed() && !once && !active.hypothesis.is_torque_scale()
                })
                .collect();
            let without = parallel::map(&names, |&i| self.without(&best, i));
            let size = |less: &Explanation| {
                let each = less.fit.variance.iter().zip(&best.fit.variance);
                each.map(|(less, best)| less / best).fold(0.0, f64::max)
            };
            let small = names.iter().zip(without).filter(|(_, less)| {
                !matters(self.problem, &best.fit, &less.fit, LEAST_SIZE, NAMED_SIZE)
            });
            let Some((&index, less)) = small.min_by(|(_, a), (_, b)| size(a).total_cmp(&size(b)))
            else {
                return best;
            };
            (self.say)(&left_out(&best, index));
            best = less;
        }
    }
}
