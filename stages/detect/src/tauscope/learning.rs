//! How contact-free recordings teach what is usual of a residual.

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

/// A joint's usual highest speed: this share of its samples is slower.
/// Statistical: a quantile that one sample in twenty may exceed, so that no single fast move sets it.
const FAST: f64 = 0.95;
/// Speed below which a joint is not taken to move at all \[rad/s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEAST_FAST_RAD_S: f64 = 0.01;
/// Correlations are believed to this share.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const BELIEVED: f64 = 0.95;
/// The share of contact-free samples that stays below the unit of a window's score.
/// Statistical: what one of a thousand contact-free samples exceeds is the unit of the score.
const USUAL: f64 = 0.999;
/// The least that can be learnt from \[samples\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEAST_SAMPLES: usize = 500;
/// A joint's noise and the joints' correlations count half once they are from so much; until then noise is held to what is usual of
/// all joints (the median), and correlations to none \[s\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const HALF_S: f64 = 2.0;
/// The last window is used where its noise is less than this share of that of the one before it.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const PAYS: f64 = 0.9;
/// No joint's noise is believed below this share of what is usual of all joints.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const LEAST_NOISE: f64 = 0.02;

impl Learnt {
    /// From the contact-free stretches of all recordings. The tail is told from recordings, or pieces of one, that the noise
    /// it is held against was not learnt from: each fold's by the noise of the others.
    ///
    /// # Errors
    /// If they hold too little.
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

    /// What is usual in these pieces, without rate and tail.
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

    /// Tells what of the residual is usual, where enough was seen of it.
    fn tell_usual(&mut self, all: &[Piece<'_>]) {
        if self.free_s.is_some_and(|free_s| free_s < ENOUGH_S) {
            return;
        }
        for (j, joint) in self.joints.iter_mut().enumerate() {
            joint.usual = LearntUsual::new(all, j, joint.fast_rad_s);
        }
    }

    /// Whether the last window averages enough noise away (mean of logarithms) to be worth its delay, and enough was seen to tell.
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

    /// How far what was learnt is believed, of 1.
    fn believed(&self) -> f64 {
        let free_s = self.free_s.unwrap_or(f64::INFINITY);
        if free_s.is_finite() {
            free_s / (free_s + HALF_S)
        } else {
            1.0
        }
    }

    /// Holds the joints' noise to what is usual of all of them, the more the less it was learnt from.
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

    /// Runs over the contact-free samples, and hands the windows out at each; drift is followed where the score is below `drifts`.
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

    /// The largest score of each block of contact-free time.
    fn peaks(&self, all: &[Piece<'_>], follow: Follow) -> Vec<f64> {
        let mut peaks = Peaks::default();
        // As it will run.
        self.each(all, follow, DRIFT, |sample, _, score| {
            peaks.add(sample.header.stamp_ns, score);
        });
        peaks.into_blocks()
    }
}

/// The largest score of each block of contact-free time, by the noise of other recordings, or pieces of one, than the block's own.
fn held_out_peaks(all: &[Piece<'_>], joint_names: &[String], follow: Follow) -> Vec<f64> {
    let mut peaks = Vec::new();
    for fold in 0..FOLDS {
        let part = |held_out: bool| -> Vec<Piece<'_>> {
            let pieces = all.iter();
            let pieces = pieces.filter(|piece| (piece.fold == fold) == held_out);
            pieces.copied().collect()
        };
        let others = match part(false) {
            // A single piece: nothing is left to learn from without it.
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
