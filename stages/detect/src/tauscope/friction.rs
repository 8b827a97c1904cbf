//! What a residual is over a joint's own velocity: friction that the twin leaves out.
//!
//! A twin of gains and offsets knows no friction, which is most of what is usual in the residual of an arm that moves. It is learnt as
//! a curve over the joint's velocity, where that foretells recordings it was not learnt from, and followed while the arm warms up: each sample turns the curve towards
//! what it shows (a least mean square step with the curve's features made independent: Sayed, "Fundamentals of Adaptive Filtering", 2003, section 4.4).

use nalgebra::{SMatrix, SVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pieces::FOLDS;

/// A curve's features: a constant, viscous friction, and Coulomb friction that sets in over these shares of the usual highest speed.
const FEATURES: usize = 4;
const SETS_IN: [f64; 2] = [0.1, 0.02];
/// A curve is believed as if so much had been seen without friction \[s\].
const PRIOR_S: f64 = 1.0;
/// It is used where this share of the squared residual is left of recordings it was not learnt from.
const PAYS: f64 = 0.6;
/// It is believed to be right to this share of itself.
const RIGHT_TO: f64 = 0.1;

type Features = SVector<f64, FEATURES>;
/// Products of the features and the residual with each other, summed over time.
type Products = SMatrix<f64, { FEATURES + 1 }, { FEATURES + 1 }>;

/// The usual residual over a joint's own velocity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntFriction {
    /// What the residual is by feature: 1, v, tanh(10 v), tanh(50 v), with v in shares of the usual highest speed \[effort unit\].
    pub weights: [f64; FEATURES],
    /// Inverse of the features' mean products with each other, row by row: how fast each is followed.
    pub inverse_products: Vec<f64>,
}

fn features(velocity: f64, fast: f64) -> Features {
    let v = velocity / fast;
    Features::new(1.0, v, (v / SETS_IN[0]).tanh(), (v / SETS_IN[1]).tanh())
}

/// What one stretch of a recording shows of a joint.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    products: Products,
    /// The part of the data that it is held out with.
    fold: usize,
}

impl Shown {
    /// Nothing yet.
    pub fn of(fold: usize) -> Self {
        Self {
            products: Products::zeros(),
            fold,
        }
    }

    /// Takes a contact-free sample that lasts so long \[s\].
    pub fn add(&mut self, dt_s: f64, velocity: f64, fast: f64, residual: f64) {
        let row = features(velocity, fast).push(residual);
        self.products.ger(dt_s, &row, &row, 1.0);
    }

    /// The same about the stretch's own means: a residual that drifts between stretches is not friction.
    fn centred(&self) -> Products {
        let products = &self.products;
        let row = products.row(0);
        products - row.transpose() * row / products[(0, 0)].max(f64::MIN_POSITIVE)
    }
}

/// The weights of all features but the constant.
fn fit(centred: &Products) -> SVector<f64, { FEATURES - 1 }> {
    let products = centred.fixed_view::<{ FEATURES - 1 }, { FEATURES - 1 }>(1, 1);
    let with_residual = centred.fixed_view::<{ FEATURES - 1 }, 1>(1, FEATURES);
    let held = products + SMatrix::identity() * PRIOR_S;
    held.try_inverse()
        .map_or_else(SVector::zeros, |inverse| inverse * with_residual)
}

impl LearntFriction {
    /// From what stretches of recordings show of a joint; nothing where that does not foretell what is held out.
    pub(super) fn new(shown: &[Shown]) -> Option<Self> {
        let mut folds = [Products::zeros(); FOLDS];
        for shown in shown {
            folds[shown.fold] += shown.centred();
        }
        let whole: Products = folds.iter().sum();
        let mut left = 0.0;
        for own in &folds {
            let weights = fit(&(whole - own));
            // Squared residual less the curve: with -1 for the residual's own weight.
            let all = SVector::<f64, { FEATURES + 1 }>::from_fn(|i, _| match i {
                0 => 0.0,
                FEATURES => -1.0,
                _ => weights[i - 1],
            });
            left += all.dot(&(own * all));
        }
        if left.is_nan() || left > PAYS * whole[(FEATURES, FEATURES)] {
            return None;
        }
        let sum: Products = shown.iter().map(|shown| shown.products).sum();
        let (lasts_s, rest) = (sum[(0, 0)], fit(&whole));
        let means = sum.fixed_view::<1, { FEATURES - 1 }>(0, 1);
        let constant = (sum[(0, FEATURES)] - means.transpose().dot(&rest)) / lasts_s;
        let mut products = sum.fixed_view::<FEATURES, FEATURES>(0, 0) / lasts_s;
        for i in 1..FEATURES {
            products[(i, i)] += PRIOR_S / lasts_s;
        }
        Some(Self {
            weights: [constant, rest[0], rest[1], rest[2]],
            inverse_products: products.try_inverse()?.as_slice().to_vec(),
        })
    }

    /// Whether it holds what it needs.
    pub(super) fn is_whole(&self) -> bool {
        self.inverse_products.len() == FEATURES * FEATURES
    }
}

/// The residual that is usual of a joint just now.
#[derive(Debug, Clone)]
pub(super) struct Usual {
    fast: f64,
    constant: f64,
    weights: Features,
    /// How fast each feature is followed; of a joint without friction the constant alone.
    pace: SMatrix<f64, FEATURES, FEATURES>,
    newest: Features,
}

impl Usual {
    pub fn new(fast: f64, friction: Option<&LearntFriction>) -> Self {
        let mut alone = SMatrix::zeros();
        alone[(0, 0)] = 1.0;
        Self {
            fast,
            constant: friction.map_or(0.0, |friction| friction.weights[0]),
            weights: friction.map_or_else(Features::zeros, |friction| friction.weights.into()),
            pace: friction.map_or(alone, |friction| {
                SMatrix::from_row_slice(&friction.inverse_products)
            }),
            newest: Features::zeros(),
        }
    }

    /// A recording begins: what lay below the residual is not known any longer; how the joint rubs is.
    pub fn reset(&mut self) {
        self.weights[0] = self.constant;
    }

    /// What is usual at this velocity.
    pub fn at(&mut self, velocity: f64) -> f64 {
        self.newest = features(velocity, self.fast);
        self.weights.dot(&self.newest)
    }

    /// Follows what was left of the residual, by this share.
    pub fn follow(&mut self, left: f64, share: f64) {
        self.weights += self.pace * self.newest * (share * left);
    }

    /// Takes what was left of the residual for a constant, by this share.
    pub fn offset(&mut self, left: f64, share: f64) {
        self.weights[0] += share * left;
    }

    /// How far what is usual may be wrong, at the velocity of late.
    pub fn doubt(&self) -> f64 {
        let rubs = self.weights.dot(&self.newest) - self.weights[0];
        RIGHT_TO * rubs
    }
}
