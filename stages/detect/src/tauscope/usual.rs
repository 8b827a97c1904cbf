//! Baseline of a joint's residual: the friction that the twin leaves out, and the lag of the twin.
//!
//! A twin that has only gains and offsets does not model friction, which makes up most of the contact-free residual
//! of a moving arm. It also knows the motion only through a low-pass, so the expected effort lags where it changes.
//! The baseline models both as linear in features of the joint's velocity and of the expected effort. It is used only
//! if it predicts recordings that it was not fitted to. It adapts while the arm warms up: each sample corrects the
//! weights by a least-mean-squares step in decorrelated features (Sayed, "Fundamentals of Adaptive Filtering", 2003,
//! section 4.4).
//!
//! *Unrest* is the recent change that the measured and the expected effort of a joint have in common.

use nalgebra::{SMatrix, SVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pieces::{FOLDS, Piece, marked, quantile};
use super::spans::{SHORTEST, WINDOWS_S};

/// Number of features: a constant, viscous friction, two Coulomb terms ([`SETS_IN`]), and the recent change of the
/// expected effort.
pub(super) const FEATURES: usize = 5;
/// Transition widths of the smoothed Coulomb friction, as shares of the joint's reference speed.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const SETS_IN: [f64; 2] = [0.1, 0.02];
/// Time constant of the low-pass against which the change of an effort is measured \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LATE_S: f64 = 0.04;
/// Strength of the zero-mean prior on the weights, as duration of observation \[s\].
/// Chosen: in the shortest time that is fitted, 20 s, it shrinks the weight of a feature of unit mean square by a
/// twentieth. A weaker prior gives arbitrary weights to rarely excited features, a stronger one underestimates
/// friction.
const PRIOR_S: f64 = 1.0;
/// Largest fraction of the squared residual on held-out recordings with which the baseline is still used.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const PAYS: f64 = 0.6;
/// Relative uncertainty assigned to the baseline without its constant.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const RIGHT_TO: f64 = 0.1;
/// Time constant with which the measured effort is smoothed before its changes are measured \[s\].
/// Derived: a low-pass reduces the variance of white noise in proportion to 1 / (2 τ), the mean over a window W to
/// 1 / W. These are equal for the shortest window if τ = W / 2.
const SMOOTH_S: f64 = 0.5 * WINDOWS_S[SHORTEST];
/// Time constant with which the largest recent change of an effort decays \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CALMS_S: f64 = 0.1;
/// Quantile of the change of the expected effort that serves as its reference.
/// Statistical: a quantile that one sample in twenty may exceed.
const LIVELY: f64 = 0.95;
/// Correlation time of the residual after the baseline is subtracted \[s\]; samples closer than this are not
/// independent.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const CORRELATED_S: f64 = 0.5;
/// Upper bound of the time step of a sample \[s\].
/// Chosen: five periods at 100 Hz. A smaller bound cuts regular steps, a larger one gives the sample after a gap the
/// weight of the gap.
const MOST_STEP_S: f64 = 0.05;

type Features = SVector<f64, FEATURES>;
/// Products of the features and the residual with each other, summed over time.
type Products = SMatrix<f64, { FEATURES + 1 }, { FEATURES + 1 }>;
/// Weights of all features except the constant.
type Weights = SVector<f64, { FEATURES - 1 }>;

/// Baseline of a joint's residual.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntUsual {
    /// Reference change of the expected effort: the 95 % quantile of its change within 40 ms \[effort unit\].
    pub lively: f64,
    /// Weights of the features 1, v, v / √(v² + 0.1²), v / √(v² + 0.02²) and u \[effort unit\]: v is the velocity
    /// divided by the reference speed, u the change of the expected effort divided by `lively`.
    pub weights: [f64; FEATURES],
    /// Inverse of the matrix of the features' mean products, row by row. It sets how fast the weights adapt, and how
    /// uncertain they are.
    pub inverse_products: Vec<f64>,
    /// Contact-free time from which the weights were fitted \[s\].
    pub from_s: f64,
}

/// [`Products`] of a joint over stretches of recordings, by cross-validation fold.
type Shown = [Products; FOLDS];

/// Returns the products about the means of each stretch (a residual that drifts between stretches is not friction),
/// and about zero. Calls `visit` with the absolute change of the expected effort at each contact-free sample.
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
        // Feature 0 is 1, so row 0 holds the integrals and its first element the duration T. The products about the
        // means are Σ x yᵀ Δt - (Σ x Δt) (Σ y Δt)ᵀ / T.
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
    // Ridge regression: (XᵀX + λ I) w = Xᵀr.
    let held = products + SMatrix::identity() * PRIOR_S;
    let inverse = held.try_inverse();
    inverse.map_or_else(Weights::zeros, |inverse| inverse * with_residual)
}

/// Returns the squared residual that remains with these weights, summed over time.
fn left(centred: &Products, weights: &Weights) -> f64 {
    let all = SVector::<f64, { FEATURES + 1 }>::from_fn(|i, _| match i {
        0 => 0.0,
        FEATURES => -1.0,
        _ => weights[i - 1],
    });
    all.dot(&(centred * all))
}

impl LearntUsual {
    /// Fits the contact-free stretches of recordings; `None` if the fit does not predict the held-out folds. `fast`
    /// is the joint's reference speed \[rad/s\].
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

    /// Takes over these weights except the constant, which remains that of the contact-free recordings: the offset of
    /// the residual differs after each start.
    pub(super) fn go_on(&mut self, weights: [f64; FEATURES]) {
        self.weights[1..].copy_from_slice(&weights[1..]);
    }

    /// Returns whether all values are present and in range.
    pub(super) fn is_whole(&self) -> bool {
        let products = self.inverse_products.len() == FEATURES * FEATURES;
        products && self.lively > 0.0 && self.from_s > 0.0
    }
}

/// Filter coefficients of one time step. They are cached, because sample clocks are often uniform.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    dt_s: f64,
    /// Gains of the low-passes for following and for smoothing an effort, and decay of the largest recent change.
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

    /// Returns whether the step has exactly this length.
    pub fn lasts(&self, dt_s: f64) -> bool {
        self.dt_s.to_bits() == dt_s.to_bits()
    }
}

/// Baseline of a joint's residual at the newest sample.
#[derive(Debug, Clone)]
pub(super) struct Usual {
    fast: f64,
    lively: f64,
    constant: f64,
    weights: Features,
    /// Adaptation gain of the weights; `None` if only the constant adapts.
    pace: Option<SMatrix<f64, FEATURES, FEATURES>>,
    /// Newest features, and the direction in which they change the weights.
    newest: Features,
    turn: Features,
    /// Number of independent samples from which the weights were fitted.
    worth: f64,
    expected: Changes,
    measured: Changes,
    /// Smoothed measured effort.
    smooth: f64,
}

/// Recent changes of an effort.
#[derive(Debug, Clone, Default)]
struct Changes {
    /// Low-passed effort.
    late: Option<f64>,
    /// Present deviation from it, and the largest recent deviation, which decays.
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
    /// Creates the baseline of a joint with this reference speed \[rad/s\].
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

    /// Returns the present weights of the features.
    pub fn weights(&self) -> [f64; FEATURES] {
        self.weights.into()
    }

    /// Prepares for another recording: resets the offset, which is unknown again, and keeps the friction.
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

    /// Takes the velocity and the measured and expected effort of the next sample, and returns its baseline.
    pub fn next(&mut self, step: &Step, velocity: f64, efforts: [f64; 2]) -> f64 {
        self.step(step, efforts);
        let Some(pace) = &self.pace else {
            return self.weights[0];
        };
        self.newest = self.features(velocity);
        self.turn = pace * self.newest;
        self.weights.dot(&self.newest)
    }

    /// Adapts the weights by this share to what was `left` of the residual.
    pub fn follow(&mut self, left: f64, share: f64) {
        if self.pace.is_none() {
            self.offset(left, share);
            return;
        }
        let own = self.turn.dot(&self.newest);
        // Rare features have a large adaptation gain, so their step is limited.
        let share = share * (FEATURES as f64 / own).min(1.0);
        self.weights += self.turn * (share * left);
    }

    /// Adapts the constant by this share to what was `left` of the residual, and returns the change of the baseline.
    pub fn offset(&mut self, left: f64, share: f64) -> f64 {
        self.weights[0] += share * left;
        share * left
    }

    /// Returns the part of the baseline that the lag of the twin causes.
    pub fn late(&self) -> f64 {
        self.weights[FEATURES - 1] * self.newest[FEATURES - 1]
    }

    /// Returns the uncertainty of the baseline \[effort unit\].
    pub fn doubt(&self) -> f64 {
        if self.pace.is_none() {
            return 0.0;
        }
        RIGHT_TO * (self.weights.dot(&self.newest) - self.weights[0])
    }

    /// Returns the factor on the noise variance. It grows with the distance of the features from the training
    /// samples, because the baseline is less certain there (the variance of a prediction, as of any linear
    /// regression).
    pub fn strange(&self) -> f64 {
        1.0 + self.turn.dot(&self.newest) / self.worth
    }

    /// Returns the unrest \[effort unit\]. The twin lags where the arm is driven, which changes both efforts. A
    /// contact changes only one of them: the measured effort if the arm stays on its path, the expected effort if it
    /// yields.
    pub fn unrest(&self) -> f64 {
        self.expected.most.min(self.measured.most)
    }
}
