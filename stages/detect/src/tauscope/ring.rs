//! Ring buffer of the newest samples.

use tauscope_bus::{JointArray, MAX_JOINTS};

/// Ring buffer of `CAPACITY` rows, each with a stamp and a number by joint. No allocation per sample.
#[derive(Debug)]
pub(crate) struct Ring<const CAPACITY: usize> {
    rows: Vec<(i64, JointArray)>,
    /// Number of rows pushed since the last reset.
    count: usize,
}

impl<const CAPACITY: usize> Ring<CAPACITY> {
    pub fn new() -> Self {
        Self {
            rows: vec![(0, [0.0; MAX_JOINTS]); CAPACITY],
            count: 0,
        }
    }

    pub fn reset(&mut self) {
        self.count = 0;
    }

    /// Returns the number of rows pushed since the last reset.
    pub fn count(&self) -> usize {
        self.count
    }

    pub fn push(&mut self, stamp_ns: i64, row: &JointArray) {
        self.rows[self.count % CAPACITY] = (stamp_ns, *row);
        self.count += 1;
    }

    /// Subtracts `by` from all rows.
    pub fn shift(&mut self, by: &JointArray) {
        for (_, row) in &mut self.rows {
            for (value, by) in row.iter_mut().zip(by) {
                *value -= by;
            }
        }
    }

    /// Returns a row by its number; only rows for which [`Ring::is_kept`] holds are valid.
    pub fn row(&self, number: usize) -> &(i64, JointArray) {
        &self.rows[number % CAPACITY]
    }

    /// Returns whether this row is in the buffer, and still will be after the next push.
    pub fn is_kept(&self, number: usize) -> bool {
        self.count - number < CAPACITY
    }

    /// Returns whether the next row starts another pass through the buffer.
    pub fn is_round(&self) -> bool {
        self.count.is_multiple_of(CAPACITY)
    }

    /// Returns the mean over the samples from one instant to another, or else the sample nearest to them; zeros if
    /// the buffer is empty.
    pub fn mean(&self, from_ns: i64, to_ns: i64) -> JointArray {
        let kept = &self.rows[..self.count.min(CAPACITY)];
        let between = |stamp_ns: &i64| (from_ns..=to_ns).contains(stamp_ns);
        let (mut sum, mut count) = ([0.0; MAX_JOINTS], 0_u32);
        for (_, row) in kept.iter().filter(|(stamp_ns, _)| between(stamp_ns)) {
            count += 1;
            for (sum, value) in sum.iter_mut().zip(row) {
                *sum += value;
            }
        }
        if count > 0 {
            return sum.map(|sum| sum / f64::from(count));
        }
        let off_ns = |stamp_ns: i64| (stamp_ns - stamp_ns.clamp(from_ns, to_ns)).abs();
        let nearest = kept.iter().min_by_key(|(stamp_ns, _)| off_ns(*stamp_ns));
        nearest.map_or([0.0; MAX_JOINTS], |(_, row)| *row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAPACITY: usize = 1024;

    fn filled(count: i64) -> Ring<CAPACITY> {
        let mut ring = Ring::new();
        for k in 0..count {
            ring.push(k, &[k as f64; MAX_JOINTS]);
        }
        ring
    }

    #[test]
    fn the_mean_is_that_of_the_samples_in_between() {
        assert!((filled(100).mean(10, 20)[0] - 15.0).abs() < 1e-12);
        assert!((filled(5000).mean(4990, 4999)[3] - 4994.5).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_longer_kept_is_the_nearest_that_is() {
        let oldest = (5000 - CAPACITY) as f64;
        assert!((filled(5000).mean(0, 10)[0] - oldest).abs() < 1e-12);
        assert!(filled(0).mean(0, 10)[0].abs() < 1e-12);
    }
}
