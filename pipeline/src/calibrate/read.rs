//! One pass over a recording for a calibration.

use tauscope_bus::{SampleRef, Sink, StageError, TwinState, flags};
use tauscope_session::{Finding, Plausible};

use super::CalibrateError;

/// Counts and findings of one recording, or of all.
#[derive(Debug, Default)]
pub(super) struct Read {
    /// Number of samples that were lost or refused.
    pub lost: u64,
    /// Number of joint states.
    pub samples: u64,
    /// Number of joint states with measured efforts.
    pub measured: u64,
    /// Number of samples with settled filters.
    pub settled: u64,
    /// Whether no joint has moved.
    pub stands: bool,
    pub findings: Vec<Finding>,
}

impl Read {
    pub fn add(&mut self, other: &Self) {
        self.lost += other.lost;
        self.samples += other.samples;
        self.measured += other.measured;
        self.settled += other.settled;
    }

    /// Reason why there is no sample to calibrate on.
    pub fn why_nothing(&self, settling_s: f64) -> CalibrateError {
        match (self.measured, self.settled) {
            (0, _) => CalibrateError::NoEffort {
                samples: self.samples,
            },
            (samples, 0..2) => CalibrateError::TooShort {
                samples,
                settling_s,
            },
            _ => CalibrateError::AllTouched,
        }
    }
}

/// Passes every sample with settled filters to a closure; the first one after a reset carries the reset flag.
pub(super) struct Settled<'a> {
    pub plausible: &'a mut Plausible,
    pub measured: &'a mut u64,
    pub ready: &'a mut u64,
    pub take: &'a mut (dyn FnMut(&TwinState) + Send),
    pub reset: bool,
}

impl Sink for Settled<'_> {
    fn accept(&mut self, _from: &str, sample: SampleRef<'_>) -> Result<(), StageError> {
        let sample = match sample {
            SampleRef::TwinState(sample) => sample,
            SampleRef::JointState(sample) => {
                self.plausible.add(sample);
                *self.measured += u64::from(sample.header.has(flags::EFFORT_MEASURED));
                return Ok(());
            }
            _ => return Ok(()),
        };
        self.reset |= sample.header.has(flags::RESET);
        if sample.header.has(flags::READY) {
            *self.ready += 1;
            if std::mem::take(&mut self.reset) {
                let mut first = *sample;
                first.header.flags |= flags::RESET;
                (self.take)(&first);
            } else {
                (self.take)(sample);
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), StageError> {
        Ok(())
    }
}
