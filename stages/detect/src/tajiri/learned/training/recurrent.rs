//! An LSTM layer (Hochreiter and Schmidhuber, Long Short-Term Memory, 1997, with the forget gate of Gers,
//! Schmidhuber and Cummins, Learning to Forget, 2000) followed by a dense layer, trained by
//! backpropagation through time (Goodfellow, Bengio and Courville, Deep Learning, section 10.2.2).
//!
//! The sums s = Wx x(t) + Wh h(t-1) + b consist of a quarter for each gate, s₁ to s₄:
//!
//! i = σ(s₁), f = σ(s₂), g = tanh(s₃), o = σ(s₄);  c(t) = f c(t-1) + i g;  h(t) = o tanh(c(t))

use nalgebra::DMatrix;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::adam::Weight;
use super::dense::Dense;
use super::{Net, Real, drop_out, number};

/// One segment of scaled training data.
pub(crate) struct Sequence<T> {
    /// Inputs, concatenated over the samples.
    pub inputs: Vec<T>,
    /// Desired outputs, concatenated over the samples.
    pub outputs: Vec<T>,
    /// Number of samples.
    pub len: usize,
}

/// The network in training, with gates in the order input, forget, cell, output.
pub(crate) struct Recurrent<T> {
    /// Wx, `[4 hidden, inputs]`.
    weight_input: Weight<T>,
    /// Wh, `[4 hidden, hidden]`.
    weight_hidden: Weight<T>,
    /// b, `[4 hidden, 1]`.
    bias: Weight<T>,
    output: Dense<T>,
    /// Whᵀ.
    weight_back: DMatrix<T>,
    /// Number of samples in a sequence.
    length: usize,
    dropout: f64,
    room: Room<T>,
}

/// Intermediate results for a batch. A column is a sample, except for the dense layer. The first samples of all
/// sequences in the batch come first, then all second samples, and so on.
struct Room<T> {
    /// x.
    inputs: DMatrix<T>,
    /// The sums, then the gates, then the gradient of the loss by the sums.
    gates: DMatrix<T>,
    /// c.
    cells: DMatrix<T>,
    /// tanh(c).
    bent: DMatrix<T>,
    /// h.
    hidden: DMatrix<T>,
    /// The dropout factors, then the gradient of the loss by `hidden`.
    slopes: DMatrix<T>,
    /// `hidden` after dropout, then the gradient of the loss by it.
    kept: DMatrix<T>,
    /// Gradient of the loss by c(t) through all samples after t, one column per sequence.
    carried: DMatrix<T>,
    /// x, one row per sample.
    turned_inputs: DMatrix<T>,
    /// `kept`, then `hidden`, one row per sample.
    turned: DMatrix<T>,
    /// Output of the dense layer, one row per sample.
    outputs: DMatrix<T>,
    /// Desired outputs, then the gradient of the loss by `outputs`.
    wanted: DMatrix<T>,
}

impl<T: Real> Room<T> {
    fn new(batch: usize, length: usize, [inputs, hidden, outputs]: [usize; 3]) -> Self {
        let samples = batch * length;
        let zeros = |rows| DMatrix::zeros(rows, samples);
        Self {
            inputs: zeros(inputs),
            gates: zeros(4 * hidden),
            cells: zeros(hidden),
            bent: zeros(hidden),
            hidden: zeros(hidden),
            slopes: zeros(hidden),
            kept: zeros(hidden),
            carried: DMatrix::zeros(hidden, batch),
            turned_inputs: DMatrix::zeros(samples, inputs),
            turned: DMatrix::zeros(samples, hidden),
            outputs: DMatrix::zeros(samples, outputs),
            wanted: DMatrix::zeros(samples, outputs),
        }
    }
}

impl<T: Real> Recurrent<T> {
    /// Creates an untrained network with these numbers of inputs, hidden units and outputs, for sequences of `length`
    /// samples.
    pub fn start(
        [inputs, hidden, outputs]: [usize; 3],
        length: usize,
        dropout: f64,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        Self {
            weight_input: Weight::start(4 * hidden, inputs, hidden, rng),
            weight_hidden: Weight::start(4 * hidden, hidden, hidden, rng),
            bias: Weight::start(4 * hidden, 1, hidden, rng),
            output: Dense::start(hidden, outputs, rng),
            weight_back: DMatrix::zeros(hidden, 4 * hidden),
            length,
            dropout,
            room: Room::new(0, length, [inputs, hidden, outputs]),
        }
    }

    /// Returns Wx, Wh, b and the dense layer's W and b, each in column-major order of its shape in this file.
    pub fn numbers(&self) -> [&[T]; 5] {
        let lstm = [&self.weight_input, &self.weight_hidden, &self.bias];
        let [input, hidden, bias] = lstm.map(|weight| weight.value.as_slice());
        let output = [&self.output.weight, &self.output.bias];
        let [weight, output_bias] = output.map(|weight| weight.value.as_slice());
        [input, hidden, bias, weight, output_bias]
    }

    /// Returns the examples of an epoch: disjoint sequences of `length` samples with a random start. An example is an
    /// index into `sequences` and the index of its first sample.
    pub fn examples(
        sequences: &[Sequence<T>],
        length: usize,
        rng: &mut ChaCha8Rng,
    ) -> Vec<(usize, usize)> {
        let mut all = Vec::new();
        for (index, sequence) in sequences.iter().enumerate() {
            let last = sequence.len - length;
            let first = rng.random_range(0..length.min(last + 1));
            all.extend((first..=last).step_by(length).map(|at| (index, at)));
        }
        all
    }

    /// Sets the gradients of the mean squared error over a batch of [`examples`](Self::examples).
    pub fn learn(
        &mut self,
        sequences: &[Sequence<T>],
        batch: &[(usize, usize)],
        rng: &mut ChaCha8Rng,
    ) {
        self.gather(sequences, batch);
        self.forward(rng);
        self.backward();
    }

    /// Returns the output for the last batch, one row per sample: the first samples of all sequences, then all second
    /// samples, and so on.
    #[cfg(test)]
    pub fn outputs(&self) -> &DMatrix<T> {
        &self.room.outputs
    }

    fn gather(&mut self, sequences: &[Sequence<T>], batch: &[(usize, usize)]) {
        let (inputs, hidden) = (self.room.inputs.nrows(), self.room.hidden.nrows());
        let outputs = self.room.outputs.ncols();
        if self.room.carried.ncols() != batch.len() {
            self.room = Room::new(batch.len(), self.length, [inputs, hidden, outputs]);
        }
        let samples = (0..self.length)
            .flat_map(|k| batch.iter().map(move |&(index, at)| (index, at + k)))
            .enumerate();
        for (sample, (index, at)) in samples {
            let from = &sequences[index];
            let mut column = self.room.inputs.column_mut(sample);
            column.copy_from_slice(&from.inputs[at * inputs..][..inputs]);
            let row = &from.outputs[at * outputs..][..outputs];
            for (output, &x) in row.iter().enumerate() {
                self.room.wanted[(sample, output)] = x;
            }
        }
    }

    /// Computes the outputs, starting from a zero state.
    fn forward(&mut self, rng: &mut ChaCha8Rng) {
        let room = &mut self.room;
        let batch = room.carried.ncols();
        let (weight_input, weight_hidden) = (&self.weight_input.value, &self.weight_hidden.value);
        for mut sums in room.gates.column_iter_mut() {
            sums.copy_from(&self.bias.value);
        }
        let one = T::one();
        room.gates.gemm(one, weight_input, &room.inputs, one);
        for now in (0..self.length * batch).step_by(batch) {
            if now > 0 {
                let before = room.hidden.columns(now - batch, batch);
                let mut sums = room.gates.columns_mut(now, batch);
                sums.gemm(one, weight_hidden, &before, one);
            }
            for sample in now..now + batch {
                room.step(sample, sample.checked_sub(batch));
            }
        }
        room.slopes
            .apply(|slope| *slope = drop_out(self.dropout, rng));
        room.kept.copy_from(&room.hidden);
        room.kept.component_mul_assign(&room.slopes);
        room.kept.transpose_to(&mut room.turned);
        self.output.forward(&room.turned, &mut room.outputs);
    }

    fn backward(&mut self) {
        let room = &mut self.room;
        let batch = room.carried.ncols();
        let slope: T = number(2.0 / room.outputs.len() as f64);
        for (wanted, &output) in room.wanted.iter_mut().zip(room.outputs.iter()) {
            *wanted = (output - *wanted) * slope;
        }
        let (one, zero) = (T::one(), T::zero());
        let output = &mut self.output;
        output.learn(&room.turned, &mut room.kept, &room.wanted);
        // The gradient by h is the sum of the one through the output ...
        output.back(&room.wanted, &mut room.turned);
        room.turned.transpose_to(&mut room.kept);
        room.slopes.component_mul_assign(&room.kept);
        // ... and the one through the next sample's gates.
        let back = &mut self.weight_back;
        self.weight_hidden.value.transpose_to(back);
        room.carried.fill(zero);
        for now in (0..self.length * batch).step_by(batch).rev() {
            for sample in now..now + batch {
                room.step_back(sample, sample.checked_sub(batch));
            }
            if now > 0 {
                let mut before = room.slopes.columns_mut(now - batch, batch);
                before.gemm(one, back, &room.gates.columns(now, batch), one);
            }
        }
        self.add_up();
    }

    /// Computes the gradients of the LSTM's weights from those by the sums.
    fn add_up(&mut self) {
        let room = &mut self.room;
        let (one, zero) = (T::one(), T::zero());
        let batch = room.carried.ncols();
        room.inputs.transpose_to(&mut room.turned_inputs);
        let gradient = &mut self.weight_input.gradient;
        gradient.gemm(one, &room.gates, &room.turned_inputs, zero);
        room.hidden.transpose_to(&mut room.turned);
        let later = room.gates.ncols() - batch;
        let before = room.turned.rows(0, later);
        let gates = room.gates.columns(batch, later);
        self.weight_hidden.gradient.gemm(one, &gates, &before, zero);
        self.bias.gradient.fill(zero);
        for column in room.gates.column_iter() {
            self.bias.gradient += column;
        }
    }
}

impl<T: Real> Room<T> {
    /// Computes gates, cells and h of a sample from its sums and the cells of the sample `before`.
    fn step(&mut self, sample: usize, before: Option<usize>) {
        let hidden = self.hidden.nrows();
        let gates = &mut self.gates.as_mut_slice()[sample * 4 * hidden..][..4 * hidden];
        let (logistic, rest) = gates.split_at_mut(2 * hidden);
        let (middle, output) = rest.split_at_mut(hidden);
        for sum in logistic.iter_mut().chain(output) {
            *sum = T::one() / (T::one() + (-*sum).exp());
        }
        for sum in middle {
            *sum = sum.tanh();
        }
        for unit in 0..hidden {
            let [input, forget, middle, output] = [0, 1, 2, 3].map(|k| gates[k * hidden + unit]);
            let carried = before.map_or(T::zero(), |before| forget * self.cells[(unit, before)]);
            let cell = carried + input * middle;
            let bent = cell.tanh();
            self.cells[(unit, sample)] = cell;
            self.bent[(unit, sample)] = bent;
            self.hidden[(unit, sample)] = output * bent;
        }
    }

    /// Computes the gradient of the loss by a sample's sums, and by the cells of the sample `before`.
    fn step_back(&mut self, sample: usize, before: Option<usize>) {
        let hidden = self.hidden.nrows();
        let sequence = sample % self.carried.ncols();
        let gates = &mut self.gates.as_mut_slice()[sample * 4 * hidden..][..4 * hidden];
        let one = T::one();
        for unit in 0..hidden {
            let [input, forget, middle, output] = [0, 1, 2, 3].map(|k| gates[k * hidden + unit]);
            let bent = self.bent[(unit, sample)];
            let slope = self.slopes[(unit, sample)];
            let carried = &mut self.carried[(unit, sequence)];
            let cell = *carried + slope * output * (one - bent * bent);
            let past = before.map_or(T::zero(), |before| self.cells[(unit, before)]);
            gates[unit] = cell * middle * input * (one - input);
            gates[hidden + unit] = cell * past * forget * (one - forget);
            gates[2 * hidden + unit] = cell * input * (one - middle * middle);
            gates[3 * hidden + unit] = slope * bent * output * (one - output);
            *carried = cell * forget;
        }
    }
}

impl<T: Real> Net<T> for Recurrent<T> {
    fn weights(&mut self) -> Vec<&mut Weight<T>> {
        vec![
            &mut self.weight_input,
            &mut self.weight_hidden,
            &mut self.bias,
            &mut self.output.weight,
            &mut self.output.bias,
        ]
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::differences;
    use super::*;

    /// Returns two sequences with two inputs and three outputs.
    fn sequences(rng: &mut ChaCha8Rng) -> Vec<Sequence<f64>> {
        [9, 8]
            .map(|len| {
                let mut draw = |count| (0..count).map(|_| rng.random_range(-1.0..1.0)).collect();
                let (inputs, outputs) = (draw(2 * len), draw(3 * len));
                Sequence {
                    inputs,
                    outputs,
                    len,
                }
            })
            .into()
    }

    /// Checks every gradient, through one sample and through several, with the same units dropped each time.
    #[test]
    fn its_gradients_are_the_differences_of_its_loss() {
        for (length, dropout) in [(1, 0.0), (6, 0.0), (6, 0.3)] {
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let sequences = sequences(&mut rng);
            let batch = [(1, 2), (0, 0), (0, 3)];
            let mut net = Recurrent::<f64>::start([2, 7, 3], length, dropout, &mut rng);
            let loss = |net: &mut Recurrent<f64>| {
                net.learn(&sequences, &batch, &mut rng.clone());
                let mut squares = Vec::new();
                for (row, outputs) in net.outputs().row_iter().enumerate() {
                    let (index, at) = batch[row % 3];
                    let wanted = &sequences[index].outputs[(at + row / 3) * 3..];
                    let pairs = outputs.iter().zip(wanted);
                    squares.extend(pairs.map(|(y, wanted)| (y - wanted).powi(2)));
                }
                assert_eq!(squares.len(), 3 * 3 * length);
                squares.iter().sum::<f64>() / squares.len() as f64
            };
            differences::check(&mut net, loss);
        }
    }
}
