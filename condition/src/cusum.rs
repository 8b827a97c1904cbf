//! Cumulative sums: E. S. Page, "Continuous Inspection Schemes", Biometrika 41(1/2), 1954, section 4.

/// Mean false alarm rate of a series without a change \[1/night\].
///
/// Statistical: with 31 series per cell (six joints with five quantities, and a payload), a hundred cells and a year,
/// this is about 0.1 false alarm: one in ten years of a hundred cells.
pub const FALSE_ALARMS_A_NIGHT: f64 = 1e-7;
/// Deviation that a night must exceed to add to the sum \[standard deviations\].
/// Statistical: half of the smallest lasting change to be detected, which is 1 (Page's k).
const ALLOWANCE: f64 = 0.5;
/// Bound to which the deviation of a night is clipped \[standard deviations\].
/// Tuned: on simulated years with seeds 101 to 110, `cargo test -p tauscope-condition --test year`: with 6, a single
/// outlier after a few chance deviations was a change in two of 1,000 cell years. Five nights far off are a change,
/// four are none.
const MOST: f64 = 4.0;

/// Cumulative sums of deviations, upwards and downwards.
#[derive(Debug, Clone)]
pub struct Cusum {
    limit: f64,
    sums: [f64; 2],
    /// First night after each sum was last zero.
    begins: [Option<usize>; 2],
}

impl Default for Cusum {
    fn default() -> Self {
        // The two sides share the false alarm rate.
        Self {
            limit: decision_interval(0.5 * FALSE_ALARMS_A_NIGHT),
            sums: [0.0; 2],
            begins: [None; 2],
        }
    }
}

impl Cusum {
    /// Adds the standardised deviation of a night, which is standard normal without a change; `night` is its number.
    /// Returns the night in which the change began, if it is detected now.
    pub fn take(&mut self, deviation: f64, night: usize) -> Option<usize> {
        let deviation = deviation.clamp(-MOST, MOST);
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            self.sums[side] = (self.sums[side] + sign * deviation - ALLOWANCE).max(0.0);
            if self.sums[side] > 0.0 {
                self.begins[side].get_or_insert(night);
            } else {
                self.begins[side] = None;
            }
        }
        let side = usize::from(self.sums[1] > self.sums[0]);
        self.begins[side].filter(|_| self.sums[side] > self.limit)
    }
}

/// Limit of a one-sided sum for this false alarm rate of a normal variable: D. Siegmund, *Sequential Analysis*, 1985,
/// equation 2.57.
pub fn decision_interval(rate: f64) -> f64 {
    let run_length = |limit: f64| {
        let b = limit + 1.166;
        let twice = 2.0 * ALLOWANCE;
        ((twice * b).exp() - twice * b - 1.0) / (0.5 * twice * twice)
    };
    let (mut low, mut high) = (0.0, 200.0);
    for _ in 0..100 {
        let middle = f64::midpoint(low, high);
        if run_length(middle) * rate < 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn siegmund_limits_are_those_of_the_tables() {
        // Montgomery, Introduction to Statistical Quality Control, table 9.3: k = 0.5, h = 4 and 5, two-sided 168 and
        // 465.
        assert!((decision_interval(0.5 / 168.0) - 4.0).abs() < 0.05);
        assert!((decision_interval(0.5 / 465.0) - 5.0).abs() < 0.05);
    }

    #[test]
    fn four_wild_nights_are_no_change_and_five_are() {
        let mut sums = Cusum::default();
        for night in 0..4 {
            assert_eq!(sums.take(50.0, night), None);
        }
        assert_eq!(sums.take(50.0, 4), Some(0));
    }
}
