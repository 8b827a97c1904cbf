//! The estimate of the model error in the absence of collisions (section 3.1): equations 7 and 8 in the
//! steady state, equations 9 to 11 in the unsteady state.

/// Number of samples in the unsteady state's buffer.
/// Resolution: one value every 10 ms, six in a period of the 15 Hz low-pass; changes the computing time.
const BUFFER: usize = 100;
/// Time span of the buffer \[s\].
/// Chosen: much longer than the detection of a collision (40 ms), which would otherwise fill the buffer. A longer
/// span keeps the residues of past motions.
pub(super) const BUFFER_S: f64 = 1.0;

/// The estimate for one joint.
#[derive(Debug, Clone)]
pub(super) struct ModelError {
    period_s: f64,
    delta: f64,
    steady: Option<Steady>,
    unsteady: Unsteady,
    before: Option<f64>,
}

impl ModelError {
    /// Creates the estimate with `period_s` between two updates in the steady state (the paper's `T_s`) and the
    /// weight `delta` of equation 9.
    pub fn new(period_s: f64, delta: f64) -> Self {
        Self {
            period_s,
            delta,
            steady: None,
            unsteady: Unsteady::default(),
            before: None,
        }
    }

    /// Discards all residues.
    pub fn reset(&mut self) {
        self.steady = None;
        self.unsteady = Unsteady::default();
        self.before = None;
    }

    /// Processes the next |R|, `dt_s` seconds after the previous one, and returns the model error.
    pub fn update(&mut self, dt_s: f64, residue: f64, is_steady: bool) -> f64 {
        let before = self.before.replace(residue).unwrap_or(residue);
        if is_steady {
            self.unsteady.left = true;
            let steady = self.steady.get_or_insert_with(|| Steady::new(before));
            steady.update(dt_s, residue, self.period_s)
        } else {
            self.steady = None;
            self.unsteady.update(dt_s, residue, self.delta)
        }
    }
}

/// Equations 7 and 8, from the start of the steady state.
#[derive(Debug, Clone)]
struct Steady {
    /// `err_ss`: the largest |R| so far.
    largest: f64,
    /// Sum of `|R(t_ss)|` and all `err_ss`, and its number of summands.
    sum: f64,
    count: f64,
    since_update_s: f64,
    /// The last sampled error.
    sampled: f64,
}

impl Steady {
    /// `before`: the last |R| before the steady state, `|R(t_ss)|`.
    fn new(before: f64) -> Self {
        Self {
            largest: 0.0,
            sum: before,
            count: 1.0,
            since_update_s: 0.0,
            sampled: before,
        }
    }

    fn update(&mut self, dt_s: f64, residue: f64, period_s: f64) -> f64 {
        self.largest = self.largest.max(residue);
        self.sum += self.largest;
        self.count += 1.0;
        self.since_update_s += dt_s;
        // Half a step of tolerance: the period ends at the nearest sample in spite of rounding in the summed time.
        if self.since_update_s + 0.5 * dt_s > period_s {
            self.since_update_s = 0.0;
            self.sampled = self.sum / self.count;
        }
        self.sampled
    }
}

/// Equations 9 to 11. The buffer persists from one unsteady state to the next; the largest residue is reset.
#[derive(Debug, Clone)]
struct Unsteady {
    /// `err_us`: the largest |R| since this unsteady state began.
    largest: f64,
    /// Whether a steady state has occurred since the last update.
    left: bool,
    /// `err_us` and the square of its deviation from the mean at its time.
    buffer: [(f64, f64); BUFFER],
    filled: usize,
    next: usize,
    /// Sums over the buffer.
    sum: f64,
    squares: f64,
    since_sample_s: f64,
    /// `est_err` of equation 10.
    estimate: f64,
}

impl Default for Unsteady {
    fn default() -> Self {
        Self {
            largest: 0.0,
            left: true,
            buffer: [(0.0, 0.0); BUFFER],
            filled: 0,
            next: 0,
            sum: 0.0,
            squares: 0.0,
            since_sample_s: 0.0,
            estimate: 0.0,
        }
    }
}

impl Unsteady {
    fn update(&mut self, dt_s: f64, residue: f64, delta: f64) -> f64 {
        if std::mem::take(&mut self.left) {
            self.largest = 0.0;
        }
        self.largest = self.largest.max(residue);
        self.since_sample_s += dt_s;
        if self.filled == 0 || self.since_sample_s + 0.5 * dt_s > BUFFER_S / BUFFER as f64 {
            self.since_sample_s = 0.0;
            self.sample();
        }
        // Equation 9.
        delta * self.estimate + (1.0 - delta) * self.largest
    }

    /// Adds `err_us` to the buffer and evaluates equations 11 and 10.
    fn sample(&mut self) {
        let (out, out_square) = self.buffer[self.next];
        self.filled = (self.filled + 1).min(BUFFER);
        let n = self.filled as f64;
        self.sum += self.largest - out;
        let mean = self.sum / n;
        let square = (mean - self.largest).powi(2);
        self.squares += square - out_square;
        self.buffer[self.next] = (self.largest, square);
        self.next = (self.next + 1) % BUFFER;
        if self.next == 0 {
            // Removes the accumulated rounding errors from the running sums.
            self.sum = self.buffer.iter().map(|entry| entry.0).sum();
            self.squares = self.buffer.iter().map(|entry| entry.1).sum();
        }
        self.estimate = self.sum / n + 3.0 * (self.squares.max(0.0) / n).sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: f64, wanted: f64) {
        assert!((value - wanted).abs() < 1e-12, "{value} is not {wanted}");
    }

    #[test]
    fn equation_7_averages_the_largest_residues_and_8_samples_the_average() {
        let mut error = ModelError::new(0.2, 0.5);
        // The last residue before the steady state is 4.
        error.update(0.1, 4.0, false);
        // |R(t_ss)| is held until T_s has passed.
        close(error.update(0.1, 1.0, true), 4.0);
        // After 0.2 s: (4 + 1 + 3) / 3.
        close(error.update(0.1, 3.0, true), 8.0 / 3.0);
        // Held for the next 0.2 s, independent of the residue.
        close(error.update(0.1, 9.0, true), 8.0 / 3.0);
        // (4 + 1 + 3 + 9 + 9) / 5: the largest residue so far is used, not the residue itself.
        close(error.update(0.1, 2.0, true), 26.0 / 5.0);
    }

    #[test]
    fn equations_9_to_11_by_hand() {
        let mut error = ModelError::new(0.2, 0.5);
        // One entry: mean 2, no deviation; m = 0.5 * 2 + 0.5 * 2.
        close(error.update(0.01, 2.0, false), 2.0);
        // err_us 2, 4: mean 3, deviations 0 and (3 - 4)² = 1; est = 3 + 3 sqrt(1/2).
        let estimate = 3.0 + 3.0 * 0.5_f64.sqrt();
        close(error.update(0.01, 4.0, false), 0.5 * estimate + 2.0);
        // A smaller residue leaves err_us at 4: 2, 4, 4, mean 10/3, deviations 0, 1, 4/9.
        let estimate = 10.0 / 3.0 + 3.0 * ((1.0 + 4.0 / 9.0) / 3.0_f64).sqrt();
        close(error.update(0.01, 1.0, false), 0.5 * estimate + 2.0);
    }

    #[test]
    fn delta_weighs_the_average_against_the_maximum() {
        for (delta, wanted) in [(0.0, 5.0), (1.0, 5.0 * 0.5 + 0.5 * 5.0)] {
            let mut error = ModelError::new(0.2, delta);
            error.update(0.01, 5.0, false);
            // Both averages are over fives only: err_us stays at its maximum.
            close(error.update(0.01, 1.0, false), wanted);
        }
    }

    #[test]
    fn a_new_unsteady_state_begins_with_the_buffer_of_the_ones_before() {
        let mut error = ModelError::new(0.2, 0.5);
        for _ in 0..200 {
            error.update(0.01, 2.0, false);
        }
        error.update(0.01, 0.5, true);
        // est stays near 2, err_us is 0.5.
        let m = error.update(0.01, 0.5, false);
        assert!(m > 1.2 && m < 1.6, "{m}");
    }

    #[test]
    fn the_running_sums_do_not_drift() {
        let mut error = ModelError::new(0.2, 1.0);
        let mut m = 0.0;
        for k in 0..200_000 {
            m = error.update(0.01, 1.0 + 1e-3 * f64::from(k % 7), false);
        }
        close(m, 1.006);
    }
}
