//! The virtual collision sensor block of one joint (section 5, figure 12b).

use super::bias::Bias;
use super::model_error::ModelError;
use super::noise::MeasurementNoise;
use super::phase::{Phase, PhaseMachine};
use super::trend::{NoiseBounds, Trend};

/// What tells what a joint's currents do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BlockSettings {
    /// Cutoff of the low-pass on both currents \[Hz\].
    pub cutoff_hz: f64,
    /// Time between two updates of the model error in the steady state, `T_s` \[s\].
    pub period_s: f64,
    /// Weight of equation 9.
    pub delta: f64,
}

/// What a joint's block works with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tuning {
    /// What tells what its currents do.
    pub block: BlockSettings,
    /// Factor of equation 17.
    pub alpha: f64,
    /// Time constant of the adaptation, equation 14 \[s\].
    pub time_constant_s: f64,
}

/// What a joint's currents do.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Currents {
    /// The state of figure 6.
    pub phase: Phase,
    /// |R|, equation 1 \[effort unit\].
    pub residue: f64,
    /// Estimated model error \[effort unit\].
    pub model_error: f64,
    /// What noise may add \[effort unit\].
    pub noise: f64,
}

/// What a joint's block makes of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Reading {
    /// What the currents are doing.
    pub phase: Phase,
    /// |R|, equation 1 \[effort unit\].
    pub residue: f64,
    /// Estimated model error \[effort unit\].
    pub model_error: f64,
    /// `S_coll`, equations 4 and 17, and what noise may add \[effort unit\].
    pub threshold: f64,
}

impl Reading {
    /// |R| as a share of the threshold, whether the test is made or not.
    pub fn ratio(&self) -> f64 {
        // A joint that has no current at all has no threshold either.
        self.residue / self.threshold.max(f64::MIN_POSITIVE)
    }

    /// Equation 3, which is not asked in the safe state.
    pub fn collides(&self) -> bool {
        self.phase.is_tested() && self.residue > self.threshold
    }
}

/// What tells what one joint's currents do, whatever the bias.
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

    /// Starts anew at these currents.
    pub fn reset(&mut self, measured: f64, expected: f64) {
        self.measured.reset(measured);
        self.expected.reset(expected);
        self.noise = NoiseBounds::default();
        self.measurement.reset(measured - expected);
        self.machine = PhaseMachine::default();
        self.model_error.reset();
    }

    /// Takes the next currents, `dt_s` seconds after the ones before.
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

/// One joint: what its currents are held against. What was learnt is of the robot, and stays for good.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    tuning: Tuning,
    /// Learning and adaptation.
    pub bias: Bias,
    /// The bias when nothing spoke for a collision last.
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

    /// What has been learnt up to here was no collision's.
    pub fn trust_bias(&mut self) {
        self.trusted = self.bias;
    }

    /// Forgets what was learnt since then.
    pub fn distrust_bias(&mut self) {
        self.bias = self.trusted;
    }

    /// Holds what the currents do, `dt_s` seconds after the sample before, against the threshold.
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

    /// The service Init of the learning machine.
    pub fn init_bias(&mut self) {
        self.bias.init(self.tuning.time_constant_s);
    }

    /// The bias estimation block, which runs beside the collision test.
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
            // Equation 3: a collision is what is above the threshold.
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
