//! What of a joint's residual is usual: friction that the twin leaves out, and how late the twin is.
//!
//! A twin of gains and offsets knows no friction, which is most of what is usual in the residual of an arm that moves; and it knows the
//! motion through a low-pass, so that what it expects comes late where it changes. Both are learnt, linear in features of the joint's velocity and of
//! the expected effort, where that foretells recordings they were not learnt from, and followed while the arm warms up: each sample turns the weights towards
//! what it shows (a least mean square step, the features made independent: Sayed, "Fundamentals of Adaptive Filtering", 2003, section 4.4).

use nalgebra::{SMatrix, SVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pieces::{FOLDS, Piece, marked, quantile};

/// The features: a constant, viscous friction, Coulomb friction that sets in over these shares of the usual highest speed, and how much the
/// expected effort has changed.
pub(super) const FEATURES: usize = 5;
/// Coulomb friction sets in over these shares of the usual highest speed.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SETS_IN: [f64; 2] = [0.1, 0.02];
/// The expected effort has changed since so long ago \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LATE_S: f64 = 0.04;
/// The weights are believed as if for so long all had been seen to be zero \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const PRIOR_S: f64 = 1.0;
/// They are used where this share of the squared residual is left of recordings they were not learnt from.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const PAYS: f64 = 0.6;
/// They are believed to be right to this share of what they say.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const RIGHT_TO: f64 = 0.1;
/// The measured effort is smoothed over so long before its changes are told \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SMOOTH_S: f64 = 0.005;
/// For so long a joint is unquiet whose effort has changed \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CALMS_S: f64 = 0.1;
/// A joint's usual largest change of expected effort: this share of its samples changes less.
/// Statistical: a quantile that one sample in twenty may exceed.
const LIVELY: f64 = 0.95;
/// What is left of a residual stays for so long: samples closer than that tell the same \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CORRELATED_S: f64 = 0.5;
/// A sample lasts no longer than this \[s\].
/// Tuned: a guard against gaps, five periods of the slowest practice set (100 Hz); not swept.
const MOST_STEP_S: f64 = 0.05;

type Features = SVector<f64, FEATURES>;
/// Products of the features and the residual with each other, summed over time.
type Products = SMatrix<f64, { FEATURES + 1 }, { FEATURES + 1 }>;
/// The weights of all features but the constant.
type Weights = SVector<f64, { FEATURES - 1 }>;

/// What of a joint's residual is usual.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntUsual {
    /// By how much its expected effort changes at most, usually, within 40 ms \[effort unit\].
    pub lively: f64,
    /// What the residual is by feature: 1, v, v / √(v² + 0.1²), v / √(v² + 0.02²) and u, with v the velocity in shares of the usual highest, and u the
    /// change of expected effort in shares of the usual largest \[effort unit\].
    pub weights: [f64; FEATURES],
    /// Inverse of the features' mean products with each other, row by row: how fast each is followed, and how little each is known.
    pub inverse_products: Vec<f64>,
    /// How much contact-free time the weights are from \[s\].
    pub from_s: f64,
}

/// What stretches of recordings show of a joint, by the part of the data that they are held out with.
type Shown = [Products; FOLDS];

/// Products about each stretch's own means (a residual that drifts between stretches is not friction), and about zero.
fn shown(
    all: &[Piece<'_>],
    joint: usize,
    fast: f64,
    lively: f64,
    mut visit: impl FnMut(f64),
) -> [Shown; 2] {
    let mut shown = [[Products::zeros(); FOLDS]; 2];
    for piece in all {
        let mut usual = Usual::new(fast, None);
        usual.lively = lively;
        let mut of_piece = Products::zeros();
        let mut before_ns = None;
        for (sample, _, is_free) in marked(piece) {
            let now_ns = sample.header.stamp_ns;
            let dt_s = (now_ns - before_ns.replace(now_ns).unwrap_or(now_ns)) as f64 * 1e-9;
            let dt_s = dt_s.clamp(0.0, MOST_STEP_S);
            let efforts = [sample.effort[joint], sample.expected_effort[joint]];
            usual.step(&Step::of(dt_s), efforts);
            if !is_free {
                continue;
            }
            visit(usual.expected.now.abs());
            let residual = efforts[0] - efforts[1];
            let row = usual.features(sample.velocity[joint]).push(residual);
            of_piece.ger(dt_s, &row, &row, 1.0);
        }
        let row = of_piece.row(0);
        let lasts_s = of_piece[(0, 0)].max(f64::MIN_POSITIVE);
        shown[0][piece.fold] += of_piece - row.transpose() * row / lasts_s;
        shown[1][piece.fold] += of_piece;
    }
    shown
}

fn fit(centred: &Products) -> Weights {
    let products = centred.fixed_view::<{ FEATURES - 1 }, { FEATURES - 1 }>(1, 1);
    let with_residual = centred.fixed_view::<{ FEATURES - 1 }, 1>(1, FEATURES);
    let held = products + SMatrix::identity() * PRIOR_S;
    let inverse = held.try_inverse();
    inverse.map_or_else(Weights::zeros, |inverse| inverse * with_residual)
}

/// Squared residual that is left.
fn left(centred: &Products, weights: &Weights) -> f64 {
    let all = SVector::<f64, { FEATURES + 1 }>::from_fn(|i, _| match i {
        0 => 0.0,
        FEATURES => -1.0,
        _ => weights[i - 1],
    });
    all.dot(&(centred * all))
}

impl LearntUsual {
    /// From the contact-free stretches of recordings; nothing where that does not foretell what is held out. The joint's usual highest speed
    /// is `fast` \[rad/s\].
    pub(super) fn new(all: &[Piece<'_>], joint: usize, fast: f64) -> Option<Self> {
        let mut changes = Vec::new();
        shown(all, joint, fast, 1.0, |change| changes.push(change));
        let lively = quantile(&mut changes, LIVELY).max(1e-9);
        let [centred, about_zero] = shown(all, joint, fast, lively, |_| ());
        let whole: Products = centred.iter().sum();
        let foretold: f64 = (centred.iter())
            .map(|own| left(own, &fit(&(whole - own))))
            .sum();
        if foretold.is_nan() || foretold > PAYS * whole[(FEATURES, FEATURES)] {
            return None;
        }
        let sum: Products = about_zero.iter().sum();
        let (lasts_s, rest) = (sum[(0, 0)], fit(&whole));
        let means = sum.fixed_view::<1, { FEATURES - 1 }>(0, 1);
        let constant = (sum[(0, FEATURES)] - means.transpose().dot(&rest)) / lasts_s;
        let mut products = sum.fixed_view::<FEATURES, FEATURES>(0, 0) / lasts_s;
        for i in 1..FEATURES {
            products[(i, i)] += PRIOR_S / lasts_s;
        }
        let weights = Features::from_fn(|i, _| if i == 0 { constant } else { rest[i - 1] });
        Some(Self {
            lively,
            weights: weights.into(),
            inverse_products: products.try_inverse()?.as_slice().to_vec(),
            from_s: lasts_s,
        })
    }

    /// Goes on from these weights. The constant is that of contact-free recordings: what lies below a residual is another
    /// one after each start.
    pub(super) fn go_on(&mut self, weights: [f64; FEATURES]) {
        self.weights[1..].copy_from_slice(&weights[1..]);
    }

    /// Whether it holds what it needs.
    pub(super) fn is_whole(&self) -> bool {
        let products = self.inverse_products.len() == FEATURES * FEATURES;
        products && self.lively > 0.0 && self.from_s > 0.0
    }
}

/// What a step of so long makes of what is followed; kept, for clocks are often even.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    dt_s: f64,
    /// Shares of what is new that are taken over: of an effort that is followed, and of one that is smoothed; and the share of unrest that stays.
    late: f64,
    smooth: f64,
    stays: f64,
}

impl Step {
    pub fn of(dt_s: f64) -> Self {
        Self {
            dt_s,
            late: 1.0 - (-dt_s / LATE_S).exp(),
            smooth: 1.0 - (-dt_s / SMOOTH_S).exp(),
            stays: (-dt_s / CALMS_S).exp(),
        }
    }

    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Whether it lasts exactly so long.
    pub fn lasts(&self, dt_s: f64) -> bool {
        self.dt_s.to_bits() == dt_s.to_bits()
    }
}

/// What of a joint's residual is usual just now.
#[derive(Debug, Clone)]
pub(super) struct Usual {
    fast: f64,
    lively: f64,
    constant: f64,
    weights: Features,
    /// How fast each feature is followed; nothing where only the constant is.
    pace: Option<SMatrix<f64, FEATURES, FEATURES>>,
    /// The newest features, and how much of that moves the weights.
    newest: Features,
    turn: Features,
    /// So many samples that tell something of their own the weights are from.
    worth: f64,
    expected: Changes,
    measured: Changes,
    /// The measured effort, smoothed.
    smooth: f64,
}

/// How an effort changes.
#[derive(Debug, Clone, Default)]
struct Changes {
    /// What it has been of late.
    late: Option<f64>,
    /// How much it has changed against that, now, and the most of late.
    now: f64,
    most: f64,
}

impl Changes {
    fn step(&mut self, step: &Step, effort: f64) {
        let late = self.late.get_or_insert(effort);
        self.now = effort - *late;
        *late += step.late * self.now;
        self.most = (step.stays * self.most).max(self.now.abs());
    }
}

impl Usual {
    /// Of a joint with this usual highest speed \[rad/s\].
    pub fn new(fast: f64, learnt: Option<&LearntUsual>) -> Self {
        let mut weights = Features::zeros();
        if let Some(learnt) = learnt {
            weights = learnt.weights.into();
        }
        Self {
            fast,
            lively: learnt.map_or(1.0, |learnt| learnt.lively),
            constant: weights[0],
            weights,
            pace: learnt.map(|learnt| SMatrix::from_row_slice(&learnt.inverse_products)),
            newest: Features::zeros(),
            turn: Features::zeros(),
            worth: learnt.map_or(1.0, |learnt| learnt.from_s / CORRELATED_S),
            expected: Changes::default(),
            measured: Changes::default(),
            smooth: 0.0,
        }
    }

    /// What each feature weighs now.
    pub fn weights(&self) -> [f64; FEATURES] {
        self.weights.into()
    }

    /// A recording begins: what lay below the residual is not known any longer; how the joint rubs is.
    pub fn reset(&mut self) {
        self.weights[0] = self.constant;
        self.expected = Changes::default();
        self.measured = Changes::default();
    }

    fn step(&mut self, step: &Step, [measured, expected]: [f64; 2]) {
        if self.measured.late.is_none() {
            self.smooth = measured;
        }
        self.smooth += step.smooth * (measured - self.smooth);
        self.measured.step(step, self.smooth);
        self.expected.step(step, expected);
    }

    fn features(&self, velocity: f64) -> Features {
        let v = velocity / self.fast;
        let coulomb = SETS_IN.map(|sets_in| v / v.hypot(sets_in));
        let late = self.expected.now / self.lively;
        Features::from([1.0, v, coulomb[0], coulomb[1], late])
    }

    /// The next sample, with its measured and expected effort: what of its residual is usual.
    pub fn next(&mut self, step: &Step, velocity: f64, efforts: [f64; 2]) -> f64 {
        self.step(step, efforts);
        let Some(pace) = &self.pace else {
            return self.weights[0];
        };
        self.newest = self.features(velocity);
        self.turn = pace * self.newest;
        self.weights.dot(&self.newest)
    }

    /// Follows what was `left` of the residual by this share.
    pub fn follow(&mut self, left: f64, share: f64) {
        if self.pace.is_none() {
            self.offset(left, share);
            return;
        }
        let own = self.turn.dot(&self.newest);
        // What is seen seldom is not to be followed at once.
        let share = share * (FEATURES as f64 / own).min(1.0);
        self.weights += self.turn * (share * left);
    }

    /// Takes what was `left` of the residual for a constant by this share; by how much that changes what is usual.
    pub fn offset(&mut self, left: f64, share: f64) -> f64 {
        self.weights[0] += share * left;
        share * left
    }

    /// What of it is there because the twin is late.
    pub fn late(&self) -> f64 {
        self.weights[FEATURES - 1] * self.newest[FEATURES - 1]
    }

    /// How far what is usual may be wrong \[effort unit\].
    pub fn doubt(&self) -> f64 {
        if self.pace.is_none() {
            return 0.0;
        }
        RIGHT_TO * (self.weights.dot(&self.newest) - self.weights[0])
    }

    /// How many times its square the noise is of a sample that is as unlike what was learnt from as this one: what was told of it is itself no
    /// better known (the variance of a prediction, as of any linear regression).
    pub fn strange(&self) -> f64 {
        1.0 + self.turn.dot(&self.newest) / self.worth
    }

    /// How much both efforts have changed of late \[effort unit\]: the twin is late where the arm is driven. What touches an arm changes one
    /// of them alone: the measured effort of one that stays on its path, the expected effort of one that gives way.
    pub fn unrest(&self) -> f64 {
        self.expected.most.min(self.measured.most)
    }
}
