//! `momentum_observer`: Tajiri and Iwamoto, section IV-B 2 ("Naive MOB"): the squared length of the external
//! torque that the [momentum observer](crate::frame::momentum) estimates.
//!
//! The observer is that of the rigid body: like [`naive_difference`](crate::tajiri::naive_difference) it undoes the
//! twin's gain and offset. The paper gives all methods low-pass filtered data; the observer is linear in the
//! efforts, so the same low-pass stands behind it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::{MAX_JOINTS, TwinState, flags};
use tauscope_dynamics::lowpass::Butterworth2;

use crate::frame::momentum::{DEFAULT_GAIN_PER_S, MomentumObserver};
use crate::frame::{
    ConfigError, Detector, DetectorSettings, JointSetup, Judgement, ScoreUnit, Setup,
};

/// Canonical name.
pub(crate) const NAME: &str = "momentum_observer";

/// Where its alarm is raised if the file does not say: the paper's best threshold for it is mean + σ,
/// that of its own method mean + 4 σ.
/// Tuned: between the two, by hand; not swept.
pub(crate) const SIGMAS: f64 = 3.0;

/// Settings of `momentum_observer`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The observer's gain \[1/s\].
    #[schemars(range(min = 0.01, max = 100_000.0))]
    pub gain_per_s: f64,
    /// Low-pass on the observed torques \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub cutoff_hz: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            gain_per_s: DEFAULT_GAIN_PER_S,
            // With the observer's own 10 ms as late as the twin's low-pass of 4.5 Hz on efforts (√2 / ω); the paper does not give its own.
            cutoff_hz: 5.6,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Squared length of the external torque that a momentum observer of the rigid body sees.";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::SquaredTorque;
    const SIGMAS: f64 = SIGMAS;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let filter = Butterworth2::new(self.cutoff_hz);
        Ok(Box::new(Naive {
            observer: MomentumObserver::new(setup, self.gain_per_s, NAME)?,
            regression: (setup.joints.iter())
                .map(|joint| (joint.gain, joint.offset))
                .collect(),
            settling_ns: (filter.settling_time_s() * 1e9) as i64,
            filters: vec![filter; setup.joints.len()],
            previous_ns: None,
            started_ns: 0,
        }))
    }

    fn is_calibrated(setup: &Setup) -> bool {
        setup.model.is_some() && setup.joints.iter().any(JointSetup::tells_torque)
    }
}

struct Naive {
    observer: MomentumObserver,
    /// Gain and offset by joint, as the twin applied them.
    regression: Vec<(f64, f64)>,
    /// By joint, on the observed torque.
    filters: Vec<Butterworth2>,
    settling_ns: i64,
    previous_ns: Option<i64>,
    started_ns: i64,
}

impl Detector for Naive {
    fn name(&self) -> &'static str {
        NAME
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let stamp_ns = sample.header.stamp_ns;
        let mut plain = [0.0; MAX_JOINTS];
        let corrected = sample.expected_effort.iter().zip(&self.regression);
        for (plain, (effort, (gain, offset))) in plain.iter_mut().zip(corrected) {
            // A gain of zero has wiped the model's effort out: nothing is left to compare with.
            if *gain != 0.0 {
                *plain = (effort - offset) / gain;
            }
        }
        let torque_nm = self.observer.update_beside(sample, &plain);
        let previous_ns =
            (self.previous_ns.replace(stamp_ns)).filter(|_| !sample.header.has(flags::RESET));
        if previous_ns.is_none() {
            self.started_ns = stamp_ns;
            for (filter, torque) in self.filters.iter_mut().zip(torque_nm) {
                filter.reset(*torque);
            }
        }
        let dt_s = previous_ns.map_or(0.0, |before| (stamp_ns - before) as f64 * 1e-9);
        let torques = self.filters.iter_mut().zip(torque_nm);
        let score = torques
            .map(|(filter, torque)| filter.update(dt_s, *torque).powi(2))
            .sum();
        Judgement {
            score,
            ready: sample.header.has(flags::READY)
                && self.observer.settled()
                && stamp_ns - self.started_ns >= self.settling_ns,
            verdict: None,
        }
    }
}
