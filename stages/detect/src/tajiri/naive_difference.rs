//! `naive_difference`: Tajiri and Iwamoto, section IV-B 1: [`twin_regression`](crate::tajiri::twin_regression)
//! with gain 1 and offset 0.
//!
//! The twin's low-pass is linear with static gain 1, so the regression can be undone after it; one
//! twin stage serves both detectors.

use crate::frame::{ConfigError, Detector, DetectorSettings, Judgement, ScoreUnit, Setup};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::{MAX_JOINTS, TwinState, flags};

/// Canonical name.
pub(crate) const NAME: &str = "naive_difference";

/// Settings of `naive_difference`: none. The filters are the twin's.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Settings {}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "`twin_regression` without the regression: gain 1, offset 0 (Tajiri and Iwamoto).";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::SquaredEffort;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        let mut regression = [(1.0, 0.0); MAX_JOINTS];
        for (own, joint) in regression.iter_mut().zip(&setup.joints) {
            *own = (joint.gain, joint.offset);
        }
        Ok(Box::new(NaiveDifference { regression }))
    }

    fn is_calibrated(_: &Setup) -> bool {
        true
    }
}

struct NaiveDifference {
    /// Gain and offset by joint, as the twin applied them.
    regression: [(f64, f64); MAX_JOINTS],
}

impl Detector for NaiveDifference {
    fn name(&self) -> &'static str {
        NAME
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let joint_count = sample.header.joint_count as usize;
        let score = (0..joint_count)
            .map(|j| {
                let (gain, offset) = self.regression[j];
                // A gain of zero has removed the model's effort: there is nothing to compare with.
                let model = if gain == 0.0 {
                    0.0
                } else {
                    (sample.filtered_expected_effort[j] - offset) / gain
                };
                (sample.filtered_effort[j] - model).powi(2)
            })
            .sum();
        Judgement {
            score,
            ready: sample.header.has(flags::READY),
            verdict: None,
        }
    }
}
