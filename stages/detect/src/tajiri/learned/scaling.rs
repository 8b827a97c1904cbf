//! Equation 8 of Tajiri and Iwamoto: scales every dimension of the input to 0..1 over the training data.

use crate::frame::{Trained, TrainedError};

/// The scaling x ↦ (x - min) / (max - min), by dimension. A dimension that was constant in training becomes 0.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scaling {
    min: Vec<f64>,
    max: Vec<f64>,
}

impl Scaling {
    /// Returns the scaling to 0..1 of rows of `dimensions` numbers each.
    pub fn fit<'a>(dimensions: usize, rows: impl Iterator<Item = &'a [f64]>) -> Self {
        let mut min = vec![f64::INFINITY; dimensions];
        let mut max = vec![f64::NEG_INFINITY; dimensions];
        for row in rows {
            for ((min, max), &value) in min.iter_mut().zip(&mut max).zip(row) {
                *min = min.min(value);
                *max = max.max(value);
            }
        }
        Self { min, max }
    }

    /// Scales a row in place.
    pub fn apply(&self, row: &mut [f64]) {
        for ((value, min), max) in row.iter_mut().zip(&self.min).zip(&self.max) {
            let range = max - min;
            *value = if range > 0.0 {
                (*value - min) / range
            } else {
                0.0
            };
        }
    }

    /// Inverts the scaling of `value` in `dimension`.
    pub fn undo(&self, dimension: usize, value: f64) -> f64 {
        let (min, max) = (self.min[dimension], self.max[dimension]);
        min + value * (max - min)
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.min.len()
    }

    /// Saves the scaling under the names `<name>.min` and `<name>.max`.
    pub fn save(&self, name: &str, into: &mut Trained) {
        let shape = [self.min.len()];
        into.put_f64(&format!("{name}.min"), &shape, &self.min);
        into.put_f64(&format!("{name}.max"), &shape, &self.max);
    }

    /// Loads a scaling that [`Scaling::save`] saved.
    ///
    /// # Errors
    /// If it is missing or has another size.
    pub fn load(name: &str, dimensions: usize, from: &Trained) -> Result<Self, TrainedError> {
        Ok(Self {
            min: from.get_f64(&format!("{name}.min"), &[dimensions])?,
            max: from.get_f64(&format!("{name}.max"), &[dimensions])?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn training_data_fills_zero_to_one_and_new_data_may_leave_it() {
        let rows = [vec![1.0, 5.0, -2.0], vec![3.0, 5.0, 2.0]];
        let scaling = Scaling::fit(3, rows.iter().map(Vec::as_slice));
        let mut row = vec![2.0, 5.0, 4.0];
        scaling.apply(&mut row);
        assert_eq!(row, [0.5, 0.0, 1.5]);
    }
}
