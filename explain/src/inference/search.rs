//! The search: a beam over sets of effects with generic moves.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_dynamics::terms::PlaceKind;

use crate::parallel;
use crate::physics::active::Hypothesis;

use super::around::Around;
use super::objective::{Objective, Set};

/// Sets that are kept from one step to the next. Chosen: for the computing time.
const BEAM: usize = 3;
/// Best additions that are tried of each set. Resolution: changes the computing time.
const ADDED: usize = 6;
/// Best replacements that are tried for each effect. Resolution: changes the computing time.
const REPLACED: usize = 3;
/// Best floods that are followed. Resolution: changes the computing time.
const FLOODS: usize = 3;
/// Effects of the smallest first-order loss that are left out in trial. Resolution: changes the computing time.
const IDLEST: usize = 3;
/// Most steps. Resolution: bounds the computing time; a step that gains nothing is the last.
const STEPS: usize = 30;
/// A step that gains less is the last \[nats\]. Resolution: of the objective's rounding.
const LEAST_GAIN: f64 = 1e-6;

/// The best set that is found from `start`.
pub fn search(objective: &Objective<'_>, start: Set) -> Set {
    let all: Vec<usize> = (0..objective.variants.len()).collect();
    let mut best = start.clone();
    let coarse = coarse(objective, &start);
    for set in [coarse, start] {
        best = better(objective, best, warm(objective, set, &all));
    }
    for set in flooded(objective, &best) {
        best = better(objective, best, warm(objective, set, &all));
    }
    let mut beam = vec![best.clone()];
    let mut done = BTreeSet::new();
    for _ in 0..STEPS {
        let mut next: BTreeMap<Set, f64> = BTreeMap::new();
        for set in &beam {
            if done.insert(set.clone()) {
                neighbours(objective, set, &mut next);
            }
        }
        let mut ranked: Vec<(Set, f64)> = next
            .into_iter()
            .filter(|(set, _)| !done.contains(set))
            .collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        ranked.truncate(2 * BEAM);
        // First-order values of sets are exact but for the signs of the others' factors.
        let mut exact: Vec<(f64, Set)> = ranked
            .into_iter()
            .map(|(set, _)| (objective.score(&set), set))
            .collect();
        exact.sort_by(|a, b| b.0.total_cmp(&a.0));
        exact.truncate(BEAM);
        let Some((score, set)) = exact.first() else {
            break;
        };
        if *score <= objective.score(&best) + LEAST_GAIN {
            break;
        }
        best.clone_from(set);
        beam = exact.into_iter().map(|(_, set)| set).collect();
    }
    best
}

/// The better of two sets.
fn better(objective: &Objective<'_>, a: Set, b: Set) -> Set {
    if objective.score(&b) > objective.score(&a) {
        b
    } else {
        a
    }
}

/// A set with the best of the effects that all joints feel and the ordinary ones.
fn coarse(objective: &Objective<'_>, start: &Set) -> Set {
    let common = |v: &usize| {
        let hypothesis = objective.variants[*v].hypothesis;
        hypothesis.only_joint().is_none() || hypothesis.is_ordinary()
    };
    let first: Vec<usize> = (0..objective.variants.len()).filter(common).collect();
    warm(objective, start.clone(), &first)
}

/// Sets with one effect of the same kind at every joint, less those that gain nothing: effects that are added one by one can
/// imitate others together.
fn flooded(objective: &Objective<'_>, start: &Set) -> Vec<Set> {
    let every = 0..objective.variants.len();
    let mut kinds: Vec<&str> = Vec::new();
    for v in every.clone() {
        let hypothesis = objective.variants[v].hypothesis;
        let own = hypothesis.effect.name;
        let floods = hypothesis.only_joint().is_some()
            && hypothesis.is_linear()
            && !hypothesis.is_coupling()
            && objective.variants[v].curve.is_none();
        if floods && !kinds.contains(&own) {
            kinds.push(own);
        }
    }
    let of_kind = |kind: &&str| {
        let own = |v: &usize| objective.variants[*v].hypothesis.effect.name == *kind;
        let joined = every.clone().filter(own).fold(start.clone(), |set, v| {
            if objective.fits(&set, v) {
                with(&set, v)
            } else {
                set
            }
        });
        let ebbed = without_idle(objective, joined);
        (objective.score(&ebbed), ebbed)
    };
    let mut floods = parallel::map(&kinds, of_kind);
    floods.sort_by(|a, b| b.0.total_cmp(&a.0));
    floods
        .into_iter()
        .take(FLOODS)
        .map(|(_, set)| set)
        .collect()
}

/// The place of an effect: what is added at the same time in a warm start acts at different ones.
fn place(hypothesis: Hypothesis) -> (bool, usize) {
    let at_joint = matches!(
        hypothesis.effect.place,
        PlaceKind::Joint | PlaceKind::TwoJoints
    );
    let whole = if at_joint {
        hypothesis.place.joint
    } else {
        hypothesis.place.link
    };
    (at_joint, whole)
}

fn with(set: &Set, variant: usize) -> Set {
    let mut set = set.clone();
    if let Err(at) = set.binary_search(&variant) {
        set.insert(at, variant);
    }
    set
}

/// A set without one of its variants.
pub fn without(set: &Set, variant: usize) -> Set {
    set.iter().copied().filter(|v| *v != variant).collect()
}

fn ranked(gains: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..gains.len()).filter(|&v| gains[v].is_finite()).collect();
    order.sort_by(|&a, &b| gains[b].total_cmp(&gains[a]).then(a.cmp(&b)));
    order
}

/// The best addition of every place at once, as long as that gains; then what the newcomers made idle leaves.
fn warm(objective: &Objective<'_>, start: Set, allowed: &[usize]) -> Set {
    let mut best = start;
    loop {
        let mut gains = vec![f64::NEG_INFINITY; objective.variants.len()];
        let Some(around) = Around::new(objective, &best) else {
            return best;
        };
        for (v, gain) in around.additions(&[], allowed) {
            gains[v] = gain;
        }
        let mut picked: BTreeMap<(bool, usize), usize> = BTreeMap::new();
        let order = ranked(&gains);
        for &v in order.iter().take_while(|&&v| gains[v] > 0.0) {
            picked
                .entry(place(objective.variants[v].hypothesis))
                .or_insert(v);
        }
        let Some(&first) = order.first().filter(|&&v| gains[v] > 0.0) else {
            return best;
        };
        let one = with(&best, first);
        let all = picked.values().fold(best.clone(), |set, &v| with(&set, v));
        let before = objective.score(&best);
        best = if objective.score(&all) > objective.score(&one) {
            all
        } else {
            one
        };
        best = without_idle(objective, best);
        if objective.score(&best) <= before + LEAST_GAIN {
            return best;
        }
    }
}

/// The set without the effects that it is no worse without, the idlest first.
pub fn without_idle(objective: &Objective<'_>, mut best: Set) -> Set {
    loop {
        let Some(around) = Around::new(objective, &best) else {
            return best;
        };
        let own = objective.score(&best);
        let free = best.iter().filter(|&&v| !objective.variants[v].is_forced);
        let mut losses: Vec<(f64, usize)> = free
            .map(|&v| {
                let exact = || own - objective.score(&without(&best, v));
                (around.loss(v).unwrap_or_else(exact), v)
            })
            .collect();
        losses.sort_by(|a, b| a.0.total_cmp(&b.0));
        let idlest = losses.iter().take(IDLEST);
        let less = idlest.map(|(_, v)| without(&best, *v));
        let less = less.max_by(|a, b| objective.score(a).total_cmp(&objective.score(b)));
        match less {
            Some(less) if objective.score(&less) >= own => best = less,
            _ => return best,
        }
    }
}

/// The sets that one move makes of a set, with their first-order values.
fn neighbours(objective: &Objective<'_>, set: &Set, next: &mut BTreeMap<Set, f64>) {
    let own = objective.score(set);
    let Some(around) = Around::new(objective, set) else {
        return;
    };
    let mut offers: Vec<(Set, f64)> = Vec::new();
    let every: Vec<usize> = (0..objective.variants.len()).collect();
    let gains = around.additions(&[], &every);
    let gains: Vec<f64> = gains.into_iter().map(|(_, gain)| gain).collect();
    for v in ranked(&gains).into_iter().take(ADDED) {
        offers.push((with(set, v), own + gains[v]));
    }
    let free: Vec<usize> = set
        .iter()
        .copied()
        .filter(|&v| !objective.variants[v].is_forced)
        .collect();
    let of = |&v: &usize| replacements(objective, &around, set, v);
    offers.extend(parallel::map(&free, of).into_iter().flatten());
    offers.extend(collapsed(objective, set, &free));
    offers.extend(without_kinds(objective, set, &free));
    offers.extend(merged(objective, &around, set, &free));
    for (set, value) in offers {
        let known = next.entry(set).or_insert(f64::NEG_INFINITY);
        *known = known.max(value);
    }
}

/// Gains in value by adding each of these variants to a set \[nats\].
fn additions(objective: &Objective<'_>, set: &Set, variants: &[usize]) -> Vec<(usize, f64)> {
    Around::new(objective, set).map_or_else(Vec::new, |around| around.additions(&[], variants))
}

/// Moves that exchange all effects of one joint but the ordinary ones for one or two.
fn collapsed(objective: &Objective<'_>, set: &Set, free: &[usize]) -> Vec<(Set, f64)> {
    let mut joints: Vec<Option<usize>> = free
        .iter()
        .map(|&v| objective.variants[v].hypothesis.only_joint())
        .collect();
    joints.sort_unstable();
    joints.dedup();
    let collapse = |joint: &Option<usize>| -> Vec<(Set, f64)> {
        let own = |v: &usize| {
            let hypothesis = objective.variants[*v].hypothesis;
            hypothesis.only_joint() == *joint
                && !hypothesis.is_ordinary()
                && !objective.variants[*v].is_forced
        };
        if free.iter().filter(|v| own(v)).count() < 3 {
            return Vec::new();
        }
        let mut less: Set = set.iter().copied().filter(|v| !own(v)).collect();
        let at_joint: Vec<usize> = (0..objective.variants.len())
            .filter(|&v| objective.variants[v].hypothesis.only_joint() == *joint)
            .collect();
        let mut offers = Vec::new();
        for _ in 0..2 {
            let gains = additions(objective, &less, &at_joint);
            let Some((best, _)) = gains.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            less = with(&less, best);
            offers.push((less.clone(), objective.score(&less)));
        }
        offers
    };
    parallel::map(&joints, collapse)
        .into_iter()
        .flatten()
        .collect()
}

/// Moves that remove all effects of one kind: each of them may only make up for the others.
fn without_kinds(objective: &Objective<'_>, set: &Set, free: &[usize]) -> Vec<(Set, f64)> {
    let kinds: BTreeSet<&str> = free
        .iter()
        .map(|&v| objective.variants[v].hypothesis.effect.name)
        .collect();
    let mut offers = Vec::new();
    for kind in kinds {
        let is_kept = |v: &usize| {
            let variant = &objective.variants[*v];
            variant.is_forced || variant.hypothesis.effect.name != kind
        };
        let less: Set = set.iter().copied().filter(is_kept).collect();
        if less.len() + 1 < set.len() {
            let score = objective.score(&less);
            offers.push((less, score));
        }
    }
    offers
}

/// Moves that replace two effects by one.
fn merged(
    objective: &Objective<'_>,
    around: &Around<'_>,
    set: &Set,
    free: &[usize],
) -> Vec<(Set, f64)> {
    let pairs: Vec<(usize, usize)> = free
        .iter()
        .enumerate()
        .flat_map(|(i, &v)| free[i + 1..].iter().map(move |&w| (v, w)))
        .filter(|&(v, w)| objective.related(v).contains(&w))
        .collect();
    let merge = |&(v, w): &(usize, usize)| {
        let less = without(&without(set, v), w);
        let score = objective.score(&less);
        let gains = around.additions(&[v, w], objective.related(v));
        let best = gains
            .into_iter()
            .filter(|(x, _)| *x != w)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        best.map(|(x, gain)| (with(&less, x), score + gain))
    };
    parallel::map(&pairs, merge).into_iter().flatten().collect()
}

/// Moves that remove an effect of a set, replace it, or split it into two.
fn replacements(
    objective: &Objective<'_>,
    around: &Around<'_>,
    set: &Set,
    v: usize,
) -> Vec<(Set, f64)> {
    let less = without(set, v);
    let score = objective.score(&less);
    let mut offers = vec![(less.clone(), score)];
    let mut gains = around.additions(&[v], objective.related(v));
    gains.retain(|(_, gain)| gain.is_finite());
    gains.sort_by(|a, b| b.1.total_cmp(&a.1));
    for &(w, gain) in gains.iter().take(REPLACED) {
        offers.push((with(&less, w), score + gain));
    }
    if let Some(&(w, gain)) = gains.first().filter(|(_, gain)| *gain > 0.0) {
        let half = with(&less, w);
        let more = additions(objective, &half, objective.related(v));
        let second = more.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((x, more)) = second.filter(|(_, more)| more.is_finite()) {
            offers.push((with(&half, x), score + gain + more));
        }
    }
    offers
}
