//! Noise of a joint's residual without contacts, by speed class and by unrest (the recent change that both efforts
//! have in common).

use nalgebra::DMatrix;
use tauscope_bus::{TwinState, flags};

use super::learnt::{BINS, ENOUGH_S, LearntJoint, LearntWindow, bin};
use super::means::Means;
use super::pieces::{Piece, free, marked};
use super::spans::{Follow, WINDOWS_S};

/// Weight of the more general value in an estimate, as duration of observation \[s\]: the joint's noise for that of a
/// speed class, the median of all joints for that of a joint, and zero for the correlation of two joints.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
pub(super) const PRIOR_S: f64 = 2.0;
/// Lower bound of the mean square without unrest, as a share of the mean square.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const QUIET: f64 = 0.25;

/// Lower bound of a joint's noise \[effort unit\]. It applies to a joint whose effort is not measured, so that its
/// residual is always 0.
/// Physical: far below what any sensor of torque or current resolves.
pub(super) const SILENT: f64 = 1e-9;

/// Sums of squared mean residuals, of squared unrest, and of their products.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    count: f64,
    square: f64,
    unrest: f64,
    both: f64,
    unrest_twice: f64,
}

impl Seen {
    fn add(&mut self, square: f64, unrest: f64) {
        self.count += 1.0;
        self.square += square;
        self.unrest += unrest;
        self.both += square * unrest;
        self.unrest_twice += unrest * unrest;
    }

    fn and(mut self, other: &Self) -> Self {
        self.count += other.count;
        self.square += other.square;
        self.unrest += other.unrest;
        self.both += other.both;
        self.unrest_twice += other.unrest_twice;
        self
    }

    /// Returns the share of the squared unrest that adds to the mean square, by least squares.
    fn unrest_adds(&self) -> f64 {
        let with = self.both - self.square * self.unrest / self.count.max(1.0);
        let alone = self.unrest_twice - self.unrest * self.unrest / self.count.max(1.0);
        let found = with / alone.max(f64::MIN_POSITIVE);
        let most = (1.0 - QUIET) * self.square / self.unrest.max(f64::MIN_POSITIVE);
        found.clamp(0.0, most)
    }

    /// Returns the mean square without the contribution of unrest.
    fn quiet(&self, adds: f64) -> f64 {
        (self.square - adds * self.unrest).max(QUIET * self.square) / self.count.max(1.0)
    }
}

impl LearntWindow {
    /// Estimates the noise from what was `seen` of each joint by speed class. The overall noise of a joint has the
    /// weight of `prior` samples. Unrest contributes only if there was `enough` data.
    fn of(joints: &[[Seen; BINS]], prior: f64, enough: bool) -> Self {
        let n = joints.len();
        let (mut noise, mut unquiet) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for bins in joints {
            let all = bins.iter().fold(Seen::default(), Seen::and);
            let adds = if enough { all.unrest_adds() } else { 0.0 };
            let overall = all.quiet(adds);
            let of = |seen: &Seen| {
                let square = seen.quiet(adds) * seen.count + prior * overall;
                (square / (seen.count + prior)).sqrt().max(SILENT)
            };
            noise.push(bins.iter().map(of).collect());
            unquiet.push(adds.sqrt());
        }
        Self {
            noise,
            unquiet,
            inverse_correlation: DMatrix::identity(n, n).as_slice().to_vec(),
            usual: 1.0,
        }
    }
}

/// Learns the root mean square of the means by window, joint and speed class, and the contribution of unrest, from
/// `free_s` of contact-free time.
pub(super) fn learn(
    joints: &[LearntJoint],
    all: &[Piece<'_>],
    follow: Follow,
    free_s: f64,
) -> Vec<LearntWindow> {
    let mut seen = vec![vec![[Seen::default(); BINS]; joints.len()]; WINDOWS_S.len()];
    for piece in all {
        let mut means = Means::new(joints, follow, WINDOWS_S.len());
        for (sample, late, is_free) in marked(piece) {
            restart(&mut means, sample);
            means.push(sample, late);
            if is_free {
                means.follow();
            }
            if !(is_free && means.ready()) {
                continue;
            }
            for (w, seen) in seen.iter_mut().enumerate() {
                for (j, (seen, joint)) in seen.iter_mut().zip(joints).enumerate() {
                    let square = means.mean(w, j).powi(2) + means.doubt(j).powi(2);
                    // After a clock is set back within a piece, the means can be NaN or infinite.
                    if !square.is_finite() {
                        continue;
                    }
                    seen[bin(joint, means.slow[j])].add(square, means.unrest(j).powi(2));
                }
            }
        }
    }
    let samples: f64 = all.iter().map(|piece| free(piece).count() as f64).sum();
    let prior = PRIOR_S * samples / free_s.max(PRIOR_S);
    let windows = seen.iter();
    windows
        .map(|joints| LearntWindow::of(joints, prior, free_s >= ENOUGH_S))
        .collect()
}

fn restart(means: &mut Means, sample: &TwinState) {
    if sample.header.has(flags::RESET) {
        means.reset();
    }
}
