//! Training of the networks: batches in a new order in every epoch, gradients by backpropagation
//! (Goodfellow, Bengio and Courville, Deep Learning, 2016, sections 6.5 and 10.2), one Adam step per batch.
//!
//! The matrices of a batch are reused for the next one of the same size. The arithmetic is generic so that tests can
//! compare the gradients with finite differences in 64-bit arithmetic; networks are trained in 32 bits.
//!
//! Transposed matrices are copied, not viewed: `gemm` of nalgebra 0.34.2 reads and writes out of bounds of
//! small matrices with non-contiguous rows (its `axcpy` confuses the slice's length with the vector's).

mod adam;
mod dense;
mod dense_net;
#[cfg(test)]
mod differences;
mod recurrent;

use nalgebra::RealField;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::TrainingSettings;
use adam::{Adam, Weight};

pub(crate) use dense_net::DenseNet;
pub(crate) use recurrent::{Recurrent, Sequence};

/// The number type of a network.
pub(crate) trait Real: RealField + Copy {}

impl Real for f32 {}
impl Real for f64 {}

/// A network in training.
pub(crate) trait Net<T> {
    /// Returns all learned weights, always in the same order.
    fn weights(&mut self) -> Vec<&mut Weight<T>>;
}

/// Trains for `settings.epochs` passes over the data, each in a new order and in batches, with one Adam step per
/// batch. `examples` lists the examples of an epoch; `learn` sets the gradients of the loss of a batch of them.
pub(crate) fn fit<T: Real, E, N: Net<T>>(
    settings: &TrainingSettings,
    net: &mut N,
    rng: &mut ChaCha8Rng,
    examples: &dyn Fn(&mut ChaCha8Rng) -> Vec<E>,
    learn: &dyn Fn(&mut N, &[E], &mut ChaCha8Rng),
) {
    let mut adam = Adam::new(settings.learning_rate);
    for _ in 0..settings.epochs {
        let mut examples = examples(rng);
        examples.shuffle(rng);
        for batch in examples.chunks(settings.batch) {
            learn(net, batch, rng);
            adam.step(net.weights());
        }
    }
}

/// Returns the factor of one unit in training: a share `dropout` of the units is dropped, the others are scaled to
/// compensate (Srivastava et al., Dropout, 2014, section 10). Draws no random number without dropout.
fn drop_out<T: Real>(dropout: f64, rng: &mut ChaCha8Rng) -> T {
    if dropout == 0.0 {
        T::one()
    } else if rng.random_bool(dropout) {
        T::zero()
    } else {
        number(1.0 / (1.0 - dropout))
    }
}

/// Converts to the network's number type.
fn number<T: Real>(number: f64) -> T {
    nalgebra::convert(number)
}

/// Returns the sum of the numbers, from eight partial sums that the compiler can vectorise.
fn sum<T: Real>(numbers: &[T]) -> T {
    let mut parts = [T::zero(); 8];
    let chunks = numbers.chunks_exact(parts.len());
    let rest = chunks.remainder().iter().fold(T::zero(), |sum, &x| sum + x);
    for chunk in chunks {
        for (part, &x) in parts.iter_mut().zip(chunk) {
            *part += x;
        }
    }
    parts.into_iter().fold(rest, |sum, part| sum + part)
}
