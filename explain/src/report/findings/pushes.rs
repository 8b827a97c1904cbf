//! Pushes whose force varies: boxes at one link that overlap in time are one push.

use nalgebra::DMatrix;
use tauscope_dynamics::terms::{CoordinateKind, Family};

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::interval::parameter_deviations;
use crate::physics::active::{Active, TimeKind};

/// Beginning and end of a push \[s of the session\]; nothing for another effect.
fn times(active: &Active) -> Option<[f64; 2]> {
    let effect = active.hypothesis.effect;
    let is_push = effect.family == Family::Contact && effect.time() == TimeKind::Once;
    let all = (0..active.coordinates.len()).filter(|c| is_time(active, *c));
    let all: Vec<f64> = all.map(|c| active.coordinates[c]).collect();
    is_push.then_some(())?;
    Some([*all.first()?, *all.last()?])
}

fn is_time(active: &Active, coordinate: usize) -> bool {
    active.kind(coordinate) == CoordinateKind::SessionTime
}

/// The effects of a fit that are one finding with that of `index`, ascending: itself, and of a push all boxes that overlap
/// with it or with each other.
pub fn parts(fit: &Fit, index: usize) -> Vec<usize> {
    let mut parts = vec![index];
    let own = fit.actives[index].hypothesis;
    let overlap = |a: usize, b: usize| match (times(&fit.actives[a]), times(&fit.actives[b])) {
        (Some([from, to]), Some([other_from, other_to])) => from <= other_to && other_from <= to,
        _ => false,
    };
    loop {
        let is_new = |b: &usize| {
            let at_place = fit.actives[*b].hypothesis == own && !parts.contains(b);
            at_place && parts.iter().any(|a| overlap(*a, *b))
        };
        let Some(next) = (0..fit.actives.len()).find(is_new) else {
            parts.sort_unstable();
            return parts;
        };
        parts.push(next);
    }
}

/// One effect in the place of its `parts`: from the first beginning to the last end, with the largest force in between.
/// With it, the standard deviations of its parameters.
pub fn joined(
    problem: &Problem,
    fit: &Fit,
    covariance: &DMatrix<f64>,
    parts: &[usize],
) -> (Active, Vec<f64>) {
    let deviations = |index: usize| parameter_deviations(problem, fit, covariance, index);
    let mut whole = fit.actives[parts[0]].clone();
    if parts.len() == 1 {
        return (whole, deviations(parts[0]));
    }
    let of = |index: usize, coordinate: usize| fit.actives[index].coordinates[coordinate];
    let forces = whole.hypothesis.factors();
    // The largest force is reached where a box begins.
    let at = |t: f64| -> Vec<usize> {
        let acts =
            |i: &&usize| times(&fit.actives[**i]).is_some_and(|[from, to]| from <= t && t < to);
        parts.iter().filter(acts).copied().collect()
    };
    let square = |acting: &Vec<usize>| -> f64 {
        let total = |c: &usize| acting.iter().map(|i| of(*i, *c)).sum::<f64>();
        forces.iter().map(|c| total(c).powi(2)).sum()
    };
    let begins = parts.iter().filter_map(|i| times(&fit.actives[*i]));
    let peaks = begins.map(|[from, _]| at(from));
    let peak = peaks.max_by(|a, b| square(a).total_cmp(&square(b)));
    let peak = peak.unwrap_or_default();
    let first = |index: usize| -> usize {
        let before = fit.actives[..index].iter();
        before.map(|active| active.coordinates.len()).sum()
    };
    let mut all = deviations(parts[0]);
    for c in forces {
        whole.coordinates[c] = peak.iter().map(|i| of(*i, c)).sum();
        let pairs = peak.iter().flat_map(|a| peak.iter().map(move |b| (a, b)));
        let variance: f64 = pairs
            .map(|(a, b)| covariance[(first(*a) + c, first(*b) + c)])
            .sum();
        all[c] = variance.max(0.0).sqrt();
    }
    let is_time = |c: &usize| is_time(&whole, *c);
    let when: Vec<usize> = (0..whole.coordinates.len()).filter(is_time).collect();
    for (c, is_end) in when.into_iter().zip([false, true]) {
        let order = |a: &usize, b: &usize| of(*a, c).total_cmp(&of(*b, c));
        let all_parts = parts.iter().copied();
        let outer = if is_end {
            all_parts.max_by(order)
        } else {
            all_parts.min_by(order)
        };
        if let Some(outer) = outer {
            whole.coordinates[c] = of(outer, c);
            all[c] = deviations(outer)[c];
        }
    }
    (whole, all)
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;

    use super::*;
    use crate::fixture::problem_with;
    use crate::physics::active::{Hypothesis, Whereabouts};

    /// Guards against several findings for one push that grows and fades.
    #[test]
    fn boxes_that_overlap_are_one_push() {
        let problem = problem_with(3, |_, _, _| {});
        let push = Hypothesis {
            effect: effect("external_push").unwrap(),
            place: Whereabouts {
                link: 2,
                ..Whereabouts::default()
            },
        };
        let start_s = problem.tracks[0].track.session_s;
        let at = |force_n: f64, from: f64, to: f64| {
            push.with(vec![force_n, 0.0, 0.0, start_s + from, start_s + to])
        };
        let actives = vec![at(4.0, 2.0, 3.0), at(9.0, 7.0, 8.0), at(6.0, 2.2, 2.8)];
        let fit = Fit::new(&problem, actives);
        assert_eq!(parts(&fit, 2), [0, 2]);
        assert_eq!(parts(&fit, 1), [1]);
        let mut covariance = DMatrix::identity(15, 15);
        // Of two boxes that overlap only the sum is well known.
        covariance[(0, 10)] = -0.9;
        covariance[(10, 0)] = -0.9;
        let (whole, deviations) = joined(&problem, &fit, &covariance, &[0, 2]);
        assert_eq!(whole.coordinates, at(10.0, 2.0, 3.0).coordinates);
        assert!((deviations[0] - 0.2_f64.sqrt()).abs() < 1e-9);
    }
}
