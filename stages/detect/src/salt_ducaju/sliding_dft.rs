//! The frequency content of a vector over a sliding window (Salt Ducaju et al., section II-B).
//!
//! Bin k of the discrete Fourier transform of the newest N samples, at k / (N h), is updated by one addition per
//! sample. A value enters with the phase of its place in the cycle of N samples, and leaves N samples later with
//! the same phase. So it is removed exactly, except for the rounding of the sum. In each cycle, the sum of one bin is
//! computed anew, one bin after the other, so that the rounding error does not accumulate. Only magnitudes are used,
//! so the phase of the cycle does not matter.
//!
//! The paper does not state the normalisation. Here it is 2/N: a sine of amplitude A at a bin's frequency
//! gives A.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Number of directions.
const AXES: usize = 3;

/// Reason why a band cannot be monitored.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BandError {
    /// A lower limit below the resolution of the window.
    #[error(
        "a band from {min_hz} Hz needs a window longer than 1/{min_hz} s, and {window} samples at {rate_hz:.1} Hz last {seconds:.3} s: take more samples or a higher lower limit"
    )]
    TooLow {
        /// Lower limit \[Hz\].
        min_hz: f64,
        /// Samples in the window.
        window: usize,
        /// Samples per second.
        rate_hz: f64,
        /// Length of the window \[s\].
        seconds: f64,
    },
    /// An upper limit above half the sample rate.
    #[error(
        "a band up to {max_hz} Hz needs more than {needed} samples a second, and there are {rate_hz:.1}: take a lower upper limit"
    )]
    TooHigh {
        /// Upper limit \[Hz\].
        max_hz: f64,
        /// Twice the upper limit \[Hz\].
        needed: f64,
        /// Samples per second.
        rate_hz: f64,
    },
    /// A sample rate other than that of the tuning.
    #[error(
        "its thresholds were tuned at {tuned_hz:.1} samples a second, and here are {rate_hz:.1}: let `tauscope evaluate` tune it on recordings of this rate"
    )]
    OtherRate {
        /// Samples per second of the tuning recordings.
        tuned_hz: f64,
        /// Samples per second.
        rate_hz: f64,
    },
    /// No bin between the limits.
    #[error(
        "no bin lies between {min_hz} and {max_hz} Hz: {window} samples at {rate_hz:.1} Hz have one every {spacing_hz:.2} Hz; take a wider band or more samples"
    )]
    Empty {
        /// Lower limit \[Hz\].
        min_hz: f64,
        /// Upper limit \[Hz\].
        max_hz: f64,
        /// Samples in the window.
        window: usize,
        /// Samples per second.
        rate_hz: f64,
        /// Distance of the bins \[Hz\].
        spacing_hz: f64,
    },
}

/// Returns the bins, for a window of `window` samples `period_s` apart, whose frequencies are within the band
/// \[Hz\]. The band is limited to 1/(N h) up to 1/(2 h).
///
/// # Errors
/// If the window cannot resolve a limit, or there is no bin within the band.
pub fn bins(
    window: usize,
    period_s: f64,
    [min_hz, max_hz]: [f64; 2],
) -> Result<RangeInclusive<usize>, BandError> {
    // Tolerance for clocks: one part in a thousand.
    let slack = 1.0 + 1e-3;
    let rate_hz = 1.0 / period_s;
    let spacing_hz = rate_hz / window as f64;
    if min_hz * slack < spacing_hz {
        let seconds = window as f64 * period_s;
        return Err(BandError::TooLow {
            min_hz,
            window,
            rate_hz,
            seconds,
        });
    }
    if max_hz > 0.5 * rate_hz * slack {
        let needed = 2.0 * max_hz;
        return Err(BandError::TooHigh {
            max_hz,
            needed,
            rate_hz,
        });
    }
    let first = (min_hz / slack / spacing_hz).ceil() as usize;
    let last = ((max_hz * slack / spacing_hz).floor() as usize).min(window / 2);
    if first > last {
        return Err(BandError::Empty {
            min_hz,
            max_hz,
            window,
            rate_hz,
            spacing_hz,
        });
    }
    Ok(first..=last)
}

/// The transform of a window of vectors over some bins. Nothing is allocated after
/// [`SlidingDft::new`] unless [`SlidingDft::set_bins`] asks for more bins than there were.
#[derive(Debug, Clone)]
pub struct SlidingDft {
    /// The window as a ring; zeros before it has filled.
    ring: Vec<[f64; AXES]>,
    at: usize,
    bins: Vec<Group>,
    count: usize,
    /// Largest squared magnitude of any bin, by direction.
    most: [f64; AXES],
    /// The bin whose sum is computed anew in this cycle, and that sum.
    renewed: usize,
    fresh: [[f64; 2]; AXES],
}

/// Number of bins updated together, so that the compiler can use SIMD instructions.
const LANES: usize = 4;
type Lanes = [f64; LANES];

/// Bins updated together; an unused one stays zero. Complex numbers are stored as real and imaginary parts.
#[derive(Debug, Clone, Copy, Default)]
struct Group {
    /// e^(-2πi k/N), and its power by the place in the cycle.
    turn: [Lanes; 2],
    phase: [Lanes; 2],
    /// Sums by direction.
    sums: [[Lanes; 2]; AXES],
}

/// Evaluates `f` for each lane.
fn lanes(f: impl Fn(usize) -> f64) -> Lanes {
    std::array::from_fn(f)
}

impl Group {
    /// Resets the phase to the start of a cycle.
    fn rewind(&mut self) {
        self.phase = [[1.0; LANES], [0.0; LANES]];
    }

    /// Adds `change` with the current phase, and advances the phase; raises `most` to the squared magnitudes.
    #[inline]
    fn push(&mut self, change: [f64; AXES], most: &mut [Lanes; AXES]) {
        let [phase_re, phase_im] = self.phase;
        for (axis, change) in change.into_iter().enumerate() {
            let [re, im] = &mut self.sums[axis];
            *re = lanes(|k| re[k] + change * phase_re[k]);
            *im = lanes(|k| im[k] + change * phase_im[k]);
            let squared = lanes(|k| re[k] * re[k] + im[k] * im[k]);
            most[axis] = lanes(|k| larger(squared[k], most[axis][k]));
        }
        let [turn_re, turn_im] = self.turn;
        self.phase = [
            lanes(|k| phase_re[k] * turn_re[k] - phase_im[k] * turn_im[k]),
            lanes(|k| phase_re[k] * turn_im[k] + phase_im[k] * turn_re[k]),
        ];
    }
}

/// Returns the larger value, without the special case for NaN, so that it compiles to one instruction.
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl SlidingDft {
    /// Creates an empty window of `window` samples, at least one, without bins.
    pub fn new(window: usize) -> Self {
        Self {
            ring: vec![[0.0; AXES]; window.max(1)],
            at: 0,
            bins: Vec::new(),
            count: 0,
            most: [0.0; AXES],
            renewed: 0,
            fresh: [[0.0; 2]; AXES],
        }
    }

    /// Empties the window and sets the bins.
    pub fn set_bins(&mut self, bins: RangeInclusive<usize>) {
        self.ring.fill([0.0; AXES]);
        self.at = 0;
        self.most = [0.0; AXES];
        self.renewed = 0;
        self.fresh = [[0.0; 2]; AXES];
        let n = self.ring.len() as f64;
        self.count = bins.clone().count();
        self.bins.clear();
        self.bins
            .resize(self.count.div_ceil(LANES), Group::default());
        for (i, k) in bins.enumerate() {
            let (sin, cos) = (TAU * k as f64 / n).sin_cos();
            let group = &mut self.bins[i / LANES];
            let lane = i % LANES;
            (group.turn[0][lane], group.turn[1][lane]) = (cos, -sin);
        }
        self.rewind();
    }

    /// Resets all phases to the start of a cycle.
    fn rewind(&mut self) {
        self.bins.iter_mut().for_each(Group::rewind);
        // The lanes after the last bin stay zero.
        if let Some(last) = self.bins.last_mut() {
            let used = (self.count - 1) % LANES + 1;
            last.phase[0][used..].fill(0.0);
        }
    }

    /// Adds the newest value and removes the oldest.
    pub fn push(&mut self, value: [f64; AXES]) {
        let old = std::mem::replace(&mut self.ring[self.at], value);
        let (group, lane) = (self.renewed / LANES, self.renewed % LANES);
        if let Some(group) = self.bins.get(group) {
            let [re, im] = group.phase.map(|part| part[lane]);
            for (sum, value) in self.fresh.iter_mut().zip(value) {
                sum[0] += value * re;
                sum[1] += value * im;
            }
        }
        let change = std::array::from_fn(|i| value[i] - old[i]);
        let mut most = [[0.0; LANES]; AXES];
        for group in &mut self.bins {
            group.push(change, &mut most);
        }
        self.most = most.map(|lanes| lanes.into_iter().fold(0.0, larger));
        self.at += 1;
        if self.at == self.ring.len() {
            // End of a cycle: every cycle uses the same phases, bit for bit.
            self.at = 0;
            self.rewind();
            let fresh = std::mem::take(&mut self.fresh);
            if let Some(group) = self.bins.get_mut(group) {
                for ([re, im], fresh) in group.sums.iter_mut().zip(fresh) {
                    (re[lane], im[lane]) = (fresh[0], fresh[1]);
                }
                self.renewed = (self.renewed + 1) % self.count;
            }
        }
    }

    /// Returns the largest magnitude of any bin (the L∞-norm over the band) times 2/N, by direction; 0 without bins.
    pub fn norms(&self) -> [f64; AXES] {
        let n = self.ring.len() as f64;
        self.most.map(|squared| squared.sqrt() * 2.0 / n)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn plain(window: &[[f64; AXES]], bins: RangeInclusive<usize>) -> [f64; AXES] {
        let n = window.len() as f64;
        std::array::from_fn(|axis| {
            let lengths = bins.clone().map(|k| {
                let (mut re, mut im) = (0.0, 0.0);
                for (m, value) in window.iter().enumerate() {
                    let (sin, cos) = (TAU * (k * m) as f64 / n).sin_cos();
                    re += value[axis] * cos;
                    im -= value[axis] * sin;
                }
                f64::hypot(re, im) * 2.0 / n
            });
            lengths.fold(0.0, f64::max)
        })
    }

    proptest! {
        #[test]
        fn it_equals_the_plain_transform_of_the_window(
            values in prop::collection::vec(prop::array::uniform3(-50.0..50.0_f64), 40..160),
            window in 8..40_usize,
        ) {
            let bins = 1..=window / 2;
            let mut dft = SlidingDft::new(window);
            dft.set_bins(bins.clone());
            for (i, &value) in values.iter().enumerate() {
                dft.push(value);
                if i + 1 >= window {
                    let wanted = plain(&values[i + 1 - window..=i], bins.clone());
                    for (got, wanted) in dft.norms().into_iter().zip(wanted) {
                        prop_assert!((got - wanted).abs() < 1e-10);
                    }
                }
            }
        }
    }

    #[test]
    fn a_sine_at_a_bin_gives_its_amplitude() {
        let mut dft = SlidingDft::new(500);
        dft.set_bins(5..=50);
        for i in 0..700 {
            let at = TAU * 20.0 * f64::from(i) * 1e-3;
            dft.push([3.0 * at.sin(), 40.0, 0.5 * at.cos()]);
        }
        let norms = dft.norms();
        assert!((norms[0] - 3.0).abs() < 1e-9);
        assert!(norms[1].abs() < 1e-9, "a constant has nothing in the band");
        assert!((norms[2] - 0.5).abs() < 1e-9);
    }

    #[test]
    fn rounding_does_not_add_up() {
        let mut dft = SlidingDft::new(50);
        dft.set_bins(1..=20);
        // Large values that leave only rounding errors behind, then a million zero samples.
        for i in 0..50 {
            dft.push([1e9 * f64::from(i).sin(); AXES]);
        }
        for _ in 0..1_000_000 {
            dft.push([0.0; AXES]);
        }
        assert!(dft.norms().iter().all(|&norm| norm < 1e-12));
    }

    #[test]
    fn a_band_is_held_against_window_and_rate() {
        assert_eq!(bins(500, 1e-3, [10.0, 100.0]), Ok(5..=50));
        assert_eq!(bins(500, 1.01e-3, [10.0, 100.0]), Ok(6..=50));
        assert_eq!(bins(500, 1e-3, [2.0, 500.0]), Ok(1..=250));
        assert!(matches!(
            bins(50, 1e-3, [10.0, 100.0]),
            Err(BandError::TooLow { .. })
        ));
        assert!(matches!(
            bins(500, 1e-2, [10.0, 100.0]),
            Err(BandError::TooHigh { .. })
        ));
        assert!(matches!(
            bins(500, 1e-3, [10.5, 11.5]),
            Err(BandError::Empty { .. })
        ));
    }
}
