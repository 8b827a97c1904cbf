//! Inertial effort that the twin lacks because its acceleration lags.
//!
//! An acceleration has to be low-passed, so the twin sees a motion only some time after it began. Where an arm starts
//! or stops, the residual contains the inertia times the acceleration that the twin lacks. The change of velocity
//! shows this at once (as in a momentum observer: Haddadin, De Luca and Albu-Schäffer 2017, section III-D), but adds
//! noise.

use tauscope_bus::{JointArray, MAX_JOINTS, TwinState};

use crate::frame::momentum::Inertia;
use crate::frame::{Lesson, Lessons, Setup, Tap};

/// Inertial effort that the twin lacks, by joint; NaN where it is unknown. No allocation per sample.
#[derive(Debug)]
pub(crate) struct Late {
    inertia: Option<Tap<Inertia>>,
    /// Effort per torque, by joint \[effort unit per N m\].
    effort_per_nm: JointArray,
}

impl Late {
    /// Creates the estimator for the robot of `setup`.
    pub fn new(setup: &Setup) -> Self {
        let mut effort_per_nm = [f64::NAN; MAX_JOINTS];
        for (per_nm, joint) in effort_per_nm.iter_mut().zip(&setup.joints) {
            if joint.tells_torque() {
                *per_nm = joint.effort_per_nm;
            }
        }
        Self {
            inertia: Inertia::of(setup),
            effort_per_nm,
        }
    }

    /// Returns the mean over the step to the next sample of M times the acceleration that the twin lacks \[effort
    /// unit\].
    pub fn next(&mut self, sample: &TwinState) -> JointArray {
        let Some(inertia) = &mut self.inertia else {
            return [f64::NAN; MAX_JOINTS];
        };
        let mut late = inertia.with(|inertia| inertia.update(sample));
        for (late, per_nm) in late.iter_mut().zip(&self.effort_per_nm) {
            *late *= per_nm;
        }
        late
    }
}

/// [`Late`] of all samples of recordings.
#[derive(Debug)]
pub(crate) struct LateIn {
    train: Vec<Vec<JointArray>>,
    validation: Vec<Vec<JointArray>>,
}

impl LateIn {
    pub fn of(lessons: &Lessons<'_>, setup: &Setup) -> Self {
        // Not shared: only detectors that are given the same samples may share.
        let own = Setup {
            shared: None,
            ..setup.clone()
        };
        let of = |lesson: &Lesson| {
            let mut late = Late::new(&own);
            let samples = lesson.samples.iter();
            samples.map(|sample| late.next(sample)).collect()
        };
        Self {
            train: lessons.train.iter().map(of).collect(),
            validation: lessons.validation.iter().map(of).collect(),
        }
    }

    /// Returns the values by recording, the training ones first.
    pub fn recordings(&self) -> impl Iterator<Item = &[JointArray]> {
        let all = self.train.iter().chain(&self.validation);
        all.map(Vec::as_slice)
    }
}
