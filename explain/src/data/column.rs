//! Columns of a regression: the derivative of the effort with respect to one coordinate, at the compared rows.

use std::sync::Arc;

/// A signal of one joint, zero at all others, or of all joints.
#[derive(Debug, Clone)]
pub struct Column {
    /// The joint of `values`; `None` if they cover all joints.
    pub joint: Option<usize>,
    /// Rows of the joint, or of all joints in succession.
    pub values: Vec<f64>,
}

impl Column {
    /// Returns the rows of a joint, `None` if they are zero.
    pub fn of_joint(&self, joint: usize, rows: usize) -> Option<&[f64]> {
        match self.joint {
            Some(own) => (own == joint).then_some(&self.values[..]),
            None => Some(&self.values[joint * rows..(joint + 1) * rows]),
        }
    }

    /// Returns the column multiplied by a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            joint: self.joint,
            values: self.values.iter().map(|x| factor * x).collect(),
        }
    }
}

/// The columns of a hypothesis at given nonlinear parameters.
#[derive(Debug)]
pub struct Columns {
    /// Effort at the nonlinear parameters with all linear coefficients at zero; `None` if it is zero.
    pub alone: Option<Column>,
    /// Effort per unit of each linear coefficient.
    pub factors: Vec<Arc<Column>>,
}
