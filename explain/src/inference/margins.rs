//! Margin and alternatives of each effect of an explanation.

use crate::physics::active::Hypothesis;

use super::around::Around;
use super::objective::{Objective, Set};
use super::variants::simplest;

/// An explanation that is less far behind explains the recordings as well \[nats\]. Statistical: odds of 20 to 1.
pub const AS_LIKELY: f64 = 3.0;
/// Alternatives that are kept of each effect. Resolution: reports list three.
const KEPT: usize = 5;

/// An effect that could take the place of another.
#[derive(Debug, Clone, Copy)]
pub struct Alternative {
    /// The effect and its place.
    pub hypothesis: Hypothesis,
    /// Loss of the explanation with it in the place of the other \[nats\].
    pub behind: f64,
}

/// For each of the `effects` of a set: what is lost without it, whatever takes its place, and what that could be.
pub fn margins(
    objective: &Objective<'_>,
    set: &Set,
    effects: &[Hypothesis],
) -> (Vec<f64>, Vec<Vec<Alternative>>) {
    let whole = objective.score(set);
    let around = Around::new(objective, set);
    let of = |own: &Hypothesis| {
        let Some(&v) = set
            .iter()
            .find(|&&v| objective.variants[v].hypothesis == *own)
        else {
            return (0.0, Vec::new());
        };
        // An effect of several parts at its place, as two ripples or an unknown law of two arguments, is one.
        let is_part = |w: &usize| {
            let other = objective.variants[*w].hypothesis;
            other.said() == own.said() && other.place == own.place
        };
        let (parts, less): (Set, Set) = set.iter().partition(|w| is_part(w));
        let score = objective.score(&less);
        let gains = (around.iter()).flat_map(|a| a.additions(&parts, objective.related(v)));
        let mut others: Vec<Alternative> = gains
            .map(|(w, gain)| Alternative {
                hypothesis: objective.variants[w].hypothesis,
                behind: whole - score - gain,
            })
            .filter(|other| other.behind.is_finite() && other.hypothesis != *own)
            .collect();
        others.sort_by(|a, b| a.behind.total_cmp(&b.behind));
        others.dedup_by(|a, b| a.hypothesis == b.hypothesis);
        // Laws that nest are one finding at one place.
        let nests = |other: &Alternative| {
            let other = other.hypothesis;
            let is_alike = simplest(other) == simplest(*own) || other.said() == own.said();
            other.place == own.place && is_alike
        };
        let rival = others.iter().find(|other| !nests(other));
        let margin = rival
            .map_or(f64::INFINITY, |rival| rival.behind)
            .min(whole - score);
        others.truncate(KEPT);
        (margin, others)
    };
    effects.iter().map(of).unzip()
}
