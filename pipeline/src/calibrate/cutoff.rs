//! Choice of the low-pass on a joint's efforts: the highest cutoff at which the peaks of the contact-free residual
//! are hardly larger than at the default cutoff. It delays contacts least.
//!
//! The contact-free residual is the sum of the twin's error, which is slow, and sensor noise, which is fast. If the
//! error dominates, a low cutoff delays contacts and removes almost nothing.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;

/// Ratio of successive candidate cutoffs.
/// Tuned: half an octave; a finer step changes a delay by less than 5 ms.
const STEP: f64 = std::f64::consts::SQRT_2;
/// Number of candidate cutoffs, up to 11 times the default.
const TRIED: usize = 8;
/// Accepted growth factor of the residual's peaks at a higher cutoff. False alarms depend on peaks, not on the RMS.
/// Tuned: of 1.05, 1.1, 1.2, 1.3 on recordings after the three papers; docs/twin.md gives its effect there.
const GROWTH: f64 = 1.1;
/// Upper bound of the cutoff relative to the sample rate, above which the filter has too little effect.
/// Statistical: half the Nyquist frequency.
const SHARE_OF_RATE: f64 = 0.25;
/// Shortest total duration of recordings from which a cutoff is chosen \[s\].
/// Physical: a few movements of an arm.
const LEAST_S: f64 = 5.0;

/// The residual of each joint behind low-passes of several cutoffs.
#[derive(Debug)]
pub(super) struct Cutoffs {
    all: Vec<Behind>,
    joints: usize,
    settling_s: f64,
    previous_ns: Option<i64>,
    since_reset_s: f64,
    count: u64,
    span_s: f64,
}

/// Residual peaks at one cutoff.
#[derive(Debug)]
struct Behind {
    cutoff_hz: f64,
    filters: Vec<Butterworth2>,
    /// Largest residual of the current second, and sum of those of all previous seconds.
    peak: JointArray,
    peaks: JointArray,
}

impl Behind {
    fn end_second(&mut self) {
        for (sum, peak) in self.peaks.iter_mut().zip(&mut self.peak) {
            *sum += std::mem::take(peak);
        }
    }
}

impl Cutoffs {
    /// Creates the candidates; `usual_hz` is the default cutoff and the lowest candidate.
    pub fn new(usual_hz: f64, joints: usize) -> Self {
        let behind = |power: usize| {
            let cutoff_hz = usual_hz * STEP.powi(power as i32);
            Behind {
                cutoff_hz,
                filters: vec![Butterworth2::new(cutoff_hz); joints],
                peak: [0.0; MAX_JOINTS],
                peaks: [0.0; MAX_JOINTS],
            }
        };
        Self {
            all: (0..TRIED).map(behind).collect(),
            joints,
            settling_s: Butterworth2::new(usual_hz).settling_time_s(),
            previous_ns: None,
            since_reset_s: 0.0,
            count: 0,
            span_s: 0.0,
        }
    }

    /// Adds a sample of contact-free motion behind the corrected twin.
    pub fn take(&mut self, sample: &TwinState) {
        let stamp_ns = sample.header.stamp_ns;
        let dt_s = self.previous_ns.map(|ns| (stamp_ns - ns) as f64 * 1e-9);
        self.previous_ns = Some(stamp_ns);
        let dt_s = dt_s.filter(|dt| *dt >= 0.0 && !sample.header.has(flags::RESET));
        let before_s = std::mem::take(&mut self.since_reset_s);
        if let Some(dt) = dt_s {
            self.since_reset_s = before_s + dt;
            if self.since_reset_s.floor() > before_s.floor() {
                self.all.iter_mut().for_each(Behind::end_second);
            }
        } else {
            // The peak of an incomplete second is too small.
            self.all
                .iter_mut()
                .for_each(|all| all.peak = [0.0; MAX_JOINTS]);
        }
        let settled = self.since_reset_s >= self.settling_s;
        for j in 0..self.joints {
            let residual = sample.effort[j] - sample.expected_effort[j];
            for behind in &mut self.all {
                let filter = &mut behind.filters[j];
                let value = if let Some(dt) = dt_s {
                    filter.update(dt, residual)
                } else {
                    filter.reset(residual);
                    residual
                };
                if settled {
                    behind.peak[j] = behind.peak[j].max(value.abs());
                }
            }
        }
        if settled {
            self.count += 1;
            self.span_s += dt_s.unwrap_or(0.0);
        }
    }

    /// Chosen cutoff of each joint \[Hz\]; `None` if the default is the highest acceptable one, or the data are too
    /// short.
    pub fn chosen(&self) -> Vec<Option<f64>> {
        let rate_hz = self.count as f64 / self.span_s.max(f64::MIN_POSITIVE);
        let told = self.span_s >= LEAST_S;
        let fast = |j: usize| {
            let usual = self.all.first()?.peaks[j];
            let may = |behind: &&Behind| {
                behind.cutoff_hz <= SHARE_OF_RATE * rate_hz && behind.peaks[j] <= GROWTH * usual
            };
            let fastest = self.all.iter().skip(1).take_while(may).last()?;
            // Rounded for readability of the file.
            Some((10.0 * fastest.cutoff_hz).round() / 10.0)
        };
        (0..self.joints).map(|j| fast(j).filter(|_| told)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tauscope_bus::Header;

    /// Chosen cutoff at 500 Hz for a twin whose error oscillates at 0.5 Hz, with white noise.
    fn behind(error: f64, noise: f64, seconds: f64) -> Option<f64> {
        let mut cutoffs = Cutoffs::new(4.5, 1);
        let mut seed = 1_u64;
        for i in 0..(500.0 * seconds) as i64 {
            let t = i as f64 * 0.002;
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let white = ((seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * 12_f64.sqrt();
            let mut sample = TwinState {
                header: Header {
                    stamp_ns: i * 2_000_000,
                    flags: flags::READY,
                    joint_count: 1,
                    ..Header::default()
                },
                ..TwinState::default()
            };
            sample.effort[0] = 7.0 + error * (3.0 * t).sin() + noise * white;
            sample.expected_effort[0] = 7.0;
            cutoffs.take(&sample);
        }
        cutoffs.chosen()[0]
    }

    #[test]
    fn the_low_pass_is_fast_where_the_twin_errs_by_more_than_the_sensor() {
        assert_eq!(behind(1.0, 0.1, 20.0), Some(50.9));
    }

    #[test]
    fn it_stays_where_the_sensor_is_noise() {
        assert_eq!(behind(0.0, 1.0, 20.0), None);
    }

    #[test]
    fn a_recording_of_a_moment_tells_none() {
        assert_eq!(behind(1.0, 0.1, 4.0), None);
    }
}
