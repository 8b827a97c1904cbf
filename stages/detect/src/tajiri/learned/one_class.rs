//! The one-class support vector machine (Schölkopf et al. 2001) with the kernel
//! k(x, y) = exp(-γ |x - y|²), trained by libsvm-rs, which uses the solver of LIBSVM and scikit-learn.

use libsvm_rs::train::svm_train;
use libsvm_rs::{KernelType, SvmNode, SvmParameter, SvmProblem, SvmType};

use super::demand;
use super::runner::{Course, Scorer};
use super::vectors::{VectorModel, VectorScorer, Vectors};
use crate::frame::{LearnError, SignalSettings, Task, Trained, TrainedError};

/// Cache for kernel values in training \[MB\].
/// Resolution: changes the computing time and the memory of the training, not its result.
const CACHE_MB: f64 = 400.0;
/// Tolerance of the optimum, as in LIBSVM and scikit-learn.
/// Tuned: by the authors of LIBSVM.
const TOLERANCE: f64 = 1e-3;

/// A trained one-class machine.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OneClass {
    dimensions: usize,
    gamma: f64,
    rho: f64,
    /// One weight per support vector.
    alpha: Vec<f64>,
    /// The support vectors, concatenated.
    vectors: Vec<f64>,
}

impl OneClass {
    /// Trains on `rows` of `dimensions` scaled numbers each. ν bounds the share of training data outside the
    /// boundary. γ = 1 / (dimensions · variance), scikit-learn's `scale`, because the paper does not state it.
    pub fn fit(rows: &[f64], dimensions: usize, nu: f64) -> Self {
        let count = rows.len() as f64;
        let mean = rows.iter().sum::<f64>() / count;
        let variance = rows.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        let gamma = if variance > 0.0 {
            1.0 / (dimensions as f64 * variance)
        } else {
            1.0
        };
        let instances: Vec<Vec<SvmNode>> = (rows.chunks_exact(dimensions))
            .map(|row| {
                let nodes = (1..).zip(row);
                nodes
                    .map(|(index, &value)| SvmNode { index, value })
                    .collect()
            })
            .collect();
        let problem = SvmProblem {
            labels: vec![1.0; instances.len()],
            instances,
        };
        let parameter = SvmParameter {
            svm_type: SvmType::OneClass,
            kernel_type: KernelType::Rbf,
            gamma,
            nu,
            eps: TOLERANCE,
            cache_size: CACHE_MB,
            ..SvmParameter::default()
        };
        libsvm_rs::set_quiet(true);
        let model = svm_train(&problem, &parameter);
        Self {
            dimensions,
            gamma,
            rho: model.rho[0],
            alpha: model.sv_coef[0].clone(),
            vectors: (model.sv.iter().flatten()).map(|node| node.value).collect(),
        }
    }

    /// Trains the detector `name` on windows of `window` samples, one every `stride` samples; the training is
    /// deterministic.
    ///
    /// # Errors
    /// If a setting is out of range, there is no robot's model, or too little data.
    pub fn train(
        name: &'static str,
        signals: &SignalSettings,
        [window, stride]: [usize; 2],
        nu: f64,
        task: &Task<'_>,
    ) -> Result<Trained, LearnError> {
        let share = nu > 0.0 && nu <= 1.0;
        demand(name, share, "`nu` must be above 0 and at most 1")?;
        demand(name, stride > 0, "`stride` must be at least 1")?;
        let course = Course::new(name, signals, window, task)?;
        let vectors = Vectors::new(&course, window, stride);
        let machine = Self::fit(vectors.rows(), vectors.dimensions(), nu);
        course.end(|trained| vectors.save(&machine, trained), Self::scorer)
    }

    /// Returns the scorer of a trained detector.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn scorer(trained: &Trained) -> Result<Box<dyn Scorer>, TrainedError> {
        Ok(Box::new(VectorScorer::load(trained, Self::load)?))
    }

    /// Returns ρ, the upper bound of the score.
    pub fn largest_score(trained: &Trained) -> Option<f64> {
        Some(trained.get_f64("svm.rho", &[1]).ok()?[0])
    }

    /// Loads a machine that [`VectorModel::save`] saved.
    ///
    /// # Errors
    /// If an array is missing or has another shape.
    pub fn load(dimensions: usize, from: &Trained) -> Result<Self, TrainedError> {
        let count = from.shape("svm.alpha").first().copied().unwrap_or(0);
        Ok(Self {
            dimensions,
            gamma: from.get_f64("svm.gamma", &[1])?[0],
            rho: from.get_f64("svm.rho", &[1])?[0],
            alpha: from.get_f64("svm.alpha", &[count])?,
            vectors: from.get_f64("svm.vectors", &[count, dimensions])?,
        })
    }
}

impl VectorModel for OneClass {
    /// Returns `ρ - Σ α_i k(x_i, x)`: positive outside the boundary.
    fn score(&mut self, x: &[f64]) -> f64 {
        let vectors = self.vectors.chunks_exact(self.dimensions);
        let inside: f64 = (self.alpha.iter().zip(vectors))
            .map(|(alpha, vector)| {
                let distance: f64 = x.iter().zip(vector).map(|(x, v)| (x - v).powi(2)).sum();
                alpha * (-self.gamma * distance).exp()
            })
            .sum();
        self.rho - inside
    }

    fn save(&self, into: &mut Trained) {
        let count = self.alpha.len();
        into.put_f64("svm.gamma", &[1], &[self.gamma]);
        into.put_f64("svm.rho", &[1], &[self.rho]);
        into.put_f64("svm.alpha", &[count], &self.alpha);
        into.put_f64("svm.vectors", &[count, self.dimensions], &self.vectors);
    }
}

#[cfg(test)]
mod tests {
    use libsvm_rs::predict::predict_values;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// 400 points in the plane, densest about (0.5, 0.5).
    fn cloud() -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut even = || rng.random_range(0.0..0.25);
        (0..800)
            .map(|_| even() + even() + even() + even())
            .collect()
    }

    #[test]
    fn an_outlier_is_outside_and_nu_of_the_training_data_with_it() {
        let rows = cloud();
        let mut machine = OneClass::fit(&rows, 2, 0.1);
        let outside = (rows.chunks_exact(2))
            .filter(|row| machine.score(row) > 0.0)
            .count();
        assert!((30..=50).contains(&outside), "{outside} of 400");
        assert!(machine.score(&[0.5, 0.5]) < 0.0);
        assert!(machine.score(&[1.6, 0.5]) > 0.0);
        assert!(machine.score(&[1.6, 0.5]) > machine.score(&[1.1, 0.5]));
    }

    #[test]
    fn the_score_is_the_librarys_decision_function() {
        let rows = cloud();
        let mut machine = OneClass::fit(&rows, 2, 0.1);
        let nodes = |row: &[f64]| -> Vec<SvmNode> {
            (1..)
                .zip(row)
                .map(|(index, &value)| SvmNode { index, value })
                .collect()
        };
        let problem = SvmProblem {
            labels: vec![1.0; 400],
            instances: rows.chunks_exact(2).map(nodes).collect(),
        };
        let parameter = SvmParameter {
            svm_type: SvmType::OneClass,
            gamma: machine.gamma,
            nu: 0.1,
            ..SvmParameter::default()
        };
        let model = svm_train(&problem, &parameter);
        for x in [[0.2, 0.7], [1.3, -0.4]] {
            let mut decision = [0.0];
            predict_values(&model, &nodes(&x), &mut decision);
            assert!((machine.score(&x) + decision[0]).abs() < 1e-9);
        }
    }
}
