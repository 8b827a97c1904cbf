//! Learning: the reference and the baseline gains, first from a segment of motion, then updated with each block.

use super::super::blocks::{BLOCK_ROWS, BLOCK_S, Ring};
use super::super::moments::{Moments, Reference};
use super::super::scale::Scale;
use super::super::usual::BEYOND;
use super::{LEAST_SHARE, Monitor, News, Phase};

/// Time constant of the reference \[s of motion\].
/// Chosen: several cycles of a robot program, and an eighth of the 20 min in which an arm warms up, so that the
/// reference follows.
const MEMORY_S: f64 = 150.0;
/// Ratio of a block's energy to the median above which the block is an outlier, excluded from learning.
/// Tuned: by hand, on no recorded seeds; not swept.
const OUTLIER: f64 = 25.0;
/// Minimum number of blocks for the median.
/// Statistical: three outliers among eight blocks do not move the median beyond the others.
const LEAST_BLOCKS: usize = 8;
/// Minimum share of a window's rows in which a joint moves, for the window to be used for this joint.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_MOVING: f64 = 0.3;

impl Monitor {
    /// Learns the reference once there are enough blocks.
    pub(super) fn learn(&mut self) -> Option<News> {
        if self.ring.len() < self.learn {
            return None;
        }
        let Phase::Learning { told } = self.phase else {
            return None;
        };
        self.aside.copy_from_slice(&self.references);
        self.fit();
        self.leave_out_outliers();
        self.fit();
        self.learn_scales();
        self.ring.keep(0);
        self.run = None;
        self.watched = 0;
        self.phase = Phase::Watching;
        told.then_some(News::Learned)
    }

    /// Fits the references to the blocks in the ring, and to the earlier references in `aside` with at most the same
    /// weight.
    fn fit(&mut self) {
        for j in 0..self.references.len() {
            let mut moments = Moments::ZERO;
            for back in 0..self.ring.len() {
                let block = self.ring.back(back);
                if !block.excluded {
                    moments.add(&block.joints[j].own, 1.0);
                    self.known[j].take(&block.joints[j].ranges);
                }
            }
            let mut before = self.aside[j].moments;
            before.scale((moments.rows / before.rows.max(1.0)).min(1.0));
            moments.add(&before, 1.0);
            self.references[j] = Reference::of(moments);
        }
    }

    /// Excludes blocks with far more energy than the median.
    fn leave_out_outliers(&mut self) {
        for j in 0..self.references.len() {
            self.energies.clear();
            let reference = self.references[j];
            let energy = |ring: &Ring, back: usize| {
                let own = &ring.back(back).joints[j].own;
                (own.rows >= 1.0).then(|| reference.energy_per_row(own))
            };
            for back in 0..self.ring.len() {
                self.energies.extend(energy(&self.ring, back));
            }
            if self.energies.len() < LEAST_BLOCKS {
                continue;
            }
            self.energies.sort_unstable_by(f64::total_cmp);
            let median = self.energies[self.energies.len() / 2];
            let floor = LEAST_SHARE * LEAST_SHARE * reference.effort_square();
            for back in 0..self.ring.len() {
                if energy(&self.ring, back).is_some_and(|e| e > OUTLIER * median.max(floor)) {
                    self.ring.back_mut(back).excluded = true;
                }
            }
        }
    }

    /// Learns the baseline gains, each from a window and a reference without that window.
    fn learn_scales(&mut self) {
        self.settle();
        for blocks in [1, Scale::SHORT, Scale::LONG] {
            self.leave_out(blocks, true);
        }
        self.settle();
        // The payload's gain is in units of the noise, which the joints' gains determine.
        for blocks in [Scale::SHORT, Scale::LONG] {
            self.leave_out(blocks, false);
        }
    }

    /// Leaves each window of this length out of the reference in turn, and learns from it: the baseline gains of the
    /// joints' own changes if `joints`, else that of a payload.
    fn leave_out(&mut self, blocks: usize, joints: bool) {
        for newest in 0..(self.ring.len() + 1).saturating_sub(blocks) {
            self.window.clear();
            for back in newest..newest + blocks {
                let block = self.ring.back(back);
                if !block.excluded {
                    self.window.add(block);
                }
            }
            if self.window.blocks < blocks {
                continue;
            }
            for (j, aside) in self.aside.iter_mut().enumerate() {
                let mut moments = self.references[j].moments;
                moments.add(&self.window.own[j], -1.0);
                *aside = Reference::of(moments);
            }
            if blocks > 1 {
                self.learn_window(blocks, joints, !joints);
                continue;
            }
            for (j, loudness) in self.loudness.iter_mut().enumerate() {
                if self.window.own[j].rows >= 1.0 {
                    loudness.take(self.aside[j].energy_per_row(&self.window.own[j]));
                }
            }
        }
    }

    /// Learns the baseline gains from the oldest blocks, and adds the oldest block to the reference.
    pub(super) fn learn_oldest(&mut self) {
        let oldest = self.ring.len() - 1;
        for blocks in [Scale::SHORT, Scale::LONG] {
            self.window.clear();
            for back in oldest + 1 - blocks..=oldest {
                let block = self.ring.back(back);
                if block.excluded {
                    self.window.clear();
                    break;
                }
                self.window.add(block);
            }
            if self.window.blocks == blocks {
                self.aside.copy_from_slice(&self.references);
                self.learn_window(blocks, true, true);
            }
        }
        let block = self.ring.back(oldest);
        if block.excluded {
            return;
        }
        for (j, joint) in block.joints.iter().enumerate() {
            if joint.own.rows < 1.0 {
                continue;
            }
            if !joint.novel {
                let energy = self.references[j].energy_per_row(&joint.own);
                self.loudness[j].take(energy);
            }
            let moved_s = joint.own.rows / f64::from(BLOCK_ROWS) * BLOCK_S;
            let mut moments = self.references[j].moments;
            moments.scale((-moved_s / MEMORY_S).exp());
            moments.add(&joint.own, 1.0);
            self.references[j] = Reference::of(moments);
            self.known[j].take(&joint.ranges);
        }
        self.settle();
    }

    /// Learns the baseline gains from the window, compared with the references in `aside`.
    fn learn_window(&mut self, blocks: usize, joints: bool, payload: bool) {
        let body = self
            .window
            .scores(&self.aside, &self.noise, &mut self.scores);
        for (j, score) in self.scores.iter().enumerate() {
            let moves =
                self.window.own[j].rows >= LEAST_MOVING * blocks as f64 * f64::from(BLOCK_ROWS);
            if let Some(score) = score.filter(|_| joints && moves) {
                for (scale, gain) in self.scales[j].iter_mut().zip(score.gain) {
                    scale.take(blocks, gain);
                }
            }
        }
        if payload && let Some((change, gain)) = body.solve() {
            self.payload.take(blocks, gain / change.len() as f64);
        }
    }

    /// Derives floors and noise from references and baseline gains.
    pub(super) fn settle(&mut self) {
        for j in 0..self.references.len() {
            let rows = Scale::LONG as f64 * f64::from(BLOCK_ROWS);
            let least = LEAST_SHARE * LEAST_SHARE * self.references[j].effort_square();
            // With this floor, the gain of a deviation of `LEAST_SHARE` in a long window just reaches the threshold.
            self.floors[j] = least * rows / BEYOND;
            let usual = self.scales[j].iter().filter_map(Scale::usual);
            let (count, sum) = usual.fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + value));
            self.noise[j] = (count > 0.0).then(|| (sum / count).max(self.floors[j]));
        }
    }
}
