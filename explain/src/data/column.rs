//! Columns of a regression: how the effort changes with one coordinate, at the rows that are compared.

use std::sync::Arc;

/// A signal that is zero but for one joint, or not.
#[derive(Debug, Clone)]
pub struct Column {
    /// The joint that `values` belong to; `None` if they are of all joints.
    pub joint: Option<usize>,
    /// Rows of the joint, or of all joints one after the other.
    pub values: Vec<f64>,
}

impl Column {
    /// The rows of a joint, `None` if they are zero.
    pub fn of_joint(&self, joint: usize, rows: usize) -> Option<&[f64]> {
        match self.joint {
            Some(own) => (own == joint).then_some(&self.values[..]),
            None => Some(&self.values[joint * rows..(joint + 1) * rows]),
        }
    }

    /// The column times a factor.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            joint: self.joint,
            values: self.values.iter().map(|x| factor * x).collect(),
        }
    }
}

/// The columns of a hypothesis at some shape.
#[derive(Debug)]
pub struct Columns {
    /// What its shape alone does, `None` if nothing.
    pub alone: Option<Column>,
    /// What each of its factors adds per unit.
    pub factors: Vec<Arc<Column>>,
}
