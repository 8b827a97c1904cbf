//! The virtual collision sensor block of one joint (section 5, figure 12b).

use super::bias::Bias;
use super::model_error::ModelError;
use super::noise::MeasurementNoise;
use super::phase::{Phase, PhaseMachine};
use super::trend::{NoiseBounds, Trend};

/// Settings of the trend detection and the model-error estimate of a joint's currents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BlockSettings {
    /// Cutoff of the low-pass on both currents \[Hz\].
    pub cutoff_hz: f64,
    /// Time between two updates of the model error in the steady state, `T_s` \[s\].
    pub period_s: f64,
    /// Weight δ of equation 9.
    pub delta: f64,
}

/// Settings of a joint's sensor block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tuning {
    /// Settings of its trend detection and model-error estimate.
    pub block: BlockSettings,
    /// Factor α of equation 17.
    pub alpha: f64,
    /// Time constant of the adaptation, equation 14 \[s\].
    pub time_constant_s: f64,
}

/// State of a joint's currents after a sample, independent of the bias.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Currents {
    /// State of the machine in figure 6.
    pub phase: Phase,
    /// |R|, equation 1 \[effort unit\].
    pub residue: f64,
    /// Estimated model error \[effort unit\].
    pub model_error: f64,
    /// Margin for measurement noise, ν \[effort unit\].
    pub noise: f64,
}

/// Result of a joint's sensor block for a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Reading {
    /// State of the machine in figure 6.
    pub phase: Phase,
    /// |R|, equation 1 \[effort unit\].
    pub residue: f64,
    /// Estimated model error \[effort unit\].
    pub model_error: f64,
    /// `S_coll` of equations 4 and 17, plus the margin for noise \[effort unit\].
    pub threshold: f64,
}

impl Reading {
    /// Returns |R| relative to the threshold, regardless of whether the joint is tested.
    pub fn ratio(&self) -> f64 {
        // The threshold of a joint without any current is zero.
        self.residue / self.threshold.max(f64::MIN_POSITIVE)
    }

    /// Evaluates the collision test of equation 3; it is false in the safe state.
    pub fn collides(&self) -> bool {
        self.phase.is_tested() && self.residue > self.threshold
    }
}

/// Trend detection and model-error estimate of one joint's currents, independent of the bias.
#[derive(Debug, Clone)]
pub(super) struct Block {
    omega_rad_s: f64,
    measured: Trend,
    expected: Trend,
    noise: NoiseBounds,
    measurement: MeasurementNoise,
    machine: PhaseMachine,
    model_error: ModelError,
}

impl Block {
    pub fn new(settings: BlockSettings) -> Self {
        Self {
            omega_rad_s: std::f64::consts::TAU * settings.cutoff_hz,
            measured: Trend::new(settings.cutoff_hz),
            expected: Trend::new(settings.cutoff_hz),
            noise: NoiseBounds::default(),
            measurement: MeasurementNoise::new(settings.cutoff_hz),
            machine: PhaseMachine::default(),
            model_error: ModelError::new(settings.period_s, settings.delta),
        }
    }

    /// Resets the block to these currents.
    pub fn reset(&mut self, measured: f64, expected: f64) {
        self.measured.reset(measured);
        self.expected.reset(expected);
        self.noise = NoiseBounds::default();
        self.measurement.reset(measured - expected);
        self.machine = PhaseMachine::default();
        self.model_error.reset();
    }

    /// Processes the next currents, `dt_s` seconds after the previous ones.
    pub fn update(&mut self, dt_s: f64, measured: f64, expected: f64) -> Currents {
        self.measured.update(dt_s, measured);
        self.expected.update(dt_s, expected);
        let phase = self.machine.update(
            &self.measured,
            &self.expected,
            &self.noise,
            self.omega_rad_s,
        );
        self.noise
            .update(dt_s, self.measured.rate - self.expected.rate);
        // Equation 1.
        let residue = (self.measured.value - self.expected.value).abs();
        let model_error = self
            .model_error
            .update(dt_s, residue, phase == Phase::Steady);
        Currents {
            phase,
            residue,
            model_error,
            noise: self.measurement.update(dt_s, measured - expected),
        }
    }
}

/// Collision threshold of one joint. The learnt bias belongs to the robot and survives resets.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    tuning: Tuning,
    /// Learning and adaptation.
    pub bias: Bias,
    /// The bias at the last instant without signs of a collision.
    trusted: Bias,
}

impl Joint {
    pub fn new(tuning: Tuning, bias: Bias) -> Self {
        Self {
            tuning,
            bias,
            trusted: bias,
        }
    }

    /// Saves the bias: no collision has influenced it so far.
    pub fn trust_bias(&mut self) {
        self.trusted = self.bias;
    }

    /// Restores the saved bias.
    pub fn distrust_bias(&mut self) {
        self.bias = self.trusted;
    }

    /// Computes the threshold for the currents, `dt_s` seconds after the previous sample.
    pub fn read(&mut self, dt_s: f64, currents: &Currents) -> Reading {
        self.bias.advance(dt_s);
        let bias = self.bias.value(self.tuning.time_constant_s);
        Reading {
            phase: currents.phase,
            residue: currents.residue,
            model_error: currents.model_error,
            threshold: self.tuning.alpha * (currents.model_error + bias) + currents.noise,
        }
    }

    /// Executes the service Init of the learning machine.
    pub fn init_bias(&mut self) {
        self.bias.init(self.tuning.time_constant_s);
    }

    /// Executes the bias estimation block, which runs in parallel with the collision test.
    pub fn estimate_bias(&mut self, reading: &Reading) {
        if reading.phase.is_tested() {
            self.bias.observe(
                reading.residue,
                reading.model_error,
                reading.threshold,
                self.tuning.time_constant_s,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(phase: Phase, residue: f64) -> Reading {
        Reading {
            phase,
            residue,
            model_error: 1.0,
            threshold: 2.0,
        }
    }

    #[test]
    fn nothing_is_tested_while_moving() {
        assert!(!reading(Phase::Moving, 50.0).collides());
        for phase in [
            Phase::Steady,
            Phase::Reversing,
            Phase::ReversingDm,
            Phase::Impulse,
        ] {
            assert!(reading(phase, 2.1).collides());
            // Equation 3: a collision is strictly above the threshold.
            assert!(!reading(phase, 2.0).collides());
        }
    }

    #[test]
    fn the_threshold_is_alpha_times_model_error_and_bias() {
        let block = BlockSettings {
            cutoff_hz: 15.0,
            period_s: 0.2,
            delta: 0.5,
        };
        let tuning = Tuning {
            block,
            alpha: 1.1,
            time_constant_s: 60.0,
        };
        let mut block = Block::new(block);
        block.reset(3.0, 1.0);
        let currents = block.update(0.002, 3.0, 1.0);
        let reading = Joint::new(tuning, Bias::new(0.5)).read(0.002, &currents);
        assert_eq!(reading.phase, Phase::Steady);
        assert!((reading.residue - 2.0).abs() < 1e-12);
        assert!((reading.model_error - 2.0).abs() < 1e-12);
        assert!((reading.threshold - 1.1 * 2.5).abs() < 1e-12);
    }
}
