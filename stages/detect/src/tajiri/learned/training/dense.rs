//! The dense layer, y = x W + b, for a whole batch: a row of x and y is an example.

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;

use super::adam::Weight;
use super::{Real, sum};

/// A dense layer in training.
pub(crate) struct Dense<T> {
    /// W, `[inputs, outputs]`.
    pub weight: Weight<T>,
    /// b, `[1, outputs]`.
    pub bias: Weight<T>,
    /// Wᵀ.
    turned: DMatrix<T>,
}

impl<T: Real> Dense<T> {
    /// Creates an untrained layer.
    pub fn start(inputs: usize, outputs: usize, rng: &mut ChaCha8Rng) -> Self {
        Self {
            weight: Weight::start(inputs, outputs, inputs, rng),
            bias: Weight::start(1, outputs, inputs, rng),
            turned: DMatrix::zeros(outputs, inputs),
        }
    }

    /// Computes y from x.
    pub fn forward(&self, x: &DMatrix<T>, y: &mut DMatrix<T>) {
        for (mut column, &bias) in y.column_iter_mut().zip(self.bias.value.iter()) {
            column.fill(bias);
        }
        y.gemm(T::one(), x, &self.weight.value, T::one());
    }

    /// Computes the gradients of W and b from that of the loss by y (Goodfellow et al., algorithm 6.4):
    /// ∂L/∂W = xᵀ ∂L/∂y; ∂L/∂b is the sum of ∂L/∂y over the batch. `turned` has the shape of xᵀ.
    pub fn learn(&mut self, x: &DMatrix<T>, turned: &mut DMatrix<T>, y_gradient: &DMatrix<T>) {
        let gradient = &mut self.weight.gradient;
        if x.ncols().min(y_gradient.ncols()) < 8 {
            // Dot products of columns are faster for small matrices.
            gradient.gemm_tr(T::one(), x, y_gradient, T::zero());
        } else {
            x.transpose_to(turned);
            gradient.gemm(T::one(), turned, y_gradient, T::zero());
        }
        let columns = y_gradient.as_slice().chunks_exact(y_gradient.nrows());
        for (bias, column) in self.bias.gradient.iter_mut().zip(columns) {
            *bias = sum(column);
        }
    }

    /// Computes the gradient of the loss by x: ∂L/∂x = ∂L/∂y Wᵀ.
    pub fn back(&mut self, y_gradient: &DMatrix<T>, x_gradient: &mut DMatrix<T>) {
        self.weight.value.transpose_to(&mut self.turned);
        x_gradient.gemm(T::one(), y_gradient, &self.turned, T::zero());
    }
}
