//! Detectors that judge one vector of external torques: those of one sample, or of a window of samples
//! one after the other, oldest first.

use std::collections::VecDeque;

use super::runner::{Course, Scorer};
use super::scaling::Scaling;
use super::signals::Signal;
use crate::frame::{Trained, TrainedError};

/// Tells how unlike its training data a scaled vector is.
pub(crate) trait VectorModel: Send {
    /// The score; the larger, the less alike.
    fn score(&mut self, x: &[f64]) -> f64;

    /// Keeps its arrays.
    fn save(&self, into: &mut Trained);
}

/// Scaled training vectors.
#[derive(Debug)]
pub(crate) struct Vectors {
    scaling: Scaling,
    rows: Vec<f64>,
}

impl Vectors {
    /// The windows of `window` samples in the training data of `course`, one every `stride` samples.
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

    /// Vectors that are scaled already, for tests of the models.
    #[cfg(test)]
    pub fn unscaled(dimensions: usize, rows: Vec<f64>) -> Self {
        let ends = [vec![0.0; dimensions], vec![1.0; dimensions]];
        let scaling = Scaling::fit(dimensions, ends.iter().map(Vec::as_slice));
        Self { scaling, rows }
    }

    /// All of them, one after the other.
    pub fn rows(&self) -> &[f64] {
        &self.rows
    }

    /// Numbers in one of them.
    pub fn dimensions(&self) -> usize {
        self.scaling.dimensions()
    }

    /// Keeps a model that was trained on them.
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
    /// The torques of the last samples, oldest first; full when a window is.
    torques: VecDeque<f64>,
    row: Vec<f64>,
}

impl<M: VectorModel> VectorScorer<M> {
    /// What [`Vectors::save`] kept; `load` reads the model.
    ///
    /// # Errors
    /// If an array is not there or has another shape.
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
