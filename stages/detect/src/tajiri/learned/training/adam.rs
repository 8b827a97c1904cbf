//! Adam (Kingma and Ba, Adam: A Method for Stochastic Optimization, 2015).

use nalgebra::DMatrix;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::{Real, number};

/// β₁, decay rate of the mean of the gradients, as the paper suggests.
const MEAN_DECAY: f64 = 0.9;
/// β₂, decay rate of the mean of their squares.
const SQUARE_DECAY: f64 = 0.999;
/// ε, which bounds the step.
const FLOOR: f64 = 1e-8;

/// A learned matrix.
pub(crate) struct Weight<T> {
    /// Current value.
    pub value: DMatrix<T>,
    /// Gradient of the loss by `value`, of the same shape.
    pub gradient: DMatrix<T>,
    /// The paper's m and v.
    moments: [DMatrix<T>; 2],
}

impl<T: Real> Weight<T> {
    /// Draws a matrix uniformly from ±1/√`fan_in`, column by column: `PyTorch`'s initialisation of dense and
    /// recurrent layers.
    pub fn start(rows: usize, columns: usize, fan_in: usize, rng: &mut ChaCha8Rng) -> Self {
        let bound = 1.0 / (fan_in as f32).sqrt();
        let mut draw = || number(f64::from(rng.random_range(-bound..bound)));
        let zeros = DMatrix::zeros(rows, columns);
        Self {
            value: DMatrix::from_fn(rows, columns, |_, _| draw()),
            gradient: zeros.clone(),
            moments: [zeros.clone(), zeros],
        }
    }
}

/// The optimizer's state, except for the moments, which are stored with the weights.
pub(crate) struct Adam {
    step_size: f64,
    steps: i32,
}

impl Adam {
    /// Creates the optimizer; `step_size` is the paper's α.
    pub fn new(step_size: f64) -> Self {
        Self {
            step_size,
            steps: 0,
        }
    }

    /// Takes one step of gradient descent (algorithm 1).
    pub fn step<T: Real>(&mut self, weights: Vec<&mut Weight<T>>) {
        self.steps += 1;
        let unbiased = |decay: f64| number::<T>(1.0 / (1.0 - decay.powi(self.steps)));
        let scales = [unbiased(MEAN_DECAY), unbiased(SQUARE_DECAY)];
        let decays = [MEAN_DECAY, SQUARE_DECAY].map(number::<T>);
        let gains = [1.0 - MEAN_DECAY, 1.0 - SQUARE_DECAY].map(number::<T>);
        let (floor, step_size) = (number::<T>(FLOOR), number::<T>(self.step_size));
        for weight in weights {
            let [means, squares] = &mut weight.moments;
            let moments = means.iter_mut().zip(squares.iter_mut());
            let values = weight.value.iter_mut().zip(weight.gradient.iter());
            for ((value, &gradient), (mean, square)) in values.zip(moments) {
                *mean = *mean * decays[0] + gradient * gains[0];
                *square = *square * decays[1] + gradient * gradient * gains[1];
                *value -= *mean * scales[0] / ((*square * scales[1]).sqrt() + floor) * step_size;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// Evaluates algorithm 1 line by line for one number.
    #[test]
    fn three_steps_are_those_of_the_papers_algorithm() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut weight = Weight::<f64>::start(1, 1, 1, &mut rng);
        weight.value[0] = 0.5;
        let mut adam = Adam::new(0.1);
        let (mut theta, mut m, mut v) = (0.5, 0.0, 0.0);
        for (t, gradient) in [2.0, -1.0, 0.25].into_iter().enumerate() {
            weight.gradient[0] = gradient;
            adam.step(vec![&mut weight]);
            m = 0.9 * m + (1.0 - 0.9) * gradient;
            v = 0.999 * v + (1.0 - 0.999) * gradient * gradient;
            let m_hat = m / (1.0 - 0.9_f64.powi(t as i32 + 1));
            let v_hat: f64 = v / (1.0 - 0.999_f64.powi(t as i32 + 1));
            theta -= 0.1 * m_hat / (v_hat.sqrt() + 1e-8);
            assert!((weight.value[0] - theta).abs() < 1e-14, "step {}", t + 1);
        }
    }

    /// Checks section 2.1: the first step has the size α for any scale of the gradient.
    #[test]
    fn the_first_step_has_the_step_size_whatever_the_scale_of_the_gradient() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for gradient in [1e-3f32, -1.0, 1e3] {
            let mut weight = Weight::<f32>::start(1, 1, 1, &mut rng);
            let before = weight.value[0];
            weight.gradient[0] = gradient;
            Adam::new(0.01).step(vec![&mut weight]);
            let step = before - weight.value[0];
            assert!((step - 0.01 * gradient.signum()).abs() < 1e-6, "{step}");
        }
    }
}
