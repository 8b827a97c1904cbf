//! The recurrent network of `lstm_momentum_observer`: an LSTM layer followed by a dense layer, which
//! estimate the external torque of a contact-free arm from its motion.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::runner::{Course, Scorer};
use super::scaling::Scaling;
use super::signals::Signal;
use super::training::{Recurrent, Sequence, fit};
use super::{TrainingSettings, demand};
use crate::frame::{LearnError, SignalSettings, Task, Trained, TrainedError};

/// Number of inputs per joint: q(t), q̇(t), q̇(t-1).
const INPUTS: usize = 3;

/// A trained network, with gates in the order input, forget, cell, output.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lstm {
    joints: usize,
    hidden: usize,
    input_scaling: Scaling,
    output_scaling: Scaling,
    /// `[inputs, 4 hidden]`
    weight_input: Vec<f32>,
    /// `[hidden, 4 hidden]`
    weight_hidden: Vec<f32>,
    /// `[4 hidden]`
    bias: Vec<f32>,
    /// `[joints, hidden]`
    weight_output: Vec<f32>,
    /// `[joints]`
    bias_output: Vec<f32>,
}

impl Lstm {
    /// Trains the detector `name` with `hidden` units, on sequences of `length` samples.
    ///
    /// # Errors
    /// If a setting is out of range, there is no robot's model, too little data, or the training diverges.
    pub fn train(
        name: &'static str,
        signals: &SignalSettings,
        [hidden, length]: [usize; 2],
        training: &TrainingSettings,
        task: &Task<'_>,
    ) -> Result<Trained, LearnError> {
        demand(name, hidden > 0, "`hidden` must be at least 1")?;
        training.check(name)?;
        let course = Course::new(name, signals, length, task)?;
        let mut rng = ChaCha8Rng::seed_from_u64(task.seed);
        let net = Self::fit(&course, hidden, length, training, &mut rng);
        course.end(|trained| net.save(trained), Self::scorer)
    }

    /// Returns the scorer of a trained detector.
    ///
    /// # Errors
    /// If an array is missing or has another shape.
    pub fn scorer(trained: &Trained) -> Result<Box<dyn Scorer>, TrainedError> {
        Ok(Box::new(LstmScorer::load(trained)?))
    }

    /// Trains on sequences of `length` samples, with `hidden` units.
    pub fn fit(
        course: &Course<'_>,
        hidden: usize,
        length: usize,
        settings: &TrainingSettings,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let joints = course.joint_count();
        let (inputs, outputs): (Vec<_>, Vec<_>) = (course.stretches().iter().flatten())
            .map(|signal| {
                (
                    input(signal, joints).collect::<Vec<_>>(),
                    signal.torque[..joints].to_vec(),
                )
            })
            .unzip();
        let input_scaling = Scaling::fit(INPUTS * joints, inputs.iter().map(Vec::as_slice));
        let output_scaling = Scaling::fit(joints, outputs.iter().map(Vec::as_slice));
        let sequences: Vec<Sequence<f32>> = (course.stretches().iter())
            .map(|stretch| sequence(stretch, joints, &input_scaling, &output_scaling))
            .collect();

        let sizes = [INPUTS * joints, hidden, joints];
        let mut net = Recurrent::start(sizes, length, settings.dropout, rng);
        let examples = |rng: &mut ChaCha8Rng| Recurrent::<f32>::examples(&sequences, length, rng);
        let learn = |net: &mut Recurrent<f32>, batch: &[_], rng: &mut ChaCha8Rng| {
            net.learn(&sequences, batch, rng);
        };
        let settings = TrainingSettings {
            // The setting is in samples, `fit` needs sequences.
            batch: (settings.batch / length).max(1),
            ..*settings
        };
        fit(&settings, &mut net, rng, &examples, &learn);
        Self::of(&net, [input_scaling, output_scaling])
    }

    /// Returns the network with the trained weights and the scaling of its inputs and outputs.
    fn of(net: &Recurrent<f32>, [input_scaling, output_scaling]: [Scaling; 2]) -> Self {
        let numbers = net.numbers().map(<[f32]>::to_vec);
        let [
            weight_input,
            weight_hidden,
            bias,
            weight_output,
            bias_output,
        ] = numbers;
        Self {
            joints: bias_output.len(),
            hidden: bias.len() / 4,
            input_scaling,
            output_scaling,
            weight_input,
            weight_hidden,
            bias,
            weight_output,
            bias_output,
        }
    }

    /// Saves scaling and weights.
    pub fn save(&self, into: &mut Trained) {
        let (joints, hidden) = (self.joints, self.hidden);
        self.input_scaling.save("input", into);
        self.output_scaling.save("output", into);
        into.put_f32(
            "lstm.weight_input",
            &[INPUTS * joints, 4 * hidden],
            &self.weight_input,
        );
        into.put_f32(
            "lstm.weight_hidden",
            &[hidden, 4 * hidden],
            &self.weight_hidden,
        );
        into.put_f32("lstm.bias", &[4 * hidden], &self.bias);
        into.put_f32("output.weight", &[joints, hidden], &self.weight_output);
        into.put_f32("output.bias", &[joints], &self.bias_output);
    }

    /// Loads a network that [`Lstm::save`] saved.
    ///
    /// # Errors
    /// If an array is missing or has another shape.
    pub fn load(from: &Trained) -> Result<Self, TrainedError> {
        let joints = from.facts().joints.len();
        let hidden = from.shape("output.weight").get(1).copied().unwrap_or(0);
        let gates = 4 * hidden;
        Ok(Self {
            joints,
            hidden,
            input_scaling: Scaling::load("input", INPUTS * joints, from)?,
            output_scaling: Scaling::load("output", joints, from)?,
            weight_input: from.get_f32("lstm.weight_input", &[INPUTS * joints, gates])?,
            weight_hidden: from.get_f32("lstm.weight_hidden", &[hidden, gates])?,
            bias: from.get_f32("lstm.bias", &[gates])?,
            weight_output: from.get_f32("output.weight", &[joints, hidden])?,
            bias_output: from.get_f32("output.bias", &[joints])?,
        })
    }

    /// Advances the state `hidden` and `cell` by one sample; `gates` is workspace.
    fn step(&self, input: &[f64], hidden: &mut [f32], cell: &mut [f32], gates: &mut [f32]) {
        gates.copy_from_slice(&self.bias);
        let mut add = |value: f32, row: &[f32]| {
            for (gate, weight) in gates.iter_mut().zip(row) {
                *gate += value * weight;
            }
        };
        for (&value, row) in (input.iter()).zip(self.weight_input.chunks_exact(4 * self.hidden)) {
            add(value as f32, row);
        }
        for (&value, row) in (hidden.iter()).zip(self.weight_hidden.chunks_exact(4 * self.hidden)) {
            add(value, row);
        }
        let logistic = |x: f32| 1.0 / (1.0 + (-x).exp());
        let n = self.hidden;
        for (k, (hidden, cell)) in hidden.iter_mut().zip(cell).enumerate() {
            let [i, f, g, o] = [0, 1, 2, 3].map(|gate| gates[gate * n + k]);
            *cell = logistic(f) * *cell + logistic(i) * g.tanh();
            *hidden = logistic(o) * cell.tanh();
        }
    }

    /// Returns the scaled output of joint `joint`.
    fn output(&self, joint: usize, hidden: &[f32]) -> f32 {
        let row = &self.weight_output[joint * self.hidden..][..self.hidden];
        let sum: f32 = row.iter().zip(hidden).map(|(w, h)| w * h).sum();
        sum + self.bias_output[joint]
    }
}

/// Returns q(t), q̇(t), q̇(t-1) of all joints.
fn input(signal: &Signal, joints: usize) -> impl Iterator<Item = f64> + '_ {
    let parts = [
        &signal.position,
        &signal.velocity,
        &signal.previous_velocity,
    ];
    parts
        .into_iter()
        .flat_map(move |part| part[..joints].iter().copied())
}

fn sequence(
    stretch: &[Signal],
    joints: usize,
    inputs: &Scaling,
    outputs: &Scaling,
) -> Sequence<f32> {
    let mut sequence = Sequence {
        inputs: Vec::with_capacity(stretch.len() * INPUTS * joints),
        outputs: Vec::with_capacity(stretch.len() * joints),
        len: stretch.len(),
    };
    for signal in stretch {
        let mut row: Vec<f64> = input(signal, joints).collect();
        inputs.apply(&mut row);
        sequence.inputs.extend(row.iter().map(|&x| x as f32));
        let mut row = signal.torque[..joints].to_vec();
        outputs.apply(&mut row);
        sequence.outputs.extend(row.iter().map(|&x| x as f32));
    }
    sequence
}

/// Compares the network's estimate with the observer's; the network's state persists from sample to sample.
pub(crate) struct LstmScorer {
    net: Lstm,
    /// Number of samples in a training sequence: there is no score before as many samples.
    window: usize,
    seen: usize,
    input: Vec<f64>,
    hidden: Vec<f32>,
    cell: Vec<f32>,
    gates: Vec<f32>,
}

impl LstmScorer {
    /// Loads a network that [`Lstm::save`] saved.
    ///
    /// # Errors
    /// If an array is missing or has another shape.
    pub fn load(from: &Trained) -> Result<Self, TrainedError> {
        Ok(Self::new(Lstm::load(from)?, from.facts().window))
    }

    fn new(net: Lstm, window: usize) -> Self {
        Self {
            window,
            seen: 0,
            input: Vec::with_capacity(INPUTS * net.joints),
            hidden: vec![0.0; net.hidden],
            cell: vec![0.0; net.hidden],
            gates: vec![0.0; 4 * net.hidden],
            net,
        }
    }
}

impl Scorer for LstmScorer {
    /// Returns `|τ_ext - τ̂_ext|²` \[(N m)²\].
    fn score(&mut self, signal: &Signal) -> Option<f64> {
        self.input.clear();
        self.input.extend(input(signal, self.net.joints));
        self.net.input_scaling.apply(&mut self.input);
        self.net.step(
            &self.input,
            &mut self.hidden,
            &mut self.cell,
            &mut self.gates,
        );
        self.seen += 1;
        if self.seen < self.window {
            return None;
        }
        let errors = (0..self.net.joints).map(|joint| {
            let estimate = f64::from(self.net.output(joint, &self.hidden));
            signal.torque[joint] - self.net.output_scaling.undo(joint, estimate)
        });
        Some(errors.map(|error| error * error).sum())
    }

    fn reset(&mut self) {
        self.seen = 0;
        self.hidden.fill(0.0);
        self.cell.fill(0.0);
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn its_loops_compute_what_training_computes() {
        let (joints, hidden, length) = (2, 5, 7);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let sizes = [INPUTS * joints, hidden, joints];
        let mut training = Recurrent::start(sizes, length, 0.0, &mut rng);
        let scalings = [INPUTS * joints, joints].map(|n| {
            let rows = [vec![0.0; n], vec![1.0; n]];
            Scaling::fit(n, rows.iter().map(Vec::as_slice))
        });
        let net = Lstm::of(&training, scalings);
        let inputs: Vec<f64> = (0..length * INPUTS * joints)
            .map(|k| (k as f64).sin())
            .collect();
        let sequence = Sequence {
            inputs: inputs.iter().map(|&x| x as f32).collect(),
            outputs: vec![0.0; length * joints],
            len: length,
        };
        training.learn(&[sequence], &[(0, 0)], &mut rng);
        let (mut state, mut cell, mut gates) = ([0.0; 5], [0.0; 5], [0.0; 20]);
        let samples = inputs.chunks_exact(INPUTS * joints);
        for (input, theirs) in samples.zip(training.outputs().row_iter()) {
            net.step(input, &mut state, &mut cell, &mut gates);
            for (joint, theirs) in theirs.iter().enumerate() {
                assert!((net.output(joint, &state) - theirs).abs() < 1e-6);
            }
        }
    }
}
