//! `momentum_observer`: Tajiri and Iwamoto, section IV-B 2 ("Naive MOB"): the squared length of the external
//! torque that the [momentum observer](crate::frame::momentum) estimates.
//!
//! The observer uses the rigid-body model: like [`naive_difference`](crate::tajiri::naive_difference) it undoes the
//! twin's gain and offset. The paper uses low-pass filtered data for all methods; the observer is linear in the
//! efforts, so the same low-pass is applied to its output.

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

/// Default threshold, in standard deviations above the mean score. The paper's best threshold is mean + σ for this
/// method, and mean + 4 σ for the paper's own method.
/// Chosen: between the two. With 1 σ, 18 % of the contact-free time is in alarm (docs/papers.md); a higher threshold
/// finds fewer contacts.
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
            // Together with the observer's 10 ms, this has the delay of the twin's low-pass of 4.5 Hz on efforts (√2
            // / ω). The paper does not state its cutoff.
            cutoff_hz: 5.6,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Squared length of the external torque estimated by a momentum observer of the rigid body.";
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
    /// Low-passes on the observed torque, by joint.
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
            // A gain of zero has removed the model's effort: there is nothing to compare with.
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
