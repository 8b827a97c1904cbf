//! Learns the baseline and the noise of the residual from contact-free recordings.

use nalgebra::DMatrix;
use tauscope_bus::{TwinState, flags};

use super::late::LateIn;
use super::learnt::{ENOUGH_S, Learnt, LearntJoint, LearntWindow};
use super::pieces::{FOLDS, Piece, free, free_s, marked, pieces, quantile};
use super::spans::Follow;
use super::tail::{Peaks, Tail};
use super::usual::LearntUsual;
use super::windows::Windows;
use super::{DRIFT, NAME, noise, rest};
use crate::frame::{LearnError, Lessons, rate};

/// Quantile of a joint's speed that serves as its reference speed.
/// Statistical: a quantile that one sample in twenty may exceed, so that no single fast move sets it.
const FAST: f64 = 0.95;
/// Lower bound of the reference speed \[rad/s\].
/// Physical: encoder noise makes the speed of a stationary joint about 0.001 rad/s, and programs move joints faster
/// than 0.01 rad/s.
const LEAST_FAST_RAD_S: f64 = 0.01;
/// Shrinkage factor of the correlations between joints.
/// Chosen: keeps the eigenvalues of a correlation matrix above 0.05. A larger factor lets chance correlations inflate
/// the score, a smaller one loses the noise that joints have in common.
const BELIEVED: f64 = 0.95;
/// Quantile of a window's squared length over contact-free samples that is the unit of its score.
/// Statistical: one of a thousand contact-free samples exceeds it.
const USUAL: f64 = 0.999;
/// Minimum number of contact-free samples.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEAST_SAMPLES: usize = 500;
/// Largest ratio of the last window's noise to that of the window before it for the last window to be used.
/// Chosen: the smallest force that is found then falls by a tenth; white noise would give 0.71. A larger ratio
/// prolongs alarms for little gain, a smaller one gives up weak contacts.
const PAYS: f64 = 0.9;
/// Lower bound of a joint's noise, as a share of the median noise of all joints.
/// Physical: noise grows with the rated torque, which differs by less than a factor of ten between the joints of an
/// arm (Franka Panda: 87 and 12 N m).
const LEAST_NOISE: f64 = 0.02;

impl Learnt {
    /// Learns from the contact-free stretches of all recordings. The tail is cross-validated: the score of each fold
    /// uses the noise learnt from the other folds.
    ///
    /// # Errors
    /// If the recordings hold too few contact-free samples.
    pub(crate) fn new(
        lessons: &Lessons<'_>,
        late: &LateIn,
        joint_names: &[String],
        follow: Follow,
    ) -> Result<Self, LearnError> {
        let all = pieces(lessons, late, follow);
        let count: usize = all.iter().map(|piece| free(piece).count()).sum();
        let rate_hz = rate::of(&[lessons.train, lessons.validation]);
        let Some(rate_hz) = rate_hz.filter(|_| count >= LEAST_SAMPLES) else {
            return Err(too_little(count));
        };
        let mut learnt = Self::usual(&all, joint_names, follow);
        learnt.rate_hz = rate_hz;
        learnt.tail = if learnt.free_s.is_some_and(|free_s| free_s < ENOUGH_S) {
            Tail::of_few(&learnt.peaks(&all, follow))
        } else {
            Tail::new(held_out_peaks(&all, joint_names, follow))
        };
        learnt.rest = rest::learn(joint_names.len(), &all, |noise| learnt.hold(noise));
        Ok(learnt)
    }

    /// Learns everything except rate and tail from these pieces.
    fn usual(pieces: &[Piece<'_>], joint_names: &[String], follow: Follow) -> Self {
        let mut learnt = Self {
            rate_hz: 0.0,
            joints: speeds(pieces, joint_names),
            windows: Vec::new(),
            rest: None,
            tail: Tail {
                level: 0.0,
                per_hour: 1.0,
                scale: 1.0,
                shape: 0.0,
            },
            peaks_since: Vec::new(),
            free_s: Some(free_s(pieces)),
            smallest: Vec::new(),
            kinds: None,
            kind_contacts: None,
        };
        learnt.tell_usual(pieces);
        let free_s = learnt.free_s.unwrap_or(0.0);
        learnt.windows = noise::learn(&learnt.joints, pieces, follow, free_s);
        if !learnt.last_pays() {
            learnt.windows.pop();
        }
        learnt.hold_noise();
        learnt.correlate(pieces, follow);
        learnt.measure_usual(pieces, follow);
        learnt
    }

    /// Fits the baselines, if there is enough contact-free time.
    fn tell_usual(&mut self, all: &[Piece<'_>]) {
        if self.free_s.is_some_and(|free_s| free_s < ENOUGH_S) {
            return;
        }
        for (j, joint) in self.joints.iter_mut().enumerate() {
            joint.usual = LearntUsual::new(all, j, joint.fast_rad_s);
        }
    }

    /// Returns whether the last window averages enough noise away (mean of logarithms) to be worth its delay; false
    /// if there is too little contact-free time to decide this.
    fn last_pays(&self) -> bool {
        let [.., before, last] = &self.windows[..] else {
            return false;
        };
        if self.free_s.is_some_and(|free_s| free_s < ENOUGH_S) {
            return false;
        }
        let noise = |window: &LearntWindow| -> f64 {
            let all = window
                .noise
                .iter()
                .flatten()
                .filter(|noise| **noise > noise::SILENT);
            all.clone().map(|noise| noise.ln()).sum::<f64>() / all.count().max(1) as f64
        };
        noise(last) - noise(before) < PAYS.ln()
    }

    /// Returns the weight of the learnt noise and correlations, from 0 to 1.
    fn believed(&self) -> f64 {
        let free_s = self.free_s.unwrap_or(f64::INFINITY);
        if free_s.is_finite() {
            free_s / (free_s + noise::PRIOR_S)
        } else {
            1.0
        }
    }

    /// Shrinks the joints' noise towards the median of all joints, the more the less contact-free time there is.
    fn hold_noise(&mut self) {
        let mut windows = std::mem::take(&mut self.windows);
        for window in &mut windows {
            let mut of_all: Vec<f64> = window.noise.iter().flatten().copied().collect();
            self.hold(&mut of_all);
            for (noise, held) in window.noise.iter_mut().flatten().zip(of_all) {
                *noise = held;
            }
        }
        self.windows = windows;
    }

    fn hold(&self, noise: &mut [f64]) {
        let believed = self.believed();
        let heard = noise.iter().copied().filter(|noise| *noise > noise::SILENT);
        let mut heard: Vec<f64> = heard.collect();
        if heard.is_empty() {
            return;
        }
        let usual = quantile(&mut heard, 0.5);
        for noise in noise {
            let least = noise.max(LEAST_NOISE * usual);
            *noise = least.powf(believed) * usual.powf(1.0 - believed);
        }
    }

    /// Calls `visit` at each contact-free sample with the windows and the score. Drift is followed where the score is
    /// below `drifts`.
    pub(super) fn each(
        &self,
        all: &[Piece<'_>],
        follow: Follow,
        drifts: f64,
        mut visit: impl FnMut(&TwinState, &Windows, f64),
    ) {
        for piece in all {
            let mut windows = Windows::new(self, follow);
            for (sample, late, is_free) in marked(piece) {
                if sample.header.has(flags::RESET) {
                    windows.reset();
                }
                let score = windows.score(sample, late, is_free.then_some(drifts));
                if is_free && windows.ready() {
                    visit(sample, &windows, score);
                }
            }
        }
    }

    fn correlate(&mut self, all: &[Piece<'_>], follow: Follow) {
        let n = self.joints.len();
        let believed = BELIEVED * self.believed();
        let mut products = vec![DMatrix::<f64>::zeros(n, n); self.windows.len()];
        self.each(all, follow, f64::INFINITY, |_, windows, _| {
            for (w, product) in products.iter_mut().enumerate() {
                let z: Vec<f64> = (0..n)
                    .map(|j| windows.mean(w, j) / windows.noise(w, j))
                    .collect();
                for a in 0..n {
                    for b in 0..n {
                        product[(a, b)] += z[a] * z[b];
                    }
                }
            }
        });
        for (window, product) in self.windows.iter_mut().zip(&products) {
            let correlation = DMatrix::from_fn(n, n, |a, b| {
                let scale = (product[(a, a)] * product[(b, b)]).sqrt();
                if a == b || scale <= 0.0 {
                    f64::from(u8::from(a == b))
                } else {
                    believed * product[(a, b)] / scale
                }
            });
            if let Some(inverse) = correlation.try_inverse() {
                window.inverse_correlation = inverse.as_slice().to_vec();
            }
        }
    }

    fn measure_usual(&mut self, all: &[Piece<'_>], follow: Follow) {
        let mut lengths = vec![Vec::new(); self.windows.len()];
        self.each(all, follow, f64::INFINITY, |_, windows, _| {
            for (w, lengths) in lengths.iter_mut().enumerate() {
                lengths.push(windows.length(w));
            }
        });
        for (window, mut lengths) in self.windows.iter_mut().zip(lengths) {
            window.usual = quantile(&mut lengths, USUAL).max(1e-9);
        }
    }

    /// Returns the largest score of each block of contact-free time.
    fn peaks(&self, all: &[Piece<'_>], follow: Follow) -> Vec<f64> {
        let mut peaks = Peaks::default();
        // Drift is followed as in operation.
        self.each(all, follow, DRIFT, |sample, _, score| {
            peaks.add(sample.header.stamp_ns, score);
        });
        peaks.into_blocks()
    }
}

/// Returns the largest score of each block of contact-free time, using the noise learnt from the other folds.
fn held_out_peaks(all: &[Piece<'_>], joint_names: &[String], follow: Follow) -> Vec<f64> {
    let mut peaks = Vec::new();
    for fold in 0..FOLDS {
        let part = |held_out: bool| -> Vec<Piece<'_>> {
            let pieces = all.iter();
            let pieces = pieces.filter(|piece| (piece.fold == fold) == held_out);
            pieces.copied().collect()
        };
        let others = match part(false) {
            // All pieces are in this fold: there is no other data to learn from.
            none if none.is_empty() => all.to_vec(),
            others => others,
        };
        peaks.extend(Learnt::usual(&others, joint_names, follow).peaks(&part(true), follow));
    }
    peaks
}

fn too_little(found: usize) -> LearnError {
    LearnError::TooLittle {
        detector: NAME,
        wanted: format!("{LEAST_SAMPLES} contact-free samples"),
        found: found.to_string(),
    }
}

fn speeds(all: &[Piece<'_>], joint_names: &[String]) -> Vec<LearntJoint> {
    (joint_names.iter().enumerate())
        .map(|(j, name)| {
            let samples = all.iter().flat_map(|piece| piece.samples);
            let mut speeds: Vec<f64> = samples.map(|sample| sample.velocity[j].abs()).collect();
            LearntJoint {
                name: name.clone(),
                fast_rad_s: quantile(&mut speeds, FAST).max(LEAST_FAST_RAD_S),
                usual: None,
            }
        })
        .collect()
}
