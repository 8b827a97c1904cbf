//! Measurements of a corrected twin on contact-free recordings: residual noise, suitable low-passes, and statistics
//! of the detectors' scores.

use std::path::PathBuf;

use tauscope_bus::TwinState;
use tauscope_detect::Detector;
use tauscope_twin::TwinFile;

use super::cutoff::Cutoffs;
use super::spread::Spread;
use super::{CalibrateError, Job};
use crate::build;
use crate::replay::ReplayError;

impl Job<'_> {
    /// The RMS of each joint's filtered residual with the corrected twin `file` on `recordings` \[effort unit\].
    ///
    /// # Errors
    /// If a recording cannot be read, or the twin does not fit the cell.
    pub fn residual_rms(
        &self,
        file: &TwinFile,
        recordings: &[PathBuf],
    ) -> Result<Vec<f64>, CalibrateError> {
        let mut noise = vec![Spread::default(); self.cell.facts.joint_names.len()];
        for recording in recordings {
            self.each(recording, Some(file), &mut |_| {}, &mut |sample| {
                add(&mut noise, sample);
            })?;
        }
        Ok(noise.iter().map(Spread::root_mean_square).collect())
    }

    /// Chooses the low-pass on the efforts of each joint with the corrected twin `file` on contact-free `recordings`,
    /// and stores it in `file`.
    ///
    /// # Errors
    /// If a recording cannot be read, or the twin does not fit the cell.
    pub fn choose_cutoffs(
        &self,
        file: &mut TwinFile,
        recordings: &[PathBuf],
        progress: &dyn Fn(usize, f64),
    ) -> Result<(), CalibrateError> {
        let names = &self.cell.facts.joint_names;
        let mut cutoffs = Cutoffs::new(file.filters.effort_cutoff_hz, names.len());
        for (index, recording) in recordings.iter().enumerate() {
            let step = &mut |fraction| progress(index, fraction);
            self.each(recording, Some(file), step, &mut |sample| {
                cutoffs.take(sample);
            })?;
        }
        for (name, cutoff_hz) in names.iter().zip(cutoffs.chosen()) {
            if let Some(joint) = file.joints.get_mut(name) {
                joint.effort_cutoff_hz = cutoff_hz;
            }
        }
        Ok(())
    }

    /// Measures the noise of the residual and the detectors' scores with the corrected twin `file` on contact-free
    /// `recordings`, and stores them in `file`. Returns the number of lost samples.
    ///
    /// # Errors
    /// If a recording cannot be read, or the twin does not fit the cell.
    pub fn measure(
        &self,
        file: &mut TwinFile,
        recordings: &[PathBuf],
        progress: &dyn Fn(usize, f64),
    ) -> Result<u64, CalibrateError> {
        let names = &self.cell.facts.joint_names;
        let mut noise = vec![Spread::default(); names.len()];
        let mut detectors = self
            .detectors(file)
            .map_err(|source| CalibrateError::Recording {
                recording: recordings.first().cloned().unwrap_or_default(),
                source,
            })?;
        let mut lost = 0;
        for (index, recording) in recordings.iter().enumerate() {
            let step = &mut |fraction| progress(index, fraction);
            let read = self.each(recording, Some(file), step, &mut |sample| {
                add(&mut noise, sample);
                for (detector, spread) in &mut detectors {
                    let judgement = detector.judge(sample);
                    if judgement.ready {
                        spread.add(judgement.score);
                    }
                }
            })?;
            lost += read.lost;
        }
        for (name, spread) in names.iter().zip(&noise) {
            if let Some(joint) = file.joints.get_mut(name) {
                // RMS about zero, because a constant error of the twin is noise to a detector, too.
                joint.noise = (spread.count > 0).then(|| spread.root_mean_square());
            }
        }
        file.scores = (detectors.iter())
            .filter(|(_, spread)| spread.count > 0)
            .map(|(detector, spread)| (detector.name().to_owned(), spread.statistics()))
            .collect();
        Ok(lost)
    }

    /// Every detector behind this twin, with empty score statistics.
    fn detectors(&self, file: &TwinFile) -> Result<Vec<Scored>, ReplayError> {
        let setup = build::detect_setup(Some(file), self.cell)?;
        let all = tauscope_detect::Config::calibrated(&setup).map_err(build::BuildError::from)?;
        Ok(all
            .into_iter()
            .map(|detector| (detector, Spread::default()))
            .collect())
    }
}

/// Adds the residual of a sample, by joint.
fn add(noise: &mut [Spread], sample: &TwinState) {
    for (spread, residual) in noise.iter_mut().zip(sample.residual) {
        spread.add(residual);
    }
}

/// A detector with the statistics of its score.
type Scored = (Box<dyn Detector>, Spread);
