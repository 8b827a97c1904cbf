//! A sequence of dense layers, with `ReLU` and dropout after each hidden layer, trained to reconstruct its
//! input.

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;

use super::adam::Weight;
use super::dense::Dense;
use super::{Net, Real, drop_out, number};

/// The layers in training.
pub(crate) struct DenseNet<T> {
    layers: Vec<Dense<T>>,
    dropout: f64,
    room: Room<T>,
}

/// Intermediate results for a batch; a row is an example.
struct Room<T> {
    /// The input, then the output of each layer.
    units: Vec<DMatrix<T>>,
    /// Derivative of each hidden unit by its sum: 0 for negative sums and dropped units.
    slopes: Vec<DMatrix<T>>,
    /// Gradient of the loss by the sums of each layer.
    gradients: Vec<DMatrix<T>>,
    /// Input of each layer, transposed: a column is an example.
    turned: Vec<DMatrix<T>>,
}

impl<T: Real> Room<T> {
    fn new(batch: usize, layers: &[Dense<T>]) -> Self {
        let zeros = |units| DMatrix::zeros(batch, units);
        let outputs = || layers.iter().map(|layer| layer.bias.value.len());
        let inputs = || layers.iter().map(|layer| layer.weight.value.nrows());
        Self {
            units: inputs().take(1).chain(outputs()).map(zeros).collect(),
            slopes: outputs().take(layers.len() - 1).map(zeros).collect(),
            gradients: outputs().map(zeros).collect(),
            turned: inputs().map(|units| DMatrix::zeros(units, batch)).collect(),
        }
    }

    fn batch(&self) -> usize {
        self.units[0].nrows()
    }
}

impl<T: Real> DenseNet<T> {
    /// Creates untrained layers between neighbours of `sizes`. `sizes` has at least two elements.
    pub fn start(sizes: &[usize], dropout: f64, rng: &mut ChaCha8Rng) -> Self {
        let layers: Vec<_> = (sizes.windows(2))
            .map(|pair| Dense::start(pair[0], pair[1], rng))
            .collect();
        Self {
            room: Room::new(0, &layers),
            layers,
            dropout,
        }
    }

    /// Returns weight and bias of each layer; the weight has one row per output.
    pub fn numbers(&self) -> impl Iterator<Item = [&[T]; 2]> {
        (self.layers.iter()).map(|layer| [&layer.weight, &layer.bias].map(|w| w.value.as_slice()))
    }

    /// Sets the gradients of the mean squared difference of output and input, over the batch of these `rows`.
    pub fn learn(&mut self, rows: &[T], batch: &[usize], rng: &mut ChaCha8Rng) {
        if self.room.batch() != batch.len() {
            self.room = Room::new(batch.len(), &self.layers);
        }
        let input = &mut self.room.units[0];
        let size = input.ncols();
        for (mut units, &row) in input.row_iter_mut().zip(batch) {
            let row = rows[row * size..][..size].iter();
            units.iter_mut().zip(row).for_each(|(unit, &x)| *unit = x);
        }
        self.forward(rng);
        self.backward();
    }

    fn forward(&mut self, rng: &mut ChaCha8Rng) {
        let room = &mut self.room;
        for (index, layer) in self.layers.iter().enumerate() {
            let (before, after) = room.units.split_at_mut(index + 1);
            let units = &mut after[0];
            layer.forward(&before[index], units);
            let Some(slopes) = room.slopes.get_mut(index) else {
                continue;
            };
            // The random numbers are drawn example by example.
            for row in 0..slopes.nrows() {
                for unit in 0..slopes.ncols() {
                    slopes[(row, unit)] = drop_out(self.dropout, rng);
                }
            }
            for (unit, slope) in units.iter_mut().zip(slopes.iter_mut()) {
                if *unit < T::zero() {
                    *slope = T::zero();
                }
                *unit *= *slope;
            }
        }
    }

    /// Backpropagation (Goodfellow et al., algorithm 6.4).
    fn backward(&mut self) {
        let Room {
            units,
            slopes,
            gradients,
            turned,
        } = &mut self.room;
        let last = self.layers.len() - 1;
        let slope: T = number(2.0 / units[0].len() as f64);
        let ends = units[last + 1].iter().zip(units[0].iter());
        for (gradient, (&output, &input)) in gradients[last].iter_mut().zip(ends) {
            *gradient = (output - input) * slope;
        }
        for index in (0..=last).rev() {
            let layer = &mut self.layers[index];
            let (before, after) = gradients.split_at_mut(index);
            let input = &units[index];
            layer.learn(input, &mut turned[index], &after[0]);
            let Some(gradient) = before.last_mut() else {
                continue;
            };
            layer.back(&after[0], gradient);
            gradient.component_mul_assign(&slopes[index - 1]);
        }
    }

    /// Returns the output for the last batch; a row is an example.
    #[cfg(test)]
    pub fn output(&self) -> &DMatrix<T> {
        &self.room.units[self.layers.len()]
    }
}

impl<T: Real> Net<T> for DenseNet<T> {
    fn weights(&mut self) -> Vec<&mut Weight<T>> {
        let layers = self.layers.iter_mut();
        layers
            .flat_map(|layer| [&mut layer.weight, &mut layer.bias])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};

    use super::super::differences;
    use super::*;

    /// Checks every gradient, with the same units dropped each time.
    #[test]
    fn its_gradients_are_the_differences_of_its_loss() {
        for (dropout, batch) in [(0.0, vec![0, 3, 1]), (0.3, vec![2, 0, 1, 3, 4, 4, 5, 6])] {
            let mut rng = ChaCha8Rng::seed_from_u64(7);
            let rows: Vec<f64> = (0..7 * 8).map(|_| rng.random_range(-1.0..1.0)).collect();
            let mut net = DenseNet::<f64>::start(&[8, 6, 3, 7, 8], dropout, &mut rng);
            let loss = |net: &mut DenseNet<f64>| {
                net.learn(&rows, &batch, &mut rng.clone());
                let inputs = batch.iter().map(|&row| &rows[row * 8..][..8]);
                let errors = (net.output().row_iter().zip(inputs))
                    .flat_map(|(output, input)| {
                        let pairs = output.iter().copied().zip(input).collect::<Vec<_>>();
                        pairs.into_iter().map(|(y, x)| (y - x).powi(2))
                    })
                    .collect::<Vec<_>>();
                errors.iter().sum::<f64>() / errors.len() as f64
            };
            differences::check(&mut net, loss);
        }
    }
}
