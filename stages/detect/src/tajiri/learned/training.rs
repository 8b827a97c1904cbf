//! The training loop that the nets share.

use candle_core::{Device, Tensor, Var};
use candle_nn::{AdamW, Optimizer, ParamsAdamW};
use rand::Rng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::TrainingSettings;

/// Goes through the training data `settings.epochs` times, in a new order and in batches, one Adam step
/// a batch. `examples` lists what an epoch consists of, `loss` is that of a batch of them.
///
/// # Errors
/// What candle says.
pub(crate) fn fit<E>(
    settings: &TrainingSettings,
    weights: Vec<Var>,
    rng: &mut ChaCha8Rng,
    examples: &dyn Fn(&mut ChaCha8Rng) -> Vec<E>,
    loss: &dyn Fn(&[E], &mut ChaCha8Rng) -> candle_core::Result<Tensor>,
) -> candle_core::Result<()> {
    let parameters = ParamsAdamW {
        lr: settings.learning_rate,
        // Without decay of the weights it is Adam.
        weight_decay: 0.0,
        ..ParamsAdamW::default()
    };
    let mut adam = AdamW::new(weights, parameters)?;
    for _ in 0..settings.epochs {
        let mut examples = examples(rng);
        examples.shuffle(rng);
        for batch in examples.chunks(settings.batch) {
            adam.backward_step(&loss(batch, rng)?)?;
        }
    }
    Ok(())
}

/// Weights drawn evenly from ±1/√`fan_in`, `PyTorch`'s start for dense and recurrent layers.
///
/// # Errors
/// What candle says.
pub(crate) fn start(
    shape: &[usize],
    fan_in: usize,
    rng: &mut ChaCha8Rng,
) -> candle_core::Result<Var> {
    let bound = 1.0 / (fan_in as f32).sqrt();
    let count = shape.iter().product();
    let values = (0..count).map(|_| rng.random_range(-bound..bound));
    Var::from_vec(values.collect::<Vec<f32>>(), shape, &Device::Cpu)
}

/// Leaves out a share `dropout` of the units and makes up for it in the others.
///
/// # Errors
/// What candle says.
pub(crate) fn drop_out(
    units: Tensor,
    dropout: f64,
    rng: &mut ChaCha8Rng,
) -> candle_core::Result<Tensor> {
    if dropout == 0.0 {
        return Ok(units);
    }
    let kept = (1.0 / (1.0 - dropout)) as f32;
    let mask = (0..units.elem_count())
        .map(|_| if rng.random_bool(dropout) { 0.0 } else { kept })
        .collect::<Vec<f32>>();
    &units * Tensor::from_vec(mask, units.shape(), &Device::Cpu)?
}

/// The numbers of a weight.
///
/// # Errors
/// What candle says.
pub(crate) fn numbers(weight: &Var) -> candle_core::Result<Vec<f32>> {
    weight.flatten_all()?.to_vec1()
}
