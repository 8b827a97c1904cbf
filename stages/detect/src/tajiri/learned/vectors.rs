//! Detectors that judge one vector of external torques: those of one sample, or of a window of consecutive
//! samples, oldest first.

use std::collections::VecDeque;

use super::runner::{Course, Scorer};
use super::scaling::Scaling;
use super::signals::Signal;
use crate::frame::{Trained, TrainedError};

/// Measures the dissimilarity of a scaled vector to its training data.
pub(crate) trait VectorModel: Send {
    /// Returns the score; larger means less similar.
    fn score(&mut self, x: &[f64]) -> f64;

    /// Saves its arrays.
    fn save(&self, into: &mut Trained);
}

/// Scaled training vectors.
#[derive(Debug)]
pub(crate) struct Vectors {
    scaling: Scaling,
    rows: Vec<f64>,
}

impl Vectors {
    /// Collects the windows of `window` samples in the training data of `course`, one every `stride` samples.
    pub fn new(course: &Course<'_>, window: usize, stride: usize) -> Self {
        let joints = course.joint_count();
        let mut rows = Vec::new();
        for stretch in course.stretches() {
            for window in stretch.windows(window).step_by(stride) {
                let torques = window.iter().flat_map(|signal| &signal.torque[..joints]);
                rows.extend(torques);
            }
        }
        let dimensions = window * joints;
        let scaling = Scaling::fit(dimensions, rows.chunks_exact(dimensions));
        for row in rows.chunks_exact_mut(dimensions) {
            scaling.apply(row);
        }
        Self { scaling, rows }
    }

    /// Creates vectors that are already scaled, for tests of the models.
    #[cfg(test)]
    pub fn unscaled(dimensions: usize, rows: Vec<f64>) -> Self {
        let ends = [vec![0.0; dimensions], vec![1.0; dimensions]];
        let scaling = Scaling::fit(dimensions, ends.iter().map(Vec::as_slice));
        Self { scaling, rows }
    }

    /// Returns all vectors, concatenated.
    pub fn rows(&self) -> &[f64] {
        &self.rows
    }

    /// Returns the length of a vector.
    pub fn dimensions(&self) -> usize {
        self.scaling.dimensions()
    }

    /// Saves a model that was trained on the vectors.
    pub fn save(&self, model: &dyn VectorModel, into: &mut Trained) {
        self.scaling.save("input", into);
        model.save(into);
    }
}

/// Scores the newest window.
pub(crate) struct VectorScorer<M> {
    joints: usize,
    scaling: Scaling,
    model: M,
    /// Torques of the newest samples, oldest first, up to one window.
    torques: VecDeque<f64>,
    row: Vec<f64>,
}

impl<M: VectorModel> VectorScorer<M> {
    /// Loads what [`Vectors::save`] saved; `load` reads the model.
    ///
    /// # Errors
    /// If an array is missing or has another shape.
    pub fn load(
        from: &Trained,
        load: impl Fn(usize, &Trained) -> Result<M, TrainedError>,
    ) -> Result<Self, TrainedError> {
        let joints = from.facts().joints.len();
        let dimensions = joints * from.facts().window;
        Ok(Self {
            joints,
            scaling: Scaling::load("input", dimensions, from)?,
            model: load(dimensions, from)?,
            torques: VecDeque::with_capacity(dimensions + joints),
            row: Vec::with_capacity(dimensions),
        })
    }
}

impl<M: VectorModel> Scorer for VectorScorer<M> {
    fn score(&mut self, signal: &Signal) -> Option<f64> {
        let dimensions = self.scaling.dimensions();
        self.torques.extend(&signal.torque[..self.joints]);
        if self.torques.len() > dimensions {
            self.torques.drain(..self.joints);
        }
        if self.torques.len() < dimensions {
            return None;
        }
        self.row.clear();
        self.row.extend(&self.torques);
        self.scaling.apply(&mut self.row);
        Some(self.model.score(&self.row))
    }

    fn reset(&mut self) {
        self.torques.clear();
    }
}
