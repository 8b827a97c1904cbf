//! Values that cannot be measurements: detected from the range of the joint's own values and the limits of the robot
//! file.

use crate::finding::Times;

/// Effort that no drive exceeds, as a multiple of the limit in the robot file.
/// Physical: a drive's peak torque is two to three times its rated one, and some files give the rated one.
const TIMES_LIMIT: f64 = 10.0;
/// Magnitude that is not a measurement, as a multiple of the baseline: the largest 90 % quantile of all joints.
/// Physical: an arm that mostly rests in a balanced pose has about a hundredth of the effort of its motion.
const TIMES_USUAL: f64 = 1000.0;
/// Quantile of the magnitudes that serves as the baseline.
/// Statistical: garbage in less than a tenth of the messages does not move it.
const QUANTILE: f64 = 0.9;
/// Smallest number of values for a range.
/// Resolution: a second at 100 Hz.
const LEAST_VALUES: u64 = 100;
/// Step to zero that is a dropout, as a multiple of the 95 % quantile of the joint's steps.
/// Statistical: normally distributed steps reach eight standard deviations in one of 10^15 samples.
const TIMES_STEP: f64 = 4.0;
/// Quantile of the steps that serves as the baseline. A quantised effort often does not change, so the median may be
/// zero.
const STEP_QUANTILE: f64 = 0.95;
/// Share of zero efforts above which a joint has no dropouts, because zero is one of its values.
/// Physical: a coarse quantisation rounds small efforts to zero.
const MOST_ZEROS: f64 = 0.1;

/// Histogram of nonzero magnitudes by their binary exponent: of bounded size for values of any size. Zeros are
/// counted separately, so that a joint that mostly rests has a range, too.
#[derive(Debug, Clone)]
struct Magnitudes {
    /// Counts of `[2^(i - OFFSET), 2^(i + 1 - OFFSET))`.
    counts: [u32; Self::BINS],
    total: u64,
    zeros: u64,
}

impl Default for Magnitudes {
    fn default() -> Self {
        Self {
            counts: [0; Self::BINS],
            total: 0,
            zeros: 0,
        }
    }
}

impl Magnitudes {
    /// Number of bins: exponents from 2^-40 to 2^40, beyond the range of any unit of effort, position or time.
    const BINS: usize = 80;
    const OFFSET: i32 = 40;

    fn add(&mut self, value: f64) {
        self.total += 1;
        if value == 0.0 {
            self.zeros += 1;
            return;
        }
        // The exponent of the floating-point format is the floor of the binary logarithm.
        let bits = value.abs().max(f64::MIN_POSITIVE).to_bits();
        let exponent = (bits >> (f64::MANTISSA_DIGITS - 1)) as i32 - (f64::MAX_EXP - 1);
        let bin = (exponent + Self::OFFSET).clamp(0, Self::BINS as i32 - 1);
        self.counts[bin as usize] = self.counts[bin as usize].saturating_add(1);
    }

    /// Returns the upper edge of the bin that contains the quantile; `None` while there are too few values.
    fn quantile(&self, share: f64) -> Option<f64> {
        let count = self.total - self.zeros;
        if count < LEAST_VALUES {
            return None;
        }
        let wanted = (share * count as f64).ceil() as u64;
        let mut below = 0;
        let bin = self.counts.iter().position(|count| {
            below += u64::from(*count);
            below >= wanted
        })?;
        Some(2_f64.powi(bin as i32 + 1 - Self::OFFSET))
    }
}

/// The ranges of position, velocity and effort of each joint.
#[derive(Debug, Clone, Default)]
pub struct Ranges {
    joints: Vec<Joint>,
    /// Magnitude above which a value is not a measurement, by joint and field, from the values so far.
    bounds: Vec<[f64; 3]>,
    values: u64,
}

#[derive(Debug, Clone, Default)]
struct Joint {
    /// Effort limit of the robot file.
    limit: Option<f64>,
    fields: [Magnitudes; 3],
    /// Steps of the effort.
    steps: Magnitudes,
    last_effort: Option<f64>,
    in_dropout: bool,
}

/// Judgement of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Judgement {
    /// It may be a measurement.
    Possible,
    /// An effort of exactly zero between other values.
    Dropout,
    /// It cannot be a measurement.
    Impossible,
}

impl Ranges {
    /// Creates the ranges of joints with these effort limits.
    pub fn new(limits: impl IntoIterator<Item = Option<f64>>) -> Self {
        let limits = limits.into_iter();
        let joints: Vec<Joint> = limits
            .map(|limit| Joint {
                // Zero is a placeholder.
                limit: limit.filter(|limit| *limit > 0.0),
                ..Joint::default()
            })
            .collect();
        Self {
            bounds: vec![[f64::INFINITY; 3]; joints.len()],
            joints,
            values: 0,
        }
    }

    /// Adds a finite value of a joint's field (0 position, 1 velocity, 2 effort) and judges it by the previous ones.
    /// Refused values are included in the range, too: if they are frequent, they are real.
    pub fn take(&mut self, joint: usize, field: usize, value: f64) -> Judgement {
        let bound = self.bounds[joint][field];
        let of = &mut self.joints[joint];
        let mut judgement = Judgement::Possible;
        if value.is_subnormal() || value.abs() > bound {
            judgement = Judgement::Impossible;
        } else if field == EFFORT {
            of.in_dropout = value == 0.0 && (of.in_dropout || of.drops_to_zero());
            if of.in_dropout {
                judgement = Judgement::Dropout;
            } else if let Some(last) = of.last_effort.replace(value) {
                of.steps.add(value - last);
            }
        }
        of.fields[field].add(value);
        self.values += 1;
        // Occasional updates suffice, because a range changes slowly.
        if self.values.is_power_of_two() || self.values.is_multiple_of(1 << 14) {
            self.update();
        }
        judgement
    }

    /// Discards the newest efforts: the next value begins a new recording, or the head of one is read again.
    pub fn rewind(&mut self) {
        for joint in &mut self.joints {
            joint.last_effort = None;
            joint.in_dropout = false;
        }
        self.update();
    }

    /// Updates the bounds with all values.
    pub fn update(&mut self) {
        let largest: [Option<f64>; 3] = std::array::from_fn(|field| {
            let usual = self.joints.iter();
            let usual = usual.filter_map(|joint| joint.fields[field].quantile(QUANTILE));
            usual.max_by(f64::total_cmp)
        });
        for (joint, bounds) in self.joints.iter().zip(&mut self.bounds) {
            for (field, bound) in bounds.iter_mut().enumerate() {
                let own = joint.fields[field].quantile(QUANTILE);
                // A limit in another unit is exceeded all the time.
                let limit = joint.limit.filter(|limit| {
                    field == EFFORT && own.is_some_and(|usual| 0.5 * usual <= *limit)
                });
                let by_limit = limit.map(|limit| TIMES_LIMIT * limit);
                let by_range = largest[field].map(|usual| TIMES_USUAL * usual);
                *bound = by_limit.or(by_range).unwrap_or(f64::INFINITY);
            }
        }
    }

    /// Returns the baseline of a joint's field: the magnitude that nine of ten values do not exceed.
    pub fn usual(&self, joint: usize, field: usize) -> f64 {
        let usual = self.joints[joint].fields[field].quantile(QUANTILE);
        usual.unwrap_or(f64::NAN)
    }
}

impl Joint {
    /// Whether a zero as the next value is too large a step for this joint.
    fn drops_to_zero(&self) -> bool {
        let (Some(last), Some(step)) = (self.last_effort, self.steps.quantile(STEP_QUANTILE))
        else {
            return false;
        };
        let efforts = &self.fields[EFFORT];
        let rare = (efforts.zeros as f64) < MOST_ZEROS * efforts.total as f64;
        rare && last.abs() > TIMES_STEP * step
    }
}

const EFFORT: usize = 2;

/// Largest number of listed times of refused values.
/// Resolution: for a short text.
const MOST_STARTS: usize = 3;

/// Counter of the values of one field of one joint that are not measurements.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Refused {
    pub messages: u64,
    /// Number of runs of consecutive messages.
    pub runs: u64,
    /// Times at which the first runs begin \[ns\].
    starts_ns: [i64; MOST_STARTS],
    /// Time of the last message \[ns\].
    last_ns: i64,
    /// Value with the largest magnitude.
    pub example: f64,
    /// A subnormal value, if there is one.
    pub subnormal: Option<f64>,
    /// Whether the newest message was refused.
    goes_on: bool,
}

impl Refused {
    /// Adds a value, refused or not.
    pub fn add(&mut self, time_ns: i64, value: f64, is_refused: bool) {
        if is_refused {
            self.messages += 1;
            if !self.goes_on {
                if let Some(start_ns) = self.starts_ns.get_mut(self.runs as usize) {
                    *start_ns = time_ns;
                }
                self.runs += 1;
            }
            self.last_ns = time_ns;
            if value.is_subnormal() {
                self.subnormal = Some(value);
            }
            if value.abs() >= self.example.abs() {
                self.example = value;
            }
        }
        self.goes_on = is_refused;
    }

    /// Returns number and times of the messages, in seconds since `first_ns`.
    pub fn times(&self, first_ns: i64) -> Times {
        let since_s = |ns: i64| (ns - first_ns) as f64 * 1e-9;
        let starts = self.starts_ns.iter().take(self.runs as usize);
        Times {
            messages: self.messages,
            runs: self.runs,
            starts_s: starts.map(|&ns| since_s(ns)).collect(),
            last_s: since_s(self.last_ns),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Efforts of one joint at 100 Hz: gravity and a sine, with a little noise of the encoder.
    fn effort(k: u32) -> f64 {
        let t = f64::from(k) * 0.01;
        20.0 + 5.0 * (1.3 * t).sin() + 0.1 * (170.0 * t).sin()
    }

    fn judged(limit: Option<f64>, value: impl Fn(u32) -> f64) -> Vec<Judgement> {
        let mut ranges = Ranges::new([limit]);
        for k in 0..1200 {
            ranges.take(0, EFFORT, value(k));
        }
        ranges.rewind();
        let all = (0..1200).map(|k| ranges.take(0, EFFORT, value(k)));
        all.collect()
    }

    #[test]
    fn memory_that_was_never_written_is_no_measurement() {
        for garbage in [1.8e237, 1e-308, 2.9e-321, -9_999_999.0] {
            let judged = judged(None, |k| if k % 300 == 7 { garbage } else { effort(k) });
            for (k, judgement) in judged.iter().enumerate() {
                let expected = if k % 300 == 7 {
                    Judgement::Impossible
                } else {
                    Judgement::Possible
                };
                assert_eq!(*judgement, expected, "{garbage} at {k}");
            }
        }
    }

    #[test]
    fn a_limit_of_the_robot_file_is_believed_unless_the_effort_exceeds_it_all_the_time() {
        let spikes = |scale: f64| {
            move |k| {
                if k % 300 == 7 {
                    900.0
                } else {
                    scale * effort(k)
                }
            }
        };
        assert!(judged(Some(30.0), spikes(1.0)).contains(&Judgement::Impossible));
        // Milliamperes, compared with a limit in N m.
        assert!(!judged(Some(30.0), spikes(100.0)).contains(&Judgement::Impossible));
    }

    #[test]
    fn a_joint_that_mostly_rests_may_move() {
        let judged = judged(None, |k| {
            if k < 1150 {
                0.0
            } else {
                0.3 * f64::from(k % 5)
            }
        });
        assert!(
            judged
                .iter()
                .all(|judgement| *judgement == Judgement::Possible)
        );
    }

    #[test]
    fn an_effort_that_drops_to_zero_is_a_dropout_and_one_that_passes_zero_is_not() {
        let drops = judged(None, |k| {
            if (500..506).contains(&k) || (800..803).contains(&k) {
                0.0
            } else {
                effort(k)
            }
        });
        let dropped: Vec<usize> = (0..1200)
            .filter(|&k| drops[k] == Judgement::Dropout)
            .collect();
        assert_eq!(dropped, [500, 501, 502, 503, 504, 505, 800, 801, 802]);
        // A coarse quantisation makes zeros where the effort passes zero.
        let passes = judged(None, |k| ((effort(k) - 20.0) / 0.5).round() * 0.5);
        assert!(!passes.contains(&Judgement::Dropout));
    }
}
