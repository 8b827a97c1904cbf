//! Means over windows that end at the newest sample.

use tauscope_bus::{JointArray, MAX_JOINTS};

use super::ring::Ring;
use super::spans::WINDOWS_S;

/// Maximum number of samples of a window.
/// Physical: holds the longest window, 0.2 s, up to 5 kHz; arms are read at 1 kHz and less.
const CAPACITY: usize = 1024;

/// Running means of rows over the first windows.
#[derive(Debug)]
pub(super) struct Sums {
    pub rows: Ring<CAPACITY>,
    /// First row of each window.
    tails: [usize; WINDOWS_S.len()],
    totals: [JointArray; WINDOWS_S.len()],
    /// Means by window and joint.
    pub means: [JointArray; WINDOWS_S.len()],
    windows: usize,
}

impl Sums {
    /// Creates the sums over the first `windows` windows.
    pub fn new(windows: usize) -> Self {
        Self {
            rows: Ring::new(),
            tails: [0; WINDOWS_S.len()],
            totals: [[0.0; MAX_JOINTS]; WINDOWS_S.len()],
            means: [[0.0; MAX_JOINTS]; WINDOWS_S.len()],
            windows,
        }
    }

    pub fn reset(&mut self) {
        self.rows.reset();
        self.tails = [0; WINDOWS_S.len()];
        self.totals = [[0.0; MAX_JOINTS]; WINDOWS_S.len()];
    }

    pub fn is_empty(&self) -> bool {
        self.rows.count() == 0
    }

    pub fn newest_ns(&self) -> i64 {
        self.rows.row(self.rows.count().max(1) - 1).0
    }

    /// Takes the next row, of `n` joints.
    pub fn push(&mut self, now_ns: i64, row: &JointArray, n: usize) {
        self.rows.push(now_ns, row);
        let head = self.rows.count();
        for (w, length_s) in WINDOWS_S.iter().enumerate().take(self.windows) {
            let sums = &mut self.totals[w][..n];
            for (sum, value) in sums.iter_mut().zip(row) {
                *sum += value;
            }
            let begin = now_ns - (length_s * 1e9) as i64;
            while self.tails[w] + 1 < head {
                let (stamp, old) = self.rows.row(self.tails[w]);
                if *stamp > begin && self.rows.is_kept(self.tails[w]) {
                    break;
                }
                for (sum, value) in sums.iter_mut().zip(old) {
                    *sum -= value;
                }
                self.tails[w] += 1;
            }
        }
        // Rounding errors would accumulate: the sums are computed anew once per pass through the buffer.
        if self.rows.is_round() {
            self.sum_anew(n);
        }
        self.divide(n);
    }

    /// Subtracts `by` from all rows.
    pub fn shift(&mut self, by: &JointArray, n: usize) {
        self.rows.shift(by);
        self.sum_anew(n);
        self.divide(n);
    }

    fn divide(&mut self, n: usize) {
        let head = self.rows.count();
        for (w, means) in self.means.iter_mut().enumerate().take(self.windows) {
            let share = ((head - self.tails[w]).max(1) as f64).recip();
            for (mean, sum) in means[..n].iter_mut().zip(&self.totals[w]) {
                *mean = sum * share;
            }
        }
    }

    fn sum_anew(&mut self, n: usize) {
        for (sum, &tail) in self.totals.iter_mut().zip(&self.tails) {
            *sum = [0.0; MAX_JOINTS];
            for k in tail..self.rows.count() {
                let row = &self.rows.row(k).1;
                for j in 0..n {
                    sum[j] += row[j];
                }
            }
        }
    }
}
