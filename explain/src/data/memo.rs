//! Cache of a problem: computed columns and efforts.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use crate::data::column::Columns;
use crate::data::efforts::TrackEfforts;

/// Largest number of rows of a problem that uses the cache.
/// Resolution: larger problems compute the same numbers again, which takes time instead of memory.
pub const MOST_ROWS: usize = 12_000;
/// Largest number of values kept of each kind: 160 MB.
/// Resolution: memory against computing time.
const KEPT_NUMBERS: usize = 20_000_000;

/// An effect, its place (joint, source joint, link), and the bits of its nonlinear parameters.
pub type Key = (&'static str, [usize; 3], Vec<u64>);

/// Columns and efforts of effects, by effect, place and nonlinear parameters.
#[derive(Debug, Default)]
pub struct ColumnCache {
    /// Filtered columns of effects that only add to the recorded effort.
    pub columns: Kept<Columns>,
    /// Unfiltered efforts of effects on bodies.
    pub bodies: Kept<BodyEfforts>,
}

/// The effort of an effect on bodies at given nonlinear parameters, unfiltered and before torque scales.
#[derive(Debug)]
pub struct BodyEfforts {
    /// Effort with all linear coefficients at zero, `None` if it is zero.
    pub alone: Option<TrackEfforts>,
    /// Effort per unit of each linear coefficient.
    pub factors: Vec<TrackEfforts>,
}

/// A quantity in which the effort of bodies is linear.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unit {
    /// The ten inertial parameters at a link's frame, see [`tauscope_dynamics::Inertia::parameters`].
    Inertia(usize),
    /// Gravity along the base's axes \[m/s²\].
    Gravity,
}

/// Efforts of unit quantities, at most one set for each link.
#[derive(Debug, Default)]
pub struct UnitEfforts {
    /// Unfiltered.
    pub efforts: Shared<Vec<TrackEfforts>>,
    /// Filtered, as signals.
    pub signals: Shared<Vec<Vec<f64>>>,
}

/// A map whose entries are computed on first use.
#[derive(Debug)]
pub struct Shared<T>(Mutex<HashMap<Unit, Arc<T>>>);

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T> Shared<T> {
    /// Returns the entry of `unit`; computes and stores it if there is none.
    pub fn get_or(&self, unit: Unit, compute: impl FnOnce() -> T) -> Arc<T> {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().get(&unit) {
            return Arc::clone(known);
        }
        let new = Arc::new(compute());
        Arc::clone(lock().entry(unit).or_insert(new))
    }
}

/// A cache that evicts its oldest entries beyond [`KEPT_NUMBERS`].
#[derive(Debug)]
pub struct Kept<T>(Mutex<KeptInner<T>>);

#[derive(Debug)]
struct KeptInner<T> {
    all: HashMap<Key, Arc<T>>,
    /// Keys from the oldest on, each with its number of values.
    order: VecDeque<(Key, usize)>,
    numbers: usize,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(Mutex::new(KeptInner {
            all: HashMap::new(),
            order: VecDeque::new(),
            numbers: 0,
        }))
    }
}

impl<T> Kept<T> {
    /// Returns the entry of `key`; computes and stores it if there is none. `compute` also returns its number of
    /// values.
    pub fn get_or(&self, key: Key, compute: impl FnOnce() -> (T, usize)) -> Arc<T> {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().all.get(&key) {
            return Arc::clone(known);
        }
        let (new, numbers) = compute();
        let new = Arc::new(new);
        let mut kept = lock();
        if kept.all.insert(key.clone(), Arc::clone(&new)).is_none() {
            kept.order.push_back((key, numbers));
            kept.numbers += numbers;
        }
        while kept.numbers > KEPT_NUMBERS
            && let Some((oldest, numbers)) = kept.order.pop_front()
        {
            kept.all.remove(&oldest);
            kept.numbers -= numbers;
        }
        new
    }
}
