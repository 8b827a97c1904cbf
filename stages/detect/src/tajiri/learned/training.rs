//! How the nets are trained: batches in a new order in every epoch, gradients by backpropagation
//! (Goodfellow, Bengio and Courville, Deep Learning, 2016, sections 6.5 and 10.2), a step of Adam a batch.
//!
//! The matrices of a batch serve the next one, too, if it has the same size. The arithmetic is generic so that
//! tests hold the gradients against differences of 64-bit numbers; nets train with 32 bits.
//!
//! Matrices that must be turned over are copied, not viewed: `gemm` of nalgebra 0.34.2 reads and writes beyond
//! small matrices whose rows are apart in memory (its `axcpy` takes the slice's length for the vector's).

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

/// The numbers of a net.
pub(crate) trait Real: RealField + Copy {}

impl Real for f32 {}
impl Real for f64 {}

/// What is trained.
pub(crate) trait Net<T> {
    /// All that is learned, always in the same order.
    fn weights(&mut self) -> Vec<&mut Weight<T>>;
}

/// Goes through the training data `settings.epochs` times, in a new order and in batches, one Adam step
/// a batch. `examples` lists what an epoch consists of; `learn` sets the gradients of the loss of a batch of them.
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

/// The factor of one unit in training: a share `dropout` of the units is left out, the others make up for it
/// (Srivastava et al., Dropout, 2014, section 10, scaled in training). Draws nothing without dropout.
fn drop_out<T: Real>(dropout: f64, rng: &mut ChaCha8Rng) -> T {
    if dropout == 0.0 {
        T::one()
    } else if rng.random_bool(dropout) {
        T::zero()
    } else {
        number(1.0 / (1.0 - dropout))
    }
}

/// As a net's number.
fn number<T: Real>(number: f64) -> T {
    nalgebra::convert(number)
}

/// Their sum, in eight parts that a processor adds at once.
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
