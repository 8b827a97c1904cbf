//! A bound on what an explanation computes.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// What is left out once a search has reached its bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Untried {
    /// An effect for which there was evidence.
    FurtherEffects,
    /// Rivals in the place of what was found.
    OtherNames,
}

/// Multiplications of two columns in a nanosecond.
/// Resolution: by `perf record` of `explain` on one real arm and two simulated ones.
const PRODUCTS_PER_NS: usize = 4;

/// What a term with its filter costs for each joint and sample \[ns of one core\].
/// Resolution: by `perf record` of `explain` on one real arm and two simulated ones.
pub const OF_TERM_NS: usize = 30;

/// How much was computed, in nanoseconds of one core, roughly. It is counted and not timed: the same input gives the
/// same report on every machine.
#[derive(Debug)]
pub struct Work {
    most: u64,
    spent: AtomicU64,
    untried: Mutex<BTreeSet<Untried>>,
}

impl Default for Work {
    fn default() -> Self {
        Self::bounded(u64::MAX)
    }
}

impl Work {
    /// With a bound on [`Work::add`].
    pub fn bounded(most: u64) -> Self {
        Self {
            most,
            spent: AtomicU64::new(0),
            untried: Mutex::default(),
        }
    }

    /// Adds so many nanoseconds of one core.
    pub fn add(&self, ns: usize) {
        self.spent.fetch_add(ns as u64, Ordering::Relaxed);
    }

    /// Adds so many multiplications of columns with each other.
    pub fn add_products(&self, count: usize) {
        self.add(count / PRODUCTS_PER_NS);
    }

    /// Adds so many evaluations of a term, each of one joint at one sample.
    pub fn add_terms(&self, count: usize) {
        self.add(count * OF_TERM_NS);
    }

    /// Whether the bound is reached. Then `left_out` is noted. To be asked only where no other thread adds, so that the
    /// answer is always the same.
    pub fn is_spent(&self, left_out: Untried) -> bool {
        let is_spent = self.spent.load(Ordering::Relaxed) > self.most;
        if is_spent {
            let untried = self.untried.lock();
            untried
                .unwrap_or_else(PoisonError::into_inner)
                .insert(left_out);
        }
        is_spent
    }

    /// What was left out.
    pub fn untried(&self) -> BTreeSet<Untried> {
        let untried = self.untried.lock();
        untried.unwrap_or_else(PoisonError::into_inner).clone()
    }
}
