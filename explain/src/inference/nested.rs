//! The simplest of the laws that nest in each other and that the recordings do not distinguish.

use super::margins::AS_LIKELY;
use super::objective::{Objective, Set};

/// The set with each law replaced by the simpler one that it contains, where that is as likely.
pub fn simplest(objective: &Objective<'_>, mut set: Set) -> Set {
    loop {
        let whole = objective.score(&set);
        let swaps = set.iter().flat_map(|&v| {
            let less: Set = set.iter().copied().filter(|w| *w != v).collect();
            let own = objective.variants[v].hypothesis;
            let is_simpler = move |w: &usize| {
                let other = objective.variants[*w].hypothesis;
                let simpler = own.effect.simpler.map(|simpler| simpler.effect);
                other.place == own.place && simpler == Some(other.effect)
            };
            // Next to a correction of stated friction the simpler law would be that correction twice.
            let joins = {
                let less = less.clone();
                move |w: &usize| objective.fits(&less, *w)
            };
            let simpler = (0..objective.variants.len())
                .filter(is_simpler)
                .filter(joins);
            simpler.map(move |w| {
                let mut swapped = less.clone();
                swapped.insert(swapped.partition_point(|x| *x < w), w);
                swapped
            })
        });
        let best = swaps.max_by(|a, b| objective.score(a).total_cmp(&objective.score(b)));
        match best.filter(|swapped| objective.score(swapped) > whole - AS_LIKELY) {
            Some(swapped) => set = swapped,
            None => return set,
        }
    }
}
