//! The autoencoder: dense layers with a bottleneck, `ReLU` after each hidden layer, a linear output. It
//! learns to reconstruct its input; an input with a large reconstruction error is unlike its training data.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::runner::{Course, Scorer};
use super::training::{DenseNet, fit};
use super::vectors::{VectorModel, VectorScorer, Vectors};
use super::{TrainingSettings, demand};
use crate::frame::{LearnError, SignalSettings, Task, Trained, TrainedError};

/// A trained autoencoder.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Autoencoder {
    layers: Vec<Dense>,
    /// Units of the current layer and of the previous one.
    units: [Vec<f32>; 2],
}

/// y = W x + b.
#[derive(Debug, Clone, PartialEq)]
struct Dense {
    inputs: usize,
    /// Weights W, one row per output.
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Autoencoder {
    /// Trains the detector `name` on windows of `window` samples, one every `stride` samples, with hidden layers of
    /// `layers` units.
    ///
    /// # Errors
    /// If a setting is out of range, there is no robot's model, too little data, or the training diverges.
    pub fn train(
        name: &'static str,
        signals: &SignalSettings,
        [window, stride]: [usize; 2],
        (layers, training): (&[usize], &TrainingSettings),
        task: &Task<'_>,
    ) -> Result<Trained, LearnError> {
        demand(name, stride > 0, "`stride` must be at least 1")?;
        let units = !layers.contains(&0);
        demand(name, units, "every one of `layers` must be at least 1")?;
        training.check(name)?;
        let course = Course::new(name, signals, window, task)?;
        let vectors = Vectors::new(&course, window, stride);
        let mut rng = ChaCha8Rng::seed_from_u64(task.seed);
        let net = Self::fit(&vectors, layers, training, &mut rng);
        course.end(|trained| vectors.save(&net, trained), Self::scorer)
    }

    /// Returns the scorer of a trained detector.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn scorer(trained: &Trained) -> Result<Box<dyn Scorer>, TrainedError> {
        Ok(Box::new(VectorScorer::load(trained, Self::load)?))
    }

    /// Trains with hidden layers of `middle` units.
    pub fn fit(
        vectors: &Vectors,
        middle: &[usize],
        settings: &TrainingSettings,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let dimensions = vectors.dimensions();
        let sizes = sizes(dimensions, middle);
        let mut net = DenseNet::start(&sizes, settings.dropout, rng);
        let rows: Vec<f32> = vectors.rows().iter().map(|&x| x as f32).collect();
        let count = rows.len() / dimensions;
        let examples = |_: &mut ChaCha8Rng| (0..count).collect();
        let learn = |net: &mut DenseNet<f32>, batch: &[usize], rng: &mut ChaCha8Rng| {
            net.learn(&rows, batch, rng);
        };
        fit(settings, &mut net, rng, &examples, &learn);
        Self::of(&net)
    }

    /// Returns the autoencoder with the trained weights.
    fn of(net: &DenseNet<f32>) -> Self {
        let layers = net.numbers().map(|[weight, bias]| Dense {
            inputs: weight.len() / bias.len(),
            weight: weight.to_vec(),
            bias: bias.to_vec(),
        });
        Self::new(layers.collect())
    }

    fn new(layers: Vec<Dense>) -> Self {
        Self {
            layers,
            units: [Vec::new(), Vec::new()],
        }
    }

    /// Loads an autoencoder that [`VectorModel::save`] saved.
    ///
    /// # Errors
    /// If an array is missing or has another shape.
    pub fn load(dimensions: usize, from: &Trained) -> Result<Self, TrainedError> {
        let middle: Vec<usize> = (1..)
            .map_while(|layer| {
                let above = from.shape(&format!("net.{layer}.bias"));
                (!above.is_empty()).then(|| from.shape(&format!("net.{}.bias", layer - 1)))
            })
            .filter_map(|shape| shape.first().copied())
            .collect();
        let layers = (sizes(dimensions, &middle).windows(2).enumerate())
            .map(|(layer, pair)| {
                Ok(Dense {
                    inputs: pair[0],
                    weight: from.get_f32(&format!("net.{layer}.weight"), &[pair[1], pair[0]])?,
                    bias: from.get_f32(&format!("net.{layer}.bias"), &[pair[1]])?,
                })
            })
            .collect::<Result<_, TrainedError>>()?;
        Ok(Self::new(layers))
    }
}

impl VectorModel for Autoencoder {
    /// Returns the mean squared reconstruction error.
    fn score(&mut self, x: &[f64]) -> f64 {
        let [now, before] = &mut self.units;
        now.clear();
        now.extend(x.iter().map(|&x| x as f32));
        let last = self.layers.len() - 1;
        for (index, layer) in self.layers.iter().enumerate() {
            std::mem::swap(now, before);
            now.clear();
            let rows = layer.weight.chunks_exact(layer.inputs);
            now.extend(rows.zip(&layer.bias).map(|(row, bias)| {
                let sum: f32 = row.iter().zip(&*before).map(|(w, x)| w * x).sum();
                let unit = sum + bias;
                if index == last { unit } else { unit.max(0.0) }
            }));
        }
        let squares = x.iter().zip(now).map(|(x, y)| (x - f64::from(*y)).powi(2));
        squares.sum::<f64>() / x.len() as f64
    }

    fn save(&self, into: &mut Trained) {
        for (index, layer) in self.layers.iter().enumerate() {
            let shape = [layer.bias.len(), layer.inputs];
            into.put_f32(&format!("net.{index}.weight"), &shape, &layer.weight);
            into.put_f32(&format!("net.{index}.bias"), &shape[..1], &layer.bias);
        }
    }
}

/// Returns the layers' sizes from input to output.
fn sizes(dimensions: usize, middle: &[usize]) -> Vec<usize> {
    let ends = std::iter::once(&dimensions);
    ends.clone().chain(middle).chain(ends).copied().collect()
}

#[cfg(test)]
mod tests {
    use rand::Rng;

    use super::*;

    const SETTINGS: TrainingSettings = TrainingSettings {
        epochs: 150,
        batch: 50,
        dropout: 0.0,
        learning_rate: 1e-2,
    };

    /// Points on a curve in three dimensions.
    fn curve() -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        (0..400)
            .flat_map(|_| {
                let t: f64 = rng.random_range(0.0..1.0);
                [t, t * t, 1.0 - t]
            })
            .collect()
    }

    fn trained(seed: u64) -> Autoencoder {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let vectors = Vectors::unscaled(3, curve());
        Autoencoder::fit(&vectors, &[8, 1, 8], &SETTINGS, &mut rng)
    }

    #[test]
    fn it_gives_back_what_it_was_trained_on_and_nothing_beside_it() {
        let mut net = trained(4);
        let rows = curve();
        let error = rows.chunks_exact(3).map(|row| net.score(row)).sum::<f64>() / 400.0;
        assert!(error < 4e-3, "{error}");
        assert!(net.score(&[0.5, 0.25, 0.5]) < 0.01);
        assert!(net.score(&[0.9, 0.1, 0.9]) > 0.05);
    }

    #[test]
    fn the_same_seed_gives_the_same_weights_and_another_seed_others() {
        let net = trained(4);
        assert_eq!(net, trained(4));
        assert_ne!(net, trained(5));
    }

    #[test]
    fn its_loops_compute_what_training_computes() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut training = DenseNet::start(&[3, 8, 1, 8, 3], 0.0, &mut rng);
        let mut net = Autoencoder::of(&training);
        for x in [[0.1f32, 0.9, 0.4], [2.0, -1.0, 0.0]] {
            training.learn(&x, &[0], &mut rng);
            let pairs = training.output().iter().zip(&x);
            let squares = pairs.map(|(y, x)| f64::from(y - x).powi(2));
            let error = squares.sum::<f64>() / 3.0;
            let own = net.score(&x.map(f64::from));
            assert!((own - error).abs() < 1e-5 * (1.0 + error), "{own} {error}");
        }
    }
}
